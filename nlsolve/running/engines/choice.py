"""Which engine runs the cases of a study."""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec

import psutil

from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.costs.lanes import EXCLUSIVE, SHARED
from nlsolve.running.engines.engine import Engine
from nlsolve.running.engines.execution import Debugger
from nlsolve.running.engines.in_process import InProcess
from nlsolve.study.timing import Timing

ISOLATIONS = ("process", "none")
"""How cases are kept apart: each in a worker process, or not at all."""

ISOLATION = "process"
"""How they are where nobody says."""


ENGINES = ("local", "dask")
"""Where the worker processes are: on this machine, or where a cluster of dask.distributed has room."""


def engine_for(
    timing: Timing,
    isolation: str | None = None,
    jobs: int | None = None,
    debugger: Debugger | None = None,
    engine: str | None = None,
    scheduler: str | None = None,
) -> Engine:
    """The engine for these wishes.

    jobs : cases at a time; None: as many as there are physical cores, or threads of the cluster, but one where the
        study says how it is timed.
    scheduler : address of the scheduler of a cluster; None: one in this process.
    debugger : see `execute`; only for cases in this process.

    Raises StudyError for wishes that do not go together.
    """
    chosen = isolation or ("none" if debugger is not None else "process" if engine == "dask" else ISOLATION)
    if chosen not in ISOLATIONS:
        raise StudyError(f"isolation = {chosen!r}: no such isolation; {did_you_mean(chosen, ISOLATIONS)}")
    if jobs is not None and jobs < 1:
        raise StudyError(f"jobs = {jobs}: at least one case at a time is run")
    if engine not in (None, *ENGINES):
        raise StudyError(f"engine = {engine!r}: no such engine; {did_you_mean(engine or '', ENGINES)}")
    if scheduler is not None and engine != "dask":
        raise StudyError(f"scheduler = {scheduler!r}: only the engine 'dask' has one; add it, or drop the scheduler")
    if timing.is_exclusive:
        return _pinned(chosen, debugger, engine)
    if engine == "dask":
        if chosen == "none":
            raise StudyError("the engine 'dask' runs each case in a worker process: drop it, or isolation and debugger")
        return _on_cluster(jobs or (None if timing == Timing() else 1), scheduler)
    if chosen == "none":
        if jobs not in (None, 1):
            raise StudyError(f"jobs = {jobs}: without isolation the cases run one after the other; drop one of the two")
        return InProcess(debugger)
    if debugger is not None:
        raise StudyError("a debugger needs the cases in this process: drop isolation, or set it to none")
    if os.name != "posix":
        here = InProcess()
        here.note("this system has no process groups: the cases were run in this process, without limits")
        return here
    workers: Engine = import_module("nlsolve.running.engines.local").Workers(jobs_here(timing, jobs))
    return workers


def counter_for(timing: Timing, jobs: int | None) -> Engine | None:
    """The engine that runs the cases of the exclusive lane side by side before they are timed, so that only those that
    arrive have to be; None without that lane, and for one case at a time."""
    if not timing.is_exclusive or jobs is None or jobs < 2:
        return None
    return engine_for(Timing(), jobs=jobs, isolation="process")


def _pinned(isolation: str, debugger: Debugger | None, engine: str | None) -> Engine:
    """The engine of the exclusive lane. Raises StudyError for what it does not go together with."""
    wishes = {
        "engine = 'dask'": engine == "dask",
        "a debugger": debugger is not None,
        "isolation = 'none'": isolation == "none",
    }
    for wish, is_wished in wishes.items():
        if is_wished:
            raise StudyError(
                f"timing.lane = {EXCLUSIVE!r}: the exclusive lane runs one case at a time in a worker process of this "
                f"machine, and {wish} does not: drop it, or set the lane to {SHARED!r}"
            )
    if os.name != "posix":
        raise StudyError(
            f"timing.lane = {EXCLUSIVE!r}: the exclusive lane needs worker processes, which this system does not have: "
            f"set the lane to {SHARED!r}"
        )
    pinned: Engine = import_module("nlsolve.running.engines.local").Pinned()
    return pinned


def _on_cluster(jobs: int | None, scheduler: str | None) -> Engine:
    if find_spec("distributed") is None:
        raise StudyError("the engine 'dask' needs dask.distributed: pip install 'nlsolve[dask]', or use 'local'")
    here = None if scheduler is not None else physical_cores()
    engine: Engine = import_module("nlsolve.running.engines.cluster").Cluster(jobs or here, scheduler)
    return engine


def jobs_here(timing: Timing, jobs: int | None = None) -> int:
    """Cases at a time on this machine: `jobs`; by default the physical cores, but one where it is said how to time."""
    return jobs or (physical_cores() if timing == Timing() else 1)


def physical_cores() -> int:
    """How many physical cores this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(usable, psutil.cpu_count(logical=False) or 1))
