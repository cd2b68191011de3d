"""One case in this process, on one thread: every ending becomes a row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.status import CaseStopped, SolveError, Status
from nlsolve.results.costs.cost_prediction import UNITS
from nlsolve.results.costs.lanes import ALONE, EXCLUSIVE
from nlsolve.results.frames import Part
from nlsolve.running.engines.places import frames_of_error, origins, place
from nlsolve.running.store.environment import environment_here, name_of
from nlsolve.running.timing.calibration import CLOCKS, measure
from nlsolve.running.timing.cores import Load, cores_here
from nlsolve.running.timing.rounds import measured_in
from nlsolve.solving.simulate import Progress, Record, crashed, run_case
from nlsolve.solving.way import Way
from nlsolve.study.timing import Timing

Debugger = Callable[[BaseException], None]


def execute(
    case: str,
    parameters: Mapping[str, Any],
    parts: Any,
    timing: Timing,
    listen: Callable[[Progress], None],
    lane: str = ALONE,
    debugger: Debugger | None = None,
    way: Way | None = None,
    share: Callable[[Way], None] | None = None,
) -> Part:
    """Run one case. Every error becomes a row that says so, and so does an exit; a KeyboardInterrupt is passed on.

    case, parameters, parts : see `Case`.
    lane : where its seconds come from; in the exclusive lane the part has a round.
    debugger : is called with an error of the program or of a plugin before it becomes a row.
    way, share : see `simulate`.
    """
    try:
        with threadpool_limits(limits=1):
            clock, here, load = CLOCKS[timing.clock], cores_here(), Load()
            record = run_case(parts, listen, clock, way=way, share=share)
            taken = load.share()
            if lane == EXCLUSIVE and cores_here() != here:  # the case has left its core
                lane = ALONE
            units = unit_costs(record, parts.linear, clock) if timing.calibrate else {}
    except (Exception, SystemExit, CaseStopped) as error:  # the one boundary at which a crash turns into a result
        if debugger is not None and not isinstance(error, CaseStopped):
            debugger(error)
        return part_of_error(case, parameters, parts, error)
    timed = {"rounds": 1, "seconds_most": record.summary.get("seconds"), "clock": timing.clock, "lane": lane}
    if lane == EXCLUSIVE:
        timed |= {"load": taken, "core": min(here) if len(here) == 1 else None}
    row = {"case": case, **record.summary, **timed, **units, **parameters}
    rounds = (measured_in(row),) if lane == EXCLUSIVE else ()
    frames = _of_case(case, record.steps), _of_case(case, record.fields)
    return _with_environment(Part(row, *frames, iterates=record.iterates, rounds=rounds))


def unit_costs(record: Record, linear: LinearSolver, clock: Callable[[], float]) -> dict[str, float]:
    """Unit costs of the work on a case's last problem, as columns of `runs`; NaN if they cannot be measured."""
    nothing = dict.fromkeys(UNITS, float("nan"))
    if record.problem is None or record.state is None:
        return nothing
    try:
        return measure(record.problem, linear, record.state, clock=clock).columns()
    except SolveError:  # the last tangent cannot be factorised, which the status of the case tells
        return nothing


def part_of_error(case: str, parameters: Mapping[str, Any], parts: Any, error: BaseException) -> Part:
    """The part of a case that an error has ended."""
    if isinstance(error, CaseStopped):
        return part_without_record(case, parameters, error.status, error.detail)
    frames, known = frames_of_error(error), origins(parts)
    if isinstance(error, MemoryError):
        where = place(frames, known)
        return part_without_record(case, parameters, Status.OUT_OF_MEMORY, f"MemoryError: {error}{where}")
    row = crashed(error)
    owner = next((frame for frame in frames if frame[0] in known), None)
    if owner is not None:
        called = "" if owner == frames[0] else ", called at {}:{}".format(*owner)
        row["message"] += f"{called} in {known[owner[0]]}"
    if not isinstance(error, Exception):
        row["interpreter"] = type(error).__name__
    return _with_environment(Part({"case": case, **row, **parameters}, pd.DataFrame(), pd.DataFrame()))


def part_without_record(
    case: str, parameters: Mapping[str, Any], status: Status, detail: str, interpreter: str | None = None
) -> Part:
    """The part of a case of which nothing is left but how it ended."""
    row = {"case": case, "status": status.word, "message": f"{status.sentence}; {detail}"}
    if interpreter is not None:
        row["interpreter"] = interpreter
    return _with_environment(Part({**row, **parameters}, pd.DataFrame(), pd.DataFrame()))


def _with_environment(part: Part) -> Part:
    """A part that tells what it was computed with, its threads as the case had them."""
    with threadpool_limits(limits=1):
        environment = environment_here()
    return replace(part, run={**part.run, "environment": name_of(environment)}, environment=environment)


def _of_case(case: str, frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with a first column `case`; without rows, a frame without columns."""
    if not len(frame):
        return pd.DataFrame()
    others = [name for name in frame.columns if name != "case"]
    return frame.assign(case=case)[["case", *others]]
