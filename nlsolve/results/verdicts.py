"""What became of a run beyond its status: right, doubted or wrong; and which runs are worth their price.

The one place where results are judged: tables and figures of `runs` ask here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS

VERIFIED = 1e-6
"""Relative residual below which a state counts as solved where the stopping test does not say."""

ACCEPTED = 0.05
"""Relative error of a velocity up to which a result counts as right."""

VARIANT = "variant"
"""Column of `runs` with the names of the settings a case was made by, where a sweep of named settings has no name."""

UNDOTTED = ("record", "error_estimator")
"""Parameters of a case that are no table, or may be none."""

OUTCOME, SOLVED, SPEEDUP = "outcome", "solved", "speedup"
"""Columns that tables derive from the others: see `outcome`, `solved`, and `against` of tables."""

RIGHT, DOUBTED, WRONG = "right", "doubted", "wrong"

AT_A_SOLUTION = (Status.CONVERGED.word, Status.OTHER_ROOT.word)
"""Statuses of runs that met their stopping test."""

Run = Mapping[str, Any]


def outcome(run: Run, accepted: float = ACCEPTED, error: str = "velocity_error") -> str:
    """error ≤ accepted: "right"; above it without a word of doubt: "wrong", a false success.

    A converged run with a doubt is "doubted" whatever its error; one whose error nobody knows is "converged"; all
    others are their status.
    """
    if run["status"] != Status.CONVERGED.word:
        return str(run["status"])
    if doubt(run):
        return DOUBTED
    known = number(run.get(error))
    return Status.CONVERGED.word if np.isnan(known) else RIGHT if known <= accepted else WRONG


def solved(run: Run, accepted: float = ACCEPTED, error: str = "velocity_error") -> bool:
    """At a solution, by a small enough residual asked for outside the method, with an error ≤ accepted.

    Small enough is the tolerance of a stopping test on the residual; after a difference or a claim it is `VERIFIED`.
    A doubt takes nothing from a small error; an error nobody knows must be beyond doubt. A root that is not among the
    known ones is a root.
    """
    by_residual = run.get("stop.kind") == "residual"
    limit = number(run.get("stop.tolerance")) if by_residual else VERIFIED
    if run["status"] not in AT_A_SOLUTION or not number(run.get("residual_norm")) <= limit:
        return False
    known = number(run.get(error))
    return run["status"] == Status.OTHER_ROOT.word or (not doubt(run) if np.isnan(known) else known <= accepted)


def doubt(run: Run) -> str:
    """Why the result is in doubt; empty where the column `doubt` is empty, NaN or absent."""
    words = run.get("doubt")
    return words if isinstance(words, str) else ""


def cheapest(runs: Iterable[Run], cost: str, error: str, within: float) -> Run | None:
    """argmin cost over the converged runs with error ≤ within; None when there is none."""
    fit = [
        run
        for run in runs
        if run["status"] == Status.CONVERGED.word and number(run.get(error)) <= within and number(run.get(cost)) >= 0
    ]
    return min(fit, key=lambda run: number(run[cost]), default=None)


def telling(runs: pd.DataFrame) -> list[str]:
    """Parameters that are not the same in all runs, without those that the names of the runs' settings settle."""
    words = {str(name): [str(value) for value in runs[name]] for name in runs if name not in RUNS}
    differing = [name for name, values in words.items() if len(set(values)) > 1]
    names = [name for name in differing if names_settings(name)]
    return [name for name in differing if name in names or not settled(words, name, names)]


def settled(words: Mapping[str, Sequence[str]], name: str, by: Sequence[str]) -> bool:
    """Whether runs with the same words in the columns `by` have the same in the column `name`."""
    keys = list(zip(*(words[column] for column in by), strict=True)) or [()] * len(words[name])
    return len(set(zip(keys, words[name], strict=True))) == len(set(keys))


def names_settings(column: str) -> bool:
    """Whether a column of `runs` holds names of settings: it is not measured, and no parameter (most are dotted)."""
    return column not in (*RUNS, *UNDOTTED) and "." not in column


def is_error(column: str) -> bool:
    """Whether a column is a relative error, which people read in percent."""
    return column.endswith(("_error", "_error_inside", "_error_estimate"))


def percent(fraction: float) -> str:
    """0.01 -> "1 %", but 1e-6 -> "1e-06": what is below a hundredth of a percent is a number."""
    return f"{100 * fraction:.3g} %" if fraction >= 1e-4 else f"{fraction:.3g}"


def number(value: Any) -> float:
    """A number, or NaN for what is none."""
    return float(value) if isinstance(value, (int, float, np.number)) else np.nan
