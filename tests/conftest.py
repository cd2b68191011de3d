"""Property tests draw the same examples in every run, however slow the machine; cases run in the process of the tests,
which replace what they need to, unless a test asks for worker processes.
"""

from hypothesis import settings

from nlsolve.running.engines import choice

settings.register_profile("same-everywhere", deadline=None, derandomize=True)
settings.load_profile("same-everywhere")

choice.ISOLATION = "none"
