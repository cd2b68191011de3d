"""seconds = Σ_kind n_kind c_kind + own work : predicted seconds of runs, from their counts and measured unit costs."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np
import pandas as pd

from nlsolve.results.aggregates import grouped
from nlsolve.results.columns import RUNS, is_measured
from nlsolve.results.costs.unit_costs import COUNTS, PREFIX, UnitCosts
from nlsolve.results.frames import rows_of
from nlsolve.results.verdicts import Run, number

OF_THE_METHOD = (
    "solver",
    "refresh",
    "predictor",
    "stop",
    "budget",
    "start",
    "record",
    "counterpart",
    "error_estimator",
)
"""Sections that do not change what a unit of work costs; all others do."""

UNITS = tuple(name for name in RUNS if name.startswith(PREFIX))


def with_predictions(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs with `seconds_predicted` filled in; NaN where no unit costs are known.

    Unit costs are medians over the runs of the same problem and linear solver. The method's own work in an iteration is
    the median over the runs of the same case with other linear solvers, on which it does not depend; it is left out
    where there are none. So no prediction uses the seconds of the run itself.
    """
    if not any(name in runs and runs[name].notna().any() for name in UNITS):
        return runs
    parameters = [name for name in map(str, runs.columns) if "." in name and not is_measured(name)]
    of_cell = [name for name in parameters if name.split(".")[0] not in OF_THE_METHOD]
    of_case = [name for name in parameters if name.split(".")[0] != "linear"]
    rows = [{**run, "cell": _key(of_cell, run), "same case": _key(of_case, run)} for run in rows_of(runs)]
    units = {cell: pooled(members) for (cell,), members in grouped(rows, ("cell",)).items()}
    rivals = grouped(rows, ("same case",))
    seconds = []
    for run in rows:
        unit = units[run["cell"]]
        others = [other for other in rivals[(run["same case"],)] if other["cell"] != run["cell"]]
        own = [
            number(other["seconds_own"]) / number(other["iterations"])
            for other in others
            if number(other["iterations"]) > 0
        ]
        own_work = number(run["iterations"]) * statistics.median(own) if own else 0.0
        seconds.append(
            np.nan if unit is None else unit.predict({name: number(run[name]) for name in COUNTS}) + own_work
        )
    return runs.assign(seconds_predicted=seconds)


def pooled(runs: Sequence[Run]) -> UnitCosts | None:
    """Medians of the unit costs measured after each of these runs; None when none were."""
    known = [run for run in runs if all(number(run.get(name)) >= 0.0 for name in UNITS)]
    if not known:
        return None
    return UnitCosts.of_columns({name: statistics.median(float(run[name]) for run in known) for name in UNITS})


def _key(names: Sequence[str], run: Run) -> str:
    return " ".join(f"{name}={run[name]}" for name in names)
