"""Cases in worker processes of this machine, side by side, each within its limits."""

from __future__ import annotations

import queue
import signal
import threading
import time
from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from nlsolve.contracts.status import InputError, Status
from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import SECONDS_BETWEEN_LOOKS, Engine, Listener, Turn, Turns
from nlsolve.running.engines.execution import part_without_record
from nlsolve.running.engines.in_process import run_here
from nlsolve.running.engines.places import frames_of_dump, origins, place
from nlsolve.running.engines.processes.process import WorkerProcess
from nlsolve.running.engines.processes.travel import Ended, NotPortable, Ready, Task, Unreadable, packed
from nlsolve.running.engines.processes.worker import PLACE_SIGNAL, SIGNALS, limit_of
from nlsolve.solving.simulate import Progress
from nlsolve.study.timing import Timing

TICK = 0.1
"""How often the limits of a case are looked at [s]."""

GRACE = 3.0
"""Time for a case to end by itself after it has been stopped, before its process is killed [s]."""

FAR_OVER = 1.25
"""Memory over the limit at which no grace is given."""

START = 120.0
"""Time for a worker to start [s]."""

KILLED = frozenset({signal.SIGKILL, signal.SIGTERM, signal.SIGHUP})
"""Signals that come from outside; a case whose process got one is run once more."""

END = object()

_now = time.monotonic


@dataclass(frozen=True)
class _Report:
    """What a lane tells the main thread: progress, a part, why there is none, or the error that has ended the lane."""

    lane: _Lane
    turn: Turn
    what: Progress | Part | Unreadable | Exception


class Workers(Engine):
    """`jobs` worker processes, which are reused while the cases leave them as they were."""

    def __init__(self, jobs: int) -> None:
        super().__init__()
        self.jobs = jobs

    def parts(self, turns: Turns, timing: Timing, tell: Listener) -> Generator[tuple[Turn, Part], None, None]:
        """Yields the turns as they end. A case that cannot go to a worker is run here, and a note says so."""
        crew, more = _Crew(self.jobs), True
        try:
            while more or crew.running:
                held = False
                while more and not held and crew.has_room:
                    turn: Any = next(turns, END)
                    if turn is END:
                        more = False
                    elif turn is None:
                        held = True
                    else:
                        tell(turn.event())
                        try:
                            crew.give(turn, packed(turn.case, timing))
                        except NotPortable as reason:
                            yield turn, self._here(turn, timing, tell, str(reason))
                report = crew.report(SECONDS_BETWEEN_LOOKS if held else None)
                if report is None:
                    continue
                for sentence in report.lane.notes:
                    self.note(sentence)
                if isinstance(report.what, Exception):
                    raise report.what
                if isinstance(report.what, Progress):
                    tell(report.turn.event(report.what))
                elif isinstance(report.what, Unreadable):
                    yield report.turn, self._here(report.turn, timing, tell, report.what.reason)
                else:
                    yield report.turn, report.what
        finally:
            crew.end()

    def _here(self, turn: Turn, timing: Timing, tell: Listener, reason: str) -> Part:
        self.note(f"{reason}: its cases were run in this process, one after the other and without limits")
        return run_here(turn, timing, tell)


