"""What does a kept tangent lose by ageing? θ by age, and the lives of first tangents that one run predicts.

    python benchmarks/ageing.py [STUDY] [RESULTS]

Runs STUDY (default: studies/paper/ageing.toml), whose K* is never renewed, or the part of it that is not yet in the
folder RESULTS. In the first series of increment k, at age k of K*, a_max = η^(1/(p−1))/θ defines θ, the growth of the
terms from order to order. K* has served as many increments as pass before the first with θ > η^(1/(p−1)), which is the
first with a_max < 1. Prints θ of every order, then for each order and tolerance the life predicted by θ of the run with
the highest order and the largest tolerance alone, the life in a run of its own where the study has one, and the 2015
paper's table 1.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import nlsolve

STUDY = Path(__file__).parent.parent / "studies" / "paper" / "ageing.toml"
ORDER, TOLERANCE = "solver.order", "solver.tolerance"
INCREMENT = 1e-4  # Δt [s] of the study and the paper
PAPER = {
    (10, 1e-6): 5,
    (15, 1e-6): 8,
    (20, 1e-6): 12,
    (25, 1e-6): 13,
    (10, 1e-8): 4,
    (15, 1e-8): 6,
    (20, 1e-8): 10,
    (25, 1e-8): 11,
}
"""Increments that the first tangent served in table 1 of Timesli et al. 2015, by order and tolerance."""


def allowed(order: int, tolerance: float) -> float:
    """η^(1/(p−1)), the θ up to which a_max ≥ 1."""
    return float(tolerance ** (1.0 / (order - 1)))


def ageing(runs: pd.DataFrame, steps: pd.DataFrame) -> pd.DataFrame:
    """θ by age (rows) and by order and tolerance (columns); NaN where a march has ended."""
    columns = {}
    for _, run in runs.iterrows():
        first = steps[(steps["case"] == run["case"]) & (steps["step"] == 1)].set_index("increment")
        columns[run[ORDER], run[TOLERANCE]] = allowed(run[ORDER], run[TOLERANCE]) / first["range"]
    return pd.DataFrame(columns).sort_index(axis="columns")


def life(theta: pd.Series, order: int, tolerance: float) -> float:
    """Increments before the first with θ > η^(1/(p−1)); infinite when there is none in the run."""
    over = theta.index[theta > allowed(order, tolerance)]
    return float(over[0] - 1) if len(over) else np.inf


def report(theta: pd.DataFrame) -> str:
    """Both tables in words."""
    lines = ["θ by age in increments", "", f"{'age':>4s}  " + "  ".join(f"{p:>3d}, {eta:.0e}" for p, eta in theta)]
    for age, row in theta.iterrows():
        lines.append(f"{age:>4d}  " + "  ".join(f"{value:10.4f}" for value in row))
    teacher = max(theta, key=lambda cell: cell)
    lines += [
        "",
        f"Increments served by the first tangent; predicted from p = {teacher[0]}, η = {teacher[1]:.0e} alone",
    ]
    lines += [
        "",
        f"{'p':>3s} {'η':>6s} {'η^(1/(p−1))':>12s} {'predicted':>10s} {'own run':>8s} {'paper':>6s} {'θ/age':>7s}",
    ]
    for p, eta in sorted({*PAPER, *theta}):
        limit, paper = allowed(p, eta), PAPER.get((p, eta))
        published = f"{paper:6d} {limit / paper:7.4f}" if paper else ""
        predicted = life(theta[teacher], p, eta)
        own = f"{life(theta[p, eta].dropna(), p, eta):8.0f}" if (p, eta) in theta else f"{'–':>8s}"
        lines.append(f"{p:3d} {eta:6.0e} {limit:12.4f} {predicted:10.0f} {own} {published}")
    lines += ["", f"times {INCREMENT:g} s: the lives of table 1; θ/age: the paper's life and the θ it allows"]
    return "\n".join(lines)


if __name__ == "__main__":
    given = [Path(argument) for argument in sys.argv[1:]]
    results = nlsolve.run(given[0] if given else STUDY, *given[1:2])
    print(report(ageing(results.runs, results.steps)))
