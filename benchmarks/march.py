"""What does an increment of the 2015 paper's march cost, and what of it are solves, operators, and all the rest?

    python benchmarks/march.py [increments]

Prints milliseconds of the processor an increment, means over all increments but the first: the two cheapest methods of
studies/strategies.toml and the homotopy (p = 20) on 1780 nodes that move, each with the tangents that its refresh rule
asks for. `rest` is what lies outside the methods and the operators; the ratios are those of the whole increment to its
own triangular solves, and to its solves and operators together.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import scipy.linalg  # noqa: F401  loads its BLAS, so that its threads are limited too
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.solving.simulate import run_case

INCREMENT = 1e-4
METHODS: dict[str, dict[str, Any]] = {
    "broyden": {"solver": {"kind": "broyden"}, "refresh": {"kind": "poor-contraction"}},
    "anderson, depth 5": {"solver": {"kind": "anderson", "depth": 5}},
    "homotopy, p = 20": {"solver": {"kind": "anm", "order": 20, "tolerance": 1e-6}},
}
PARTS = {
    "operators": "operators",
    "solves": "triangular_solve",
    "residuals": "residual",
    "series": "series_order",
    "own": "own",
    "Jacobians": "jacobian",
    "factors": "factorization",
    "rest": "rest",
}


def parts_of(increments: int, method: dict[str, Any]) -> Any:
    """The components of the march: rings, inertia, stress points between the nodes, volume points at them."""
    study = {
        "question": "what does an increment cost?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.25}},
        "physics": {"inertia": True, "penalty": 100.0},
        "time": {"horizon": increments * INCREMENT, "increment": INCREMENT},
        "motion": {"nodes": "lagrangian"},
        "law": {"kind": "power-law", "index": 0.1324, "regularization": 1e-2},
        "discretizer": {"kind": "mls", "balanced": False, "volume_points": "nodes", "volume_support": 16},
        "stop": {"kind": "residual", "tolerance": 1e-8},
        **method,
    }
    return nlsolve.Study.from_dict(study).cases[0].parts


def measured(increments: int, method: dict[str, Any]) -> tuple[dict[str, float], dict[str, Any]]:
    """Seconds between the ends of the first and the last increment, by part and `all`, and the row of the case."""
    known: list[dict[str, float]] = []

    def watch(simulation: Any) -> None:
        ledger = simulation.state.entry.__self__  # the one that the case is timed by
        if simulation.state.time > 0.0:
            own = {"own": ledger.details()["seconds_own"]}
            known.append({**ledger.seconds, **own, "all": time.process_time()})

    row = run_case(parts_of(increments, method), watch=watch).summary
    first, last = known[0], known[-1]
    seconds = {part: last.get(part, 0.0) - first.get(part, 0.0) for part in (*PARTS.values(), "method", "all")}
    seconds["rest"] = seconds["all"] - seconds["method"] - seconds["operators"]
    return seconds, row


def main(increments: int) -> None:
    """Print the table."""
    print(f"{'':18s}{'all':>8s}" + "".join(f"{title:>11s}" for title in PARTS))
    for name, method in METHODS.items():
        seconds, row = measured(increments, method)
        spent = {part: 1e3 * value / (increments - 1) for part, value in seconds.items()}
        print(f"{name:18s}{spent['all']:8.1f}" + "".join(f"{spent[part]:11.1f}" for part in PARTS.values()))
        solves = spent["triangular_solve"]
        print(
            f"  {spent['all'] / solves:.2f} times its solves, {spent['all'] / (solves + spent['operators']):.2f} times "
            f"its solves and operators, rest {spent['rest'] / spent['all']:.0%}; {row['triangular_solves']} solves, "
            f"{row['factorizations']} factorisations, {row['linear_chosen']}, {row['compiled_by'] or 'numpy alone'}"
        )


if __name__ == "__main__":
    with threadpool_limits(1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
