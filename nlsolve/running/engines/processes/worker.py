"""The process that runs cases for a runner, one after the other, until one of them spoils it.

It has a session of its own, its output goes to the runner, and it talks to the runner over a socket. The runner stops
a case by a signal (SIGXCPU: its seconds, SIGUSR2: its memory), which raises CaseStopped wherever the case is, asks for
the place where a case is by SIGUSR1, and kills the whole session when that does not help.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import pickle
import resource
import signal
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any, NoReturn

from threadpoolctl import threadpool_info

from nlsolve.contracts.status import CaseStopped, Status
from nlsolve.results.costs.lanes import EXCLUSIVE
from nlsolve.results.frames import Part
from nlsolve.results.verdicts import doubt
from nlsolve.running.engines.execution import execute, part_of_error
from nlsolve.running.engines.places import frames_from, origins, place
from nlsolve.running.engines.processes.surroundings import Surroundings
from nlsolve.running.engines.processes.travel import Ended, NotPortable, Ready, Sections, Task, Unreadable, Warm
from nlsolve.running.timing.cores import stay_on
from nlsolve.running.timing.rounds import is_compared
from nlsolve.solving.simulate import Progress

SIGNALS = {Status.TIMED_OUT: signal.SIGXCPU, Status.OUT_OF_MEMORY: signal.SIGUSR2}
"""By which signal the runner stops a case."""

PLACE_SIGNAL = signal.SIGUSR1
"""By which signal the runner has the place of a case written to the file of faults."""

SECONDS_BETWEEN_PROGRESS = 0.1
"""Least time between two reports of progress [s]."""

BACKSTOP, ROOM = 2, 2**30
"""A process may not even ask for more than this many times its limit of memory, and this many bytes."""

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36

_now = time.monotonic
_exit = os._exit


class Worker:
    """Runs the tasks that come over a connection.

    faults : descriptor of the file for the places where the interpreter dies.
    """

    def __init__(self, connection: Connection, faults: int) -> None:
        self.connection, self.faults = connection, faults
        self.process = os.getpid()
        self.task: Task | None = None
        self.origins: Mapping[str, str] = {}
        self.told = 0.0
        self.warm: set[str] = set()

    def prepare(self) -> None:
        """Make the process one that ends with its runner, says where it dies, and can be stopped."""
        _linux(PR_SET_PDEATHSIG, signal.SIGKILL)
        _linux(PR_SET_CHILD_SUBREAPER, 1)
        faulthandler.enable(self.faults, all_threads=False)
        faulthandler.register(PLACE_SIGNAL, self.faults, all_threads=False)
        for number in SIGNALS.values():
            signal.signal(number, self.stop)
        os.register_at_fork(after_in_child=self.disown)
        os._exit = self.exit  # type: ignore[assignment]

    def serve(self) -> None:
        """Answer tasks until the runner has no more, or is gone."""
        self.send(Ready({_library(pool): pool["num_threads"] for pool in threadpool_info() if pool["num_threads"] > 1}))
        while True:
            try:
                task = self.connection.recv()
            except (EOFError, OSError):
                return
            if task is None:
                return
            self.send(self.answer(task), task)

    def answer(self, task: Task) -> Ended | Unreadable:
        """Run one case; in the exclusive lane twice when it is the first time, as the first run warms the process up:
        its imports, memory and caches.
        """
        before, parts = Surroundings(), Sections()
        self.task, self.origins, self.told = task, {}, 0.0
        begun, imported = _now(), 0.0
        try:
            _allow(task.limits.bytes)
            parts = task.parts()
            imported = _now() - begun
            self.origins = origins(parts)
            part = self.run(task, parts)
            if task.lane == EXCLUSIVE and task.case not in self.warm and is_compared(part.run, task.timing):
                self.warm.add(task.case)
                self.send(Warm())
                part = self.run(task, task.parts())
        except NotPortable as reason:
            return Unreadable(str(reason))
        except BaseException as error:  # also a KeyboardInterrupt, which is nobody's at a keyboard
            part = part_of_error(task.case, task.parameters, parts, error)
        finally:
            self.task = None
        if os.getpid() != self.process:  # a copy that a plugin has made of this process
            _exit(0)
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        return Ended(_doubted(part, before.doubt()), before.changed(), imported)

    def run(self, task: Task, parts: Sections) -> Part:
        """One run of a case."""
        share = self.connection.send
        return execute(
            task.case, task.parameters, parts, task.timing, self.listen, task.lane, way=task.way, share=share
        )

    def listen(self, progress: Progress) -> None:
        """Report progress, not too often."""
        if _now() - self.told > SECONDS_BETWEEN_PROGRESS:
            self.told = _now()
            self.connection.send(progress)

    def send(self, answer: Ready | Warm | Ended | Unreadable, task: Task | None = None) -> None:
        """Send an answer; a part that cannot be sent becomes one that says so."""
        try:
            data = pickle.dumps(answer, pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # a value of a plugin's in the rows
            assert task is not None
            reason = TypeError(f"a plugin has put a value into the case's rows that cannot be pickled: {error}")
            part = part_of_error(task.case, task.parameters, Sections(), reason.with_traceback(error.__traceback__))
            data = pickle.dumps(Ended(part, "an answer"))
        self.connection.send_bytes(data)

    def stop(self, number: int, frame: FrameType | None) -> None:
        """Stop the case that is running, at whatever place it is."""
        task, self.task = self.task, None  # it is told once: what comes after it has a little time to end well
        if task is not None:
            status = next(status for status, by in SIGNALS.items() if by == number)
            raise CaseStopped(status, f"{limit_of(task, status)}{place(frames_from(frame), self.origins)}")

    def disown(self) -> None:
        """In a copy of this process that a plugin has made: it has no say in what the runner is told."""
        self.connection.close()
        os._exit = _exit

    def exit(self, code: int) -> NoReturn:
        """os._exit, after the place has been written down."""
        faulthandler.dump_traceback(self.faults, all_threads=False)
        _exit(code)


def limit_of(task: Task, status: Status) -> str:
    """limits.seconds = 600"""
    limits = task.limits
    return f"limits.seconds = {limits.seconds:g}" if status is Status.TIMED_OUT else f"limits.memory = {limits.memory}"


def _doubted(part: Part, reason: str) -> Part:
    """A part whose row also has a reason for doubt."""
    if not reason:
        return part
    return replace(part, run={**part.run, "doubt": "; ".join(filter(None, (doubt(part.run), reason)))})


def _allow(memory: int) -> None:
    """Let this process ask for so much memory that its limit is met first, but for no more than the machine bears."""
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    asked = BACKSTOP * memory + ROOM
    resource.setrlimit(resource.RLIMIT_DATA, (asked if most == resource.RLIM_INFINITY else min(asked, most), most))


def _library(pool: Mapping[str, Any]) -> str:
    return str(pool.get("internal_api") or pool.get("user_api"))


def _linux(option: int, value: int) -> None:
    """Ask the kernel for a property of this process; only Linux has it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def main(connection: int, faults: int, runner: int, core: int | None = None) -> None:
    """Serve the runner with process id `runner` over two descriptors, on one core if one is named."""
    if core is not None:
        stay_on(frozenset({core}))
    import_module("nlsolve.plugin")  # which plugins import, so that the first case need not wait for it
    worker = Worker(Connection(connection), faults)
    worker.prepare()
    if os.getppid() == runner:  # else it has ended already
        worker.serve()
    _exit(0)
