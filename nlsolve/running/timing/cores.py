"""A core for one process: which one, how a process is kept on it or off it, and how much of it others take."""

from __future__ import annotations

import math
import os
import sys
import time
from pathlib import Path

import psutil

SECONDS_TO_LOOK = 0.2
"""How long all cores are watched for the calmest one [s]."""

WAITED = Path("/proc/thread-self/schedstat")
"""Where Linux keeps how long this thread has run and has waited for its core [ns]."""

CAN_PIN = sys.platform == "linux"
"""Whether processes can be kept on a core here."""

_now = time.perf_counter


def cores_here() -> frozenset[int]:
    """The cores that this thread may run on; empty where the system does not tell."""
    return frozenset(os.sched_getaffinity(0)) if CAN_PIN else frozenset()


def stay_on(cores: frozenset[int]) -> None:
    """Keep this thread, and what it starts, on these cores."""
    os.sched_setaffinity(0, cores)


def calmest(cores: frozenset[int]) -> int:
    """The core that is used least just now; of equals the last one, as the first one has most of the system's work."""
    used = psutil.cpu_percent(SECONDS_TO_LOOK, percpu=True)
    return min(cores, key=lambda core: (used[core] if core < len(used) else 0.0, -core))


class Load:
    """How much of the core others take from this thread, from when it is made."""

    def __init__(self) -> None:
        self._begun, self._withheld = _now(), _withheld()

    def share(self) -> float:
        """Part of the time since in which the thread could have run but did not; NaN where the system does not tell."""
        passed = _now() - self._begun
        return (_withheld() - self._withheld) / passed if passed > 0.0 else 0.0


def _withheld() -> float:
    """Time for which this thread was ready but others had its core: other processes, or a hypervisor (steal) [s].

    Processor time of the core minus our own would tell the same in steps of 10 ms, as long as a short case.
    """
    try:
        waited = float(WAITED.read_text(encoding="ascii").split()[1]) * 1e-9
    except OSError:  # not Linux, or a kernel that does not count it
        return math.nan
    here = cores_here()
    return waited + (psutil.cpu_times(percpu=True)[min(here)].steal if len(here) == 1 else 0.0)
