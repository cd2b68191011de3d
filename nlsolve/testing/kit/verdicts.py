"""Promises of a contract by name: a check raises at the first that is broken, or all of them are put down.

    with promise("start", "the first state yielded is the start itself"):
        require(np.array_equal(seen[0], start), "the first state yielded must be the start itself")

`verdicts(lambda: check_solver(MySolver()))` goes on after a broken promise; what needs it was not reached.
"""

from __future__ import annotations

import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

import numpy as np

from nlsolve.contracts.status import CaseStopped, Status

SECONDS = 50.0
"""Time that all checks of one component may take [s]."""

HERE = str(Path(__file__).parents[1])

WHOLE = "check"
"""The name of the promise that the checks can be carried out at all."""


@dataclass(frozen=True)
class Verdict:
    """What was found of one promise.

    meaning : what is promised.
    failure : the sentence that says how it is broken; empty where it holds.
    reached : False where an earlier failure has left nothing to check it on.
    """

    name: str
    meaning: str
    failure: str = ""
    reached: bool = True

    @property
    def holds(self) -> bool:
        """Whether the promise was checked and holds."""
        return self.reached and not self.failure


@dataclass
class _Promise:
    meaning: str
    kept: int = 0
    failure: str = ""


Told = Callable[[str, tuple[Verdict, ...]], None]
"""Is told the promise that is being checked whenever that changes, and what has been found so far."""


@dataclass
class _Report:
    deadline: float
    homes: tuple[str, ...] = (HERE,)
    promises: dict[str, _Promise] = field(default_factory=dict)
    running: list[str] = field(default_factory=list)
    told: Told = lambda name, found: None

    @contextmanager
    def during(self, name: str) -> Iterator[None]:
        """Within, the promise of this name is being checked."""
        self.running.append(name)
        self.told(name, self.verdicts())
        try:
            yield
        finally:
            self.running.pop()
            if self.running:
                self.told(self.running[-1], self.verdicts())

    def verdicts(self) -> tuple[Verdict, ...]:
        """What has been found of each promise."""
        return tuple(
            Verdict(name, found.meaning, found.failure, bool(found.kept or found.failure))
            for name, found in self.promises.items()
        )


_REPORT: ContextVar[_Report | None] = ContextVar("report", default=None)


@contextmanager
def promise(name: str, meaning: str) -> Iterator[None]:
    """Check one promise: what is raised passes, unless `verdicts` puts it down. A name may come up several times."""
    report = _REPORT.get()
    if report is None:
        yield
        return
    found = report.promises.setdefault(name, _Promise(meaning))
    failure = ""
    try:
        with report.during(name), _until(report.deadline):
            yield
    except CaseStopped as stopped:
        failure = stopped.detail
    except AssertionError as broken:
        failure = str(broken) or "an assertion of the plugin does not hold"
    except (Exception, SystemExit) as error:  # a stranger's plugin may raise anything
        if isinstance(error, NameError) and _place(error).startswith(report.homes):
            return  # what it is checked on was not made: an earlier promise is broken
        failure = f"raised {type(error).__name__}: {error} ({_place(error)})"
    found.kept += not failure
    found.failure = found.failure or failure


def verdicts(check: Callable[[], None], seconds: float = SECONDS, told: Told | None = None) -> tuple[Verdict, ...]:
    """What a check finds of each promise, in order. What it raises besides is the failure of the promise "check"."""
    report = _Report(time.monotonic() + seconds, (HERE, check.__code__.co_filename))
    report.told = told or report.told
    token = _REPORT.set(report)
    try:
        with promise(WHOLE, "the checks can be carried out"), np.errstate(all="ignore"):
            check()
    finally:
        _REPORT.reset(token)
    whole = report.promises.pop(WHOLE)
    if whole.failure:
        report.promises[WHOLE] = whole
    return report.verdicts()


def _place(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{frame.filename}:{frame.lineno}"


@contextmanager
def _until(deadline: float) -> Iterator[None]:
    """Raises CaseStopped in the main thread when the deadline has passed; nested uses keep the outer one's clock."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise CaseStopped(Status.TIMED_OUT, "the check took too long: does a loop never end, or never yield?")

    before = signal.signal(signal.SIGALRM, stop)
    left, _ = signal.getitimer(signal.ITIMER_REAL)
    signal.setitimer(signal.ITIMER_REAL, max(1e-3, deadline - time.monotonic()), 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, left)
        signal.signal(signal.SIGALRM, before)
