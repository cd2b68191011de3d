"""What a case may change in its process, and what would then change the next case."""

from __future__ import annotations

import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nlsolve.running.timing.cores import cores_here

CLOCKS = ("time", "time_ns", "monotonic", "perf_counter", "process_time", "thread_time", "sleep")
"""Functions of `time` that a plugin might replace."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGXCPU, signal.SIGUSR1, signal.SIGUSR2, signal.SIGCHLD)

UNCOUNTED = 0.01
"""Processor time in other processes that puts the seconds of a case in doubt [s]."""


def _clocks() -> dict[str, Any]:
    return {name: getattr(time, name, None) for name in CLOCKS}


def _handlers() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in SIGNALS}


def _folder() -> str:
    try:
        return os.getcwd()
    except OSError:  # it has been removed
        return ""


def _seconds_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def has_children() -> bool:
    """Whether this process has children, running or not waited for."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


@dataclass(frozen=True)
class Surroundings:
    """The surroundings of a case before it begins."""

    folder: str = field(default_factory=_folder)
    clocks: Mapping[str, Any] = field(default_factory=_clocks)
    handlers: Mapping[int, Any] = field(default_factory=_handlers)
    streams: tuple[Any, Any] = field(default_factory=lambda: (sys.stdout, sys.stderr))
    threads: int = field(default_factory=threading.active_count)
    cores: frozenset[int] = field(default_factory=cores_here)
    seconds_of_children: float = field(default_factory=_seconds_of_children)

    def changed(self) -> str:
        """What has changed since, in words; empty when another case finds the process as this one did."""
        found = {
            "the working folder": _folder() != self.folder,
            "a clock": _clocks() != self.clocks,
            "a handler of signals": _handlers() != self.handlers,
            "the output": (sys.stdout, sys.stderr) != self.streams,
            "the cores it may use": cores_here() != self.cores,
            "threads": threading.active_count() > self.threads,
            "processes": has_children(),
        }
        return ", ".join(words for words, is_so in found.items() if is_so)

    def doubt(self) -> str:
        """Why the work of the case is not all counted, in a sentence; empty when it is."""
        if has_children():
            return "the case left processes running, whose work is not counted"
        seconds = _seconds_of_children() - self.seconds_of_children
        return f"{seconds:.2g} s of work were done in other processes and not counted" if seconds > UNCOUNTED else ""
