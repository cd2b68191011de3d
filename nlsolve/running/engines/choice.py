"""Which engine runs the cases of a study."""

from __future__ import annotations

import os
from importlib import import_module

import psutil

from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.running.engines.engine import Engine
from nlsolve.running.engines.execution import Debugger
from nlsolve.running.engines.in_process import InProcess
from nlsolve.study.timing import Timing

ISOLATIONS = ("process", "none")
"""How cases are kept apart: each in a worker process, or not at all."""

ISOLATION = "process"
"""How they are where nobody says."""


def engine_for(
    timing: Timing, isolation: str | None = None, jobs: int | None = None, debugger: Debugger | None = None
) -> Engine:
    """The engine for these wishes.

    jobs : cases at a time; None: as many as there are physical cores, but one where the study says how it is timed.
    debugger : see `execute`; only for cases in this process.

    Raises StudyError for wishes that do not go together.
    """
    chosen = isolation or ("none" if debugger is not None else ISOLATION)
    if chosen not in ISOLATIONS:
        raise StudyError(f"isolation = {chosen!r}: no such isolation; {did_you_mean(chosen, ISOLATIONS)}")
    if jobs is not None and jobs < 1:
        raise StudyError(f"jobs = {jobs}: at least one case at a time is run")
    if chosen == "none":
        if jobs not in (None, 1):
            raise StudyError(f"jobs = {jobs}: without isolation the cases run one after the other; drop one of the two")
        return InProcess(debugger)
    if debugger is not None:
        raise StudyError("a debugger needs the cases in this process: drop isolation, or set it to none")
    if os.name != "posix":
        engine = InProcess()
        engine.note("this system has no process groups: the cases were run in this process, without limits")
        return engine
    workers: Engine = import_module("nlsolve.running.engines.local").Workers(
        jobs or (physical_cores() if timing == Timing() else 1)
    )
    return workers


def physical_cores() -> int:
    """How many physical cores this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(usable, psutil.cpu_count(logical=False) or 1))
