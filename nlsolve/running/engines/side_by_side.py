"""Cases side by side, each in a worker process somewhere: the loop that all such engines share."""

from __future__ import annotations

import queue
import time
from abc import ABC, abstractmethod
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any

from nlsolve.results.costs.lanes import ALONE, EXCLUSIVE
from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import SECONDS_BETWEEN_LOOKS, Engine, Listener, Turn, Turns
from nlsolve.running.engines.in_process import run_here
from nlsolve.running.engines.processes.travel import NotPortable, Task, Unreadable, packed
from nlsolve.solving.simulate import Progress
from nlsolve.solving.way import Way
from nlsolve.study.timing import Timing

END = object()


@dataclass(frozen=True)
class Report:
    """What is told of a turn: progress, its way, a part, why there is none, or an error that ends the run.

    notes : sentences on what the worker lacks.
    """

    turn: Turn
    what: Progress | Way | Part | Unreadable | Exception
    notes: Sequence[str] = ()


class Crew(ABC):
    """Those who do the tasks of a run.

    running : number of turns that are given and have not ended.
    """

    def __init__(self) -> None:
        self.running = 0
        self.reports: queue.SimpleQueue[Report] = queue.SimpleQueue()

    @property
    @abstractmethod
    def room(self) -> int:
        """How many turns may run at a time."""

    @abstractmethod
    def start(self, turn: Turn, task: Task) -> None:
        """Begin a task. Its progress and its ending become `reports`, from any thread."""

    @abstractmethod
    def free(self, turn: Turn) -> None:
        """Whoever had this turn may have another one."""

    @abstractmethod
    def end(self) -> None:
        """Stop whatever runs."""

    def give(self, turn: Turn, task: Task) -> None:
        """Have a task done."""
        self.start(turn, task)
        self.running += 1

    def report(self, seconds: float | None) -> Report | None:
        """What is told next; None when nothing runs, or nothing is told within `seconds`."""
        if not self.running:
            time.sleep(seconds or 0.0)
            return None
        try:
            report = self.reports.get(timeout=seconds)
        except queue.Empty:
            return None
        if not isinstance(report.what, Progress | Way):
            self.running -= 1
            self.free(report.turn)
        return report


class SideBySide(Engine):
    """An engine whose crew runs several cases at a time."""

    @abstractmethod
    def crew(self) -> Crew:
        """A crew for one run."""

    def parts(self, turns: Turns, timing: Timing, tell: Listener) -> Generator[tuple[Turn, Part], None, None]:
        """Yields the turns as they end. A case that cannot go to a worker is run here, and a note says so."""
        crew, more = self.crew(), True
        try:
            while more or crew.running:
                held = False
                while more and not held and crew.running < crew.room:
                    turn: Any = next(turns, END)
                    if turn is END:
                        more = False
                    elif turn is None:
                        held = True
                    else:
                        tell(turn.event())
                        try:
                            crew.give(turn, packed(turn.case, timing, self.lane, turn.way))
                        except NotPortable as reason:
                            yield turn, self._here(turn, timing, tell, str(reason))
                report = crew.report(SECONDS_BETWEEN_LOOKS if held else None)
                if report is None:
                    continue
                for sentence in report.notes:
                    self.note(sentence)
                if isinstance(report.what, Exception):
                    raise report.what
                if isinstance(report.what, Way):
                    report.turn.share(report.what)
                elif isinstance(report.what, Progress):
                    tell(report.turn.event(report.what))
                elif isinstance(report.what, Unreadable):
                    yield report.turn, self._here(report.turn, timing, tell, report.what.reason)
                else:
                    yield report.turn, report.what
        finally:
            crew.end()

    def _here(self, turn: Turn, timing: Timing, tell: Listener, reason: str) -> Part:
        self.note(f"{reason}: its cases were run in this process, one after the other and without limits")
        return run_here(turn, timing, tell, ALONE if self.lane == EXCLUSIVE else self.lane)
