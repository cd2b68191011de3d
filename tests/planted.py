"""Solvers that do to the interpreter what a stranger's plugin may do, each after a step; and one that is sound.

The module is imported by worker processes under its name, as an installed plugin would be.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, ClassVar, Literal

import numpy as np

from nlsolve.plugin import NonlinearSolver, Step, hookimpl

_process_time = time.process_time


class Planted(NonlinearSolver):
    """Newton's method that does something else after its first step."""

    kept: ClassVar[list[Any]] = []

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            self.misbehave()
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))

    def misbehave(self) -> None:
        """Nothing here."""


class Sound(Planted):
    kind: Literal["sound"] = "sound"


class Loops(Planted):
    kind: Literal["loops"] = "loops"

    def misbehave(self) -> None:
        while True:
            pass


class Deaf(Planted):
    """A loop that no exception ends."""

    kind: Literal["deaf"] = "deaf"

    def misbehave(self) -> None:
        while True:
            with suppress(BaseException):
                time.sleep(0.01)


class Stuck(Planted):
    """Waits in compiled code, which no exception of Python's reaches."""

    kind: Literal["stuck"] = "stuck"

    def misbehave(self) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGXCPU})
        time.sleep(1000.0)


class YieldsForever(NonlinearSolver):
    """Yields states that come no nearer, but a little, so that it does not stagnate."""

    kind: Literal["yields-forever"] = "yields-forever"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state, residual = start, problem.residual(start)
        while True:
            yield Step(state)
            state = state - 1e-12 * residual
            time.sleep(0.01)


class Leaks(Planted):
    kind: Literal["leaks"] = "leaks"

    def misbehave(self) -> None:
        while True:
            self.kept.append(np.ones(25_000_000))
            time.sleep(0.05)


class AsksForTooMuch(Planted):
    kind: Literal["asks-for-too-much"] = "asks-for-too-much"

    def misbehave(self) -> None:
        self.kept.append(np.ones(10**13))


class Exits(Planted):
    kind: Literal["exits"] = "exits"

    def misbehave(self) -> None:
        os._exit(3)


class SystemExits(Planted):
    kind: Literal["system-exits"] = "system-exits"

    def misbehave(self) -> None:
        sys.exit(0)


class Interrupts(Planted):
    kind: Literal["interrupts"] = "interrupts"

    def misbehave(self) -> None:
        raise KeyboardInterrupt


class Faults(Planted):
    kind: Literal["faults"] = "faults"

    def misbehave(self) -> None:
        ctypes.string_at(0)


class Killed(Planted):
    kind: Literal["killed"] = "killed"

    def misbehave(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Raises(Planted):
    kind: Literal["raises"] = "raises"

    def misbehave(self) -> None:
        raise ZeroDivisionError("by a plugin")


class ChangesFolder(Planted):
    kind: Literal["changes-folder"] = "changes-folder"

    def misbehave(self) -> None:
        os.chdir("/")


class Floods(Planted):
    kind: Literal["floods"] = "floods"

    def misbehave(self) -> None:
        print("first line")
        for _ in range(20):
            print("x" * 100_000)
        print("last line", flush=True)


class Forks(Planted):
    """Its copy goes on with the case, and its other child works in a session of its own."""

    kind: Literal["forks"] = "forks"

    def misbehave(self) -> None:
        if not self.kept:
            self.kept.append(True)
            first = os.fork()
            second = os.fork() if first else 0
            if first and not second:
                os.setsid()
                time.sleep(1000.0)
            if first:
                print(first, second)


class WorksElsewhere(Planted):
    """Has a child do its work, and waits for it."""

    kind: Literal["works-elsewhere"] = "works-elsewhere"

    def misbehave(self) -> None:
        child = os.fork()
        if not child:
            while _process_time() < 0.1:
                pass
            os._exit(0)
        os.waitpid(child, 0)


class PatchesClocks(Planted):
    kind: Literal["patches-clocks"] = "patches-clocks"

    def misbehave(self) -> None:
        for name in ("time", "monotonic", "perf_counter", "process_time"):
            setattr(time, name, lambda: 0.0)


class Tells(Planted):
    """Prints where it finds itself."""

    kind: Literal["tells"] = "tells"
    number: int = 0

    def misbehave(self) -> None:
        print(f"{os.getpid()} {os.getcwd()} {time.time() > 0.0} {os.environ.get('OPENBLAS_NUM_THREADS')}")


class Slow(Planted):
    kind: Literal["slow"] = "slow"
    number: int = 0

    def misbehave(self) -> None:
        time.sleep(0.05)


class Unsendable(Planted):
    """Leaves a note that cannot be pickled."""

    kind: Literal["unsendable"] = "unsendable"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        for step in super().steps(problem, tangent, start):
            yield Step(step.state, notes={"note.way": lambda: None})


OFFERED = [
    cls
    for cls in list(globals().values())
    if isinstance(cls, type) and issubclass(cls, NonlinearSolver) and cls.__module__ == __name__ and cls is not Planted
]


@hookimpl
def nlsolve_components() -> list[type[NonlinearSolver]]:
    return OFFERED
