"""Compare nonlinear solution strategies on equal terms: the users' door.

A name is loaded when it is first used, so that `import nlsolve` is fast.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nlsolve.contracts.outcome import Outcome
    from nlsolve.contracts.status import InputError, SolveError, Status
    from nlsolve.registry.problems import StudyError
    from nlsolve.running.interactive import compare, solve
    from nlsolve.running.march import March, march
    from nlsolve.running.results import Results
    from nlsolve.running.runner import Event, load, run
    from nlsolve.running.store.parts import StoreError
    from nlsolve.solving.simulate import Progress
    from nlsolve.study.study import Study

try:
    __version__ = version("nlsolve")
except PackageNotFoundError:  # a checkout that is on the path but not installed, which has no plugins
    __version__ = "not installed"

_HOME = {
    "Event": "nlsolve.running.runner",
    "InputError": "nlsolve.contracts.status",
    "Outcome": "nlsolve.contracts.outcome",
    "Progress": "nlsolve.solving.simulate",
    "Results": "nlsolve.running.results",
    "SolveError": "nlsolve.contracts.status",
    "Status": "nlsolve.contracts.status",
    "StoreError": "nlsolve.running.store.parts",
    "Study": "nlsolve.study.study",
    "StudyError": "nlsolve.registry.problems",
    "March": "nlsolve.running.march",
    "compare": "nlsolve.running.interactive",
    "load": "nlsolve.running.runner",
    "march": "nlsolve.running.march",
    "run": "nlsolve.running.runner",
    "solve": "nlsolve.running.interactive",
}

__all__ = [
    "Event",
    "InputError",
    "March",
    "Outcome",
    "Progress",
    "Results",
    "SolveError",
    "Status",
    "StoreError",
    "Study",
    "StudyError",
    "__version__",
    "compare",
    "load",
    "march",
    "run",
    "solve",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(
            f"module 'nlsolve' has no attribute {name!r}: what plugins are written with is in nlsolve.plugin"
        )
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
