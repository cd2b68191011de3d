"""Cases in worker processes of this machine, side by side, each within its limits."""

from __future__ import annotations

import queue
import threading

from nlsolve.results.costs.lanes import ALONE, EXCLUSIVE, SHARED
from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import Turn
from nlsolve.running.engines.places import origins
from nlsolve.running.engines.processes.keeper import Keeper
from nlsolve.running.engines.processes.travel import Task, Unreadable
from nlsolve.running.engines.side_by_side import Crew, Report, SideBySide
from nlsolve.running.timing.cores import calmest, cores_here, stay_on


class Workers(SideBySide):
    """`jobs` worker processes, which are reused while the cases leave them as they were."""

    def __init__(self, jobs: int) -> None:
        super().__init__(ALONE if jobs == 1 else SHARED)
        self.jobs = jobs

    def crew(self) -> Crew:
        """As many hands as jobs, begun when they are needed."""
        return _Hands(self.jobs)


class Pinned(SideBySide):
    """One worker process, which stays on the calmest core; this thread is kept off that core if there is another."""

    def __init__(self) -> None:
        super().__init__(EXCLUSIVE)

    def crew(self) -> Crew:
        """One hand on a core of its own."""
        cores = cores_here()
        if not cores:
            self.note("this system keeps no process on a core: the cases were timed on whichever core they were given")
            return _Hands(1)
        core = calmest(cores)
        if len(cores) == 1:
            self.note("there is one core only: what runs the study was on it too while cases were timed")
        return _PinnedHand(core, cores)


class _Hands(Crew):
    """One hand for each job.

    core : the core that their processes stay on; absent: whichever there is.
    """

    def __init__(self, jobs: int, core: int | None = None) -> None:
        super().__init__()
        self.jobs, self.core = jobs, core
        self._hands: list[_Hand] = []
        self._free: list[_Hand] = []
        self._busy: dict[int, _Hand] = {}

    @property
    def room(self) -> int:
        return self.jobs

    def start(self, turn: Turn, task: Task) -> None:
        """By a hand that is free, or a new one."""
        if not self._free:
            self._free.append(_Hand(self.reports, self.core))
            self._hands.append(self._free[-1])
        hand = self._busy[turn.number] = self._free.pop()
        hand.give(turn, task)

    def free(self, turn: Turn) -> None:
        self._free.append(self._busy.pop(turn.number))

    def end(self) -> None:
        for hand in self._hands:
            hand.end()
        for hand in self._hands:
            hand.thread.join()


class _PinnedHand(_Hands):
    """One hand on a core, and this thread on the others until the end."""

    def __init__(self, core: int, cores: frozenset[int]) -> None:
        super().__init__(1, core)
        self._cores = cores
        stay_on(cores - {core} or cores)

    def end(self) -> None:
        super().end()
        stay_on(self._cores)


class _Hand:
    """The thread that has one task after the other done by a worker process."""

    def __init__(self, reports: queue.SimpleQueue[Report], core: int | None) -> None:
        self.reports, self.keeper = reports, Keeper(core=core)
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
