"""What each case of a study will cost, from unit costs measured once for all cases that differ in method only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from nlsolve.running.timing.calibration import calibrate
from nlsolve.running.timing.rounds import comparisons, span_of
from nlsolve.solving.simulate import simulation_of
from nlsolve.solving.work.ledger import Ledger
from nlsolve.study.study import Study

SOLVES = 20
"""Pairs of triangular solves, and residuals, that the forecast assumes for an increment: about one series."""

STAGE = 5
"""Newton iterations that the forecast assumes for each law on the way to the first state."""

ASSUMPTION = (
    f"forecast: {STAGE} Newton iterations for each law on the way to the first state, then one factorisation and "
    f"{SOLVES} pairs of triangular solves an increment"
)
"""Newton needs several factorisations an increment, a method that keeps K* far fewer than one."""

INCREMENT = {"factorizations": 1, "jacobians": 1, "triangular_solves": SOLVES, "residuals": SOLVES}
ITERATION = {"factorizations": 1, "jacobians": 1, "triangular_solves": 1, "residuals": 1}

SAMPLE = [
    "nodes",
    "unknowns",
    "seconds_operators",
    "seconds_factorization",
    "seconds_triangular_solve",
    "seconds_iteration",
    "seconds_increment",
]
"""Columns that `costs_of` gives: sizes of a case and seconds [s] of its work."""


def forecast(study: Study) -> pd.DataFrame:
    """One row for each case: its swept parameters, its size, and its seconds [s] under the `ASSUMPTION`."""
    known: dict[str, dict[str, Any]] = {}
    rows = []
    for case in study.cases:
        if case.problem not in known:
            known[case.problem] = _seconds_of(case.parts)
        swept = {name: case.parameters[name] for name in case.swept}
        rows.append({"case": case.id, **swept, **known[case.problem]})
    return pd.DataFrame(rows)


def _seconds_of(parts: Any) -> dict[str, Any]:
    """The columns of `forecast` that cases which differ in method only have in common."""
    costs, work = costs_of(parts), simulation_of(parts, Ledger().entry).workload()
    start = STAGE * work.stages * costs["seconds_iteration"]
    seconds = work.increments * costs["seconds_increment"]
    return {
        "increments": work.increments,
        **costs,
        "seconds_start": start,
        "seconds": seconds,
        "seconds_all": start + seconds + work.discretizations * costs["seconds_operators"],
    }


def span_in_lane(study: Study, seconds: Mapping[str, float]) -> tuple[float, float]:
    """How long the exclusive lane takes, at least and at most [s]. seconds : of one run of each case that is left."""
    rounds = [sum(seconds.get(case.id, 0.0) for case in members) for members in comparisons(study.cases)]
    spans = [span_of(one_round, study.timing) for one_round in rounds if one_round]
    return sum(least for least, _ in spans), sum(most for _, most in spans)


def costs_of(parts: Any) -> dict[str, Any]:
    """Sizes of one case, and seconds [s] of its work at the sample of its simulation; NaN if that cannot be solved."""
    found = calibrate(parts, rounds=1)
    sizes = {name: found.sizes.get(name) for name in ("nodes", "unknowns")}
    if found.unit is None:
        return {**dict.fromkeys(SAMPLE, math.nan), **{name: size for name, size in sizes.items() if size is not None}}
    return {
        **sizes,
        "seconds_operators": found.operators,
        "seconds_factorization": found.unit.factorization,
        "seconds_triangular_solve": found.unit.triangular_solve,
        "seconds_iteration": found.unit.predict(ITERATION),
        "seconds_increment": found.unit.predict(INCREMENT),
    }
