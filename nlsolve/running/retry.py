"""Which finished cases are run again."""

from __future__ import annotations

from collections.abc import Collection

from nlsolve.contracts.status import STOPPED, Status
from nlsolve.results.verdicts import Run, number, status_of
from nlsolve.study.limits import Limits, bytes_of

TRIED_AGAIN = frozenset({Status.CRASHED, Status.NOT_APPLICABLE})
"""A case with one of these statuses is run again: what it lacked may have been installed since."""


def is_final(run: Run) -> bool:
    """Whether a case has ended in a way that costs too much to be tried without being asked: it ended the interpreter
    or was stopped at a limit.
    """
    return status_of(run) in STOPPED or isinstance(run.get("interpreter"), str)


def lacks_something(run: Run) -> bool:
    """Whether a case ended on an error that may be gone by now, so that its part does not count."""
    return status_of(run) in TRIED_AGAIN and not is_final(run)


def is_tried_again(run: Run, limits: Limits, retry: Collection[Status] = ()) -> bool:
    """Whether a finished case is run again.

    limits : what the case may cost now; a case that was stopped is run again when its limit has been raised.
    retry : statuses that are run again whatever they have cost.
    """
    status = status_of(run)
    if status in retry:
        return True
    if status is Status.TIMED_OUT:
        return limits.seconds > number(run.get("limits.seconds"))
    if status is Status.OUT_OF_MEMORY:
        before = run.get("limits.memory")
        return isinstance(before, str) and limits.bytes > bytes_of(before)
    return lacks_something(run)