class _Crew:
    """The lanes of an engine.

    running : number of turns that are given and have not ended.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs, self.running = jobs, 0
        self._reports: queue.SimpleQueue[_Report] = queue.SimpleQueue()
        self._lanes: list[_Lane] = []
        self._free: list[_Lane] = []

    @property
    def has_room(self) -> bool:
        """Whether another turn can be given."""
        return self.running < self.jobs

    def give(self, turn: Turn, task: Task) -> None:
        """Have a task done by a lane that is free, or a new one."""
        if not self._free:
            self._free.append(_Lane(self._reports))
            self._lanes.append(self._free[-1])
        self._free.pop().give(turn, task)
        self.running += 1

    def report(self, seconds: float | None) -> _Report | None:
        """What a lane tells next; None when nothing runs, or nothing is told within `seconds`."""
        if not self.running:
            time.sleep(seconds or 0.0)
            return None
        try:
            report = self._reports.get(timeout=seconds)
        except queue.Empty:
            return None
        if not isinstance(report.what, Progress):
            self.running -= 1
            self._free.append(report.lane)
        return report

    def end(self) -> None:
        """Stop whatever runs."""
        for lane in self._lanes:
            lane.end()
        for lane in self._lanes:
            lane.thread.join()


class _Lane:
    """One worker process after the other, and the thread that watches over them.

    notes : sentences on what the worker lacks.
    """

    def __init__(self, reports: queue.SimpleQueue[_Report]) -> None:
        self.reports, self.notes = reports, list[str]()
        self.tasks: queue.SimpleQueue[tuple[Turn, Task] | None] = queue.SimpleQueue()
        self.worker: WorkerProcess | None = None
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def give(self, turn: Turn, task: Task) -> None:
        """Have a task done."""
        self.tasks.put((turn, task))

    def end(self) -> None:
        """Stop whatever runs; the thread ends."""
        self.ending.set()
        self.tasks.put(None)

    def _run(self) -> None:
        try:
            while (given := self.tasks.get()) is not None and not self.ending.is_set():
                turn, task = given
                try:
                    found: Part | Unreadable | Exception | None = self._done(turn, task)
                except Exception as error:  # a mistake here must reach the main thread, which waits for this one
                    found = error
                if found is not None:
                    self.reports.put(_Report(self, turn, found))
        finally:
            self._drop()

    def _done(self, turn: Turn, task: Task) -> Part | Unreadable | None:
        """The part of a task; once more where something from outside has killed the process. None when ending."""
        known = origins(turn.case.parts)
        for last in (False, True):
            worker = self._started()
            if worker is None:
                return None
            worker.begin()
            worker.send(task)
            found = self._watched(worker, turn, task, known)
            if worker.gone and found is None and not self.ending.is_set():
                found = self._died(worker, task, known, last)
            if found is not None or self.ending.is_set():
                return found
        raise AssertionError("a task has an ending")

    def _started(self) -> WorkerProcess | None:
        """A worker that is ready; None when ending. Raises InputError when none can be started."""
        if self.worker is not None:
            return self.worker
        self.worker = WorkerProcess()
        while not self.ending.is_set():
            answer = self.worker.answer(TICK)
            if isinstance(answer, Ready):
                self.notes = [
                    f"{library} has {threads} threads in a worker, though it was asked for one"
                    for library, threads in answer.threads.items()
                ]
                return self.worker
            if self.worker.gone or _now() - self.worker.begun > START:
                said = self.worker.output.strip().splitlines()
                raise InputError(
                    f"no worker process can be started ({said[-1] if said else 'it says nothing'}): "
                    "run the study in this process with --isolation none"
                )
        return None

    def _watched(
        self, worker: WorkerProcess, turn: Turn, task: Task, known: Mapping[str, str]
    ) -> Part | Unreadable | None:
        """The answer of a worker, or the part of a case that was killed at a limit; None when the worker has died."""
        begun = looked = _now()
        stopped, stopped_at = None, 0.0
        while not self.ending.is_set():
            answer = worker.answer(TICK)
            if isinstance(answer, Progress):
                self.reports.put(_Report(self, turn, answer))
            elif isinstance(answer, Unreadable):
                return answer
            elif isinstance(answer, Ended):
                output = worker.output
                if stopped or answer.changed or worker.resident() > task.limits.bytes / 2:
                    self._drop()
                return replace(answer.part, output=output)
            elif worker.gone:
                return None
            elif _now() - looked < TICK / 2:  # it has printed something
                continue
            elif stopped is None:
                looked = _now()
                if _now() - begun > task.limits.seconds:
                    stopped = Status.TIMED_OUT
                elif worker.resident() > task.limits.bytes:
                    stopped = Status.OUT_OF_MEMORY
                if stopped is not None:
                    stopped_at = _now()
                    worker.signal(PLACE_SIGNAL)
                    worker.signal(SIGNALS[stopped])
            elif _now() - stopped_at > GRACE or worker.resident() > FAR_OVER * task.limits.bytes:
                worker.kill()
                where = place(frames_of_dump(worker.faults), known)
                part = part_without_record(task.case, task.parameters, stopped, f"{limit_of(task, stopped)}{where}")
                part = replace(part, output=worker.output)
                self._drop()
                return part
        return None

    def _died(self, worker: WorkerProcess, task: Task, known: Mapping[str, str], last: bool) -> Part | None:
        """The part of a case whose process has died; None when it is to be run once more."""
        code = worker.exit_code(1.0)
        killed = worker.kill()
        code = killed if code is None else code
        where, output = place(frames_of_dump(worker.faults), known), worker.output
        self._drop()
        if -code in KILLED and not last:
            return None
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        detail = f"the interpreter ended with {how}{where}"
        part = part_without_record(task.case, task.parameters, Status.CRASHED, detail, how)
        return replace(part, output=output)

    def _drop(self) -> None:
        """End the worker; the next task gets a new one."""
        worker, self.worker = self.worker, None
        if worker is not None:
            worker.kill()
            worker.close()
