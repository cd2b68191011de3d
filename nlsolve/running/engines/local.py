"""Cases in worker processes of this machine, side by side, each within its limits."""

from __future__ import annotations

import queue
import threading

from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import Turn
from nlsolve.running.engines.places import origins
from nlsolve.running.engines.processes.keeper import Keeper
from nlsolve.running.engines.processes.travel import Task, Unreadable
from nlsolve.running.engines.side_by_side import Crew, Report, SideBySide


class Workers(SideBySide):
    """`jobs` worker processes, which are reused while the cases leave them as they were."""

    def __init__(self, jobs: int) -> None:
        super().__init__()
        self.jobs = jobs

    def crew(self) -> Crew:
        """As many lanes as jobs, begun when they are needed."""
        return _Lanes(self.jobs)


class _Lanes(Crew):
    """One lane for each job."""

    def __init__(self, jobs: int) -> None:
        super().__init__()
        self.jobs = jobs
        self._lanes: list[_Lane] = []
        self._free: list[_Lane] = []
        self._busy: dict[int, _Lane] = {}

    @property
    def room(self) -> int:
        return self.jobs

    def start(self, turn: Turn, task: Task) -> None:
        """By a lane that is free, or a new one."""
        if not self._free:
            self._free.append(_Lane(self.reports))
            self._lanes.append(self._free[-1])
        lane = self._busy[turn.number] = self._free.pop()
        lane.give(turn, task)

    def free(self, turn: Turn) -> None:
        self._free.append(self._busy.pop(turn.number))

    def end(self) -> None:
        for lane in self._lanes:
            lane.end()
        for lane in self._lanes:
            lane.thread.join()


class _Lane:
    """The thread that has one task after the other done by a worker process."""

    def __init__(self, reports: queue.SimpleQueue[Report]) -> None:
        self.reports, self.keeper = reports, Keeper()
        self.tasks: queue.SimpleQueue[tuple[Turn, Task] | None] = queue.SimpleQueue()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def give(self, turn: Turn, task: Task) -> None:
        """Have a task done."""
        self.tasks.put((turn, task))

    def end(self) -> None:
        """Stop whatever runs; the thread ends."""
        self.keeper.ending.set()
        self.tasks.put(None)

    def _run(self) -> None:
        try:
            while (given := self.tasks.get()) is not None and not self.keeper.ending.is_set():
                turn, task = given
                try:
                    found: Part | Unreadable | Exception | None = self.keeper.done(
                        task,
                        origins(turn.case.parts),
                        lambda progress, turn=turn: self.reports.put(Report(turn, progress)),  # type: ignore[misc]
                    )
                except Exception as error:  # a mistake here must reach the main thread, which waits for this one
                    found = error
                if found is not None:
                    self.reports.put(Report(turn, found, self.keeper.notes))
        finally:
            self.keeper.drop()
