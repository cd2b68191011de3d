"""Verdicts on runs: right, doubted or wrong; solved or not; the cheapest within an error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS

VERIFIED = 1e-6
"""Relative residual below which a state counts as solved where the stopping test does not say."""

ACCEPTED = 0.05
"""Relative error of a velocity up to which a result counts as right."""

OUTCOME, SOLVED, SPEEDUP = "outcome", "solved", "speedup"
"""Columns that tables derive from the others: see `outcome`, `solved`, and `against` of tables."""

RIGHT, DOUBTED, WRONG = "right", "doubted", "wrong"
"""Outcomes of converged runs: error ≤ accepted, in doubt by audits, error > accepted without a doubt."""

AT_A_SOLUTION = frozenset({Status.CONVERGED, Status.OTHER_ROOT})
"""Statuses of runs that met their stopping test."""

BY_RESIDUAL, ABSOLUTE = "residual", "absolute"
"""The kinds of stopping test whose tolerance bounds a relative residual, and ‖R‖ itself."""

Run = Mapping[str, Any]
"""A row of `runs`, by the names of its columns."""


def status_of(run: Run) -> Status:
    """The status of a run. Raises ValueError where the column holds none."""
    return Status.of(run["status"])


def outcome(run: Run, accepted: float = ACCEPTED, error: str = "velocity_error") -> str:
    """error ≤ accepted: "right"; above it without a word of doubt: "wrong", a false success.

    A converged run with a doubt is "doubted" whatever its error; one whose error nobody knows is "converged"; all
    others are their status.
    """
    status = status_of(run)
    if status is not Status.CONVERGED:
        return status.word
    if doubt(run):
        return DOUBTED
    known = number(run.get(error))
    return status.word if np.isnan(known) else RIGHT if known <= accepted else WRONG


def solved(run: Run, accepted: float = ACCEPTED, error: str = "velocity_error") -> bool:
    """At a solution, by a small enough residual evaluated outside the method, with an error ≤ accepted.

    Small enough is the tolerance of a stopping test on the residual, and what meets an absolute one; after a difference
    or a claim it is `VERIFIED`.
    A doubt takes nothing from a small error; an error nobody knows must be beyond doubt. A root that is not among the
    known ones is a root.
    """
    status = status_of(run)
    bounds = {BY_RESIDUAL: number(run.get("stop.tolerance")), ABSOLUTE: np.inf}
    limit = bounds.get(str(run.get("stop.kind")), VERIFIED)
    if status not in AT_A_SOLUTION or not number(run.get("residual_norm")) <= limit:
        return False
    known = number(run.get(error))
    return status is Status.OTHER_ROOT or (not doubt(run) if np.isnan(known) else known <= accepted)


def doubt(run: Run) -> str:
    """Why the result is in doubt; empty where the column `doubt` is empty, NaN or absent."""
    words = run.get("doubt")
    return words if isinstance(words, str) else ""


def cheapest(runs: Iterable[Run], cost: str, error: str, within: float) -> Run | None:
    """argmin cost over the converged runs with error ≤ within; None when there is none."""
    fit = [
        run
        for run in runs
        if status_of(run) is Status.CONVERGED and number(run.get(error)) <= within and number(run.get(cost)) >= 0
    ]
    return min(fit, key=lambda run: number(run[cost]), default=None)


def is_error(column: str) -> bool:
    """Whether a column of `runs` is a relative error, which people read in percent."""
    return column in RUNS and RUNS[column].relative_error


def percent(fraction: float) -> str:
    """0.01 -> "1 %", but 1e-6 -> "1e-06": what is below a hundredth of a percent is a number."""
    return f"{100 * fraction:.3g} %" if fraction >= 1e-4 else f"{fraction:.3g}"


def number(value: Any) -> float:
    """A number, or NaN for what is none."""
    return float(value) if isinstance(value, (int, float, np.number)) else np.nan
