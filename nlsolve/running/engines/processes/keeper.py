"""Tasks done one after the other, each within its limits, by a worker process that is replaced after any fault."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from nlsolve.contracts.status import InputError, Status
from nlsolve.registry.installed.probing import how_it_ended
from nlsolve.results.frames import Part
from nlsolve.running.engines.execution import part_without_record
from nlsolve.running.engines.places import frames_of_dump, place
from nlsolve.running.engines.processes.process import WorkerProcess
from nlsolve.running.engines.processes.travel import Ended, Ready, Task, Unreadable, Warm
from nlsolve.running.engines.processes.worker import PLACE_SIGNAL, SIGNALS, limit_of
from nlsolve.solving.simulate import Progress
from nlsolve.solving.way import Way

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

_now = time.monotonic


class Keeper:
    """One worker process after the other, for one task at a time.

    folder : the folder in which the processes work; absent: that of this process.
    core : the core that they are kept on; absent: whichever there is.
    notes : sentences on what the worker lacks.
    ending : is set, by any thread, to stop whatever runs.
    """

    def __init__(self, folder: str | None = None, core: int | None = None) -> None:
        self.folder, self.core, self.notes = folder, core, list[str]()
        self.worker: WorkerProcess | None = None
        self.ending = threading.Event()

    def done(
        self, task: Task, known: Mapping[str, str], tell: Callable[[Progress | Way], None]
    ) -> Part | Unreadable | None:
        """The part of a task; once more where something from outside has killed the process. None when ending.

        known : the components of the case by their source files; see `origins`.
        Raises InputError when no worker can be started.
        """
        for last in (False, True):
            begun, is_new = _now(), self.worker is None
            worker = self._started()
            if worker is None:
                return None
            waited = _now() - begun
            worker.begin()
            worker.send(task)
            found = self._watched(worker, task, known, tell)
            if worker.gone and found is None and not self.ending.is_set():
                found = self._died(worker, task, known, last)
            if isinstance(found, Part):
                found = replace(found, startup=waited + found.startup if is_new else 0.0)
            if found is not None or self.ending.is_set():
                return found
        raise AssertionError("a task has an ending")

    def _started(self) -> WorkerProcess | None:
        """A worker that is ready; None when ending. Raises InputError when none can be started."""
        if self.worker is not None:
            return self.worker
        self.worker = WorkerProcess(self.folder, self.core)
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
        self, worker: WorkerProcess, task: Task, known: Mapping[str, str], tell: Callable[[Progress | Way], None]
    ) -> Part | Unreadable | None:
        """The answer of a worker, or the part of a case that was killed at a limit; None when the worker has died."""
        begun = looked = _now()
        stopped, stopped_at = None, 0.0
        while not self.ending.is_set():
            answer = worker.answer(TICK)
            if isinstance(answer, Progress | Way):
                tell(answer)
            elif isinstance(answer, Warm):
                worker.begin()
                begun = _now()
            elif isinstance(answer, Unreadable):
                return answer
            elif isinstance(answer, Ended):
                output = worker.output
                if stopped or answer.changed or worker.resident() > task.limits.bytes / 2:
                    self.drop()
                return replace(answer.part, output=output, startup=answer.imported)
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
                self.drop()
                return part
        return None

    def _died(self, worker: WorkerProcess, task: Task, known: Mapping[str, str], last: bool) -> Part | None:
        """The part of a case whose process has died; None when it is to be run once more."""
        code = worker.exit_code(1.0)
        killed = worker.kill()
        code = killed if code is None else code
        where, output = place(frames_of_dump(worker.faults), known), worker.output
        self.drop()
        if -code in KILLED and not last:
            return None
        how = how_it_ended(code)
        detail = f"the interpreter ended with {how}{where}"
        part = part_without_record(task.case, task.parameters, Status.CRASHED, detail, how)
        return replace(part, output=output)

    def drop(self) -> None:
        """End the worker; the next task gets a new one."""
        worker, self.worker = self.worker, None
        if worker is not None:
            worker.kill()
            worker.close()
