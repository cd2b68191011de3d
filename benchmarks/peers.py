"""Is an equal strategy as cheap here as in PETSc's SNES and in SUNDIALS' KINSOL, and is it the same work?

    python benchmarks/peers.py [rounds]

Solves, on the 2015 paper's 1780 nodes, the steady spin at n = 0.3 from its Newtonian state, and the first increments
of the paper's march at n = 0.1324, by each strategy of nlsolve and by its equals in the libraries that are installed,
under one ledger and one stopping test. All are run in turn, `rounds` times. Prints the counts; the median
of the seconds in the method; the part of them outside all counted work (the method's own); and the median over the
rounds of our seconds over theirs. Seconds are the processor's, so that other programs do not count. SNES has no search
between two bounds, as ours of Goldstein and that of KINSOL, whose bounds differ: where steps are cut, counts differ.
"""

from __future__ import annotations

import statistics
import sys
from typing import Any

import nlsolve

INCREMENTS = 6
SCENES: dict[str, dict[str, Any]] = {
    "the steady spin, n = 0.3, from n = 1": {
        "scene": {"kind": "stirring-tool"},
        "law": {"kind": "power-law", "index": 0.3, "regularization": 1e-2},
        "start": {"values": [1.0]},
    },
    f"{INCREMENTS} increments of the march, n = 0.1324": {
        "scene": {"kind": "stirring-tool"},
        "physics": {"inertia": True, "penalty": 100.0},
        "time": {"horizon": INCREMENTS * 1e-4},
        "motion": {"nodes": "lagrangian"},
        "law": {"kind": "power-law", "regularization": 1e-2},
    },
}
POOR = {"refresh": {"kind": "poor-contraction"}}
FIFTH = {"refresh": {"kind": "every-m", "m": 5}}
NEVER = {"refresh": {"kind": "never"}}


def petsc(**settings: Any) -> dict[str, Any]:
    """SNES, by default newtonls with steps that are halved."""
    return {"solver": {"kind": "petsc-snes", "degree": 1, **settings}}


def kinsol(strategy: str, **settings: Any) -> dict[str, Any]:
    """KINSOL, by default with K* asked for at each iteration."""
    return {"solver": {"kind": "kinsol", "strategy": strategy, "setup_interval": 1, **settings}}


STRATEGIES: dict[str, dict[str, dict[str, Any]]] = {
    "Newton, steps halved": {
        "nlsolve": {"solver": {"kind": "newton"}},
        "petsc": petsc(),
    },
    "Newton, steps between two bounds": {
        "nlsolve": {"solver": {"kind": "newton", "globalization": {"kind": "goldstein"}}},
        "kinsol, its own bounds": kinsol("line-search"),
    },
    "Newton, steps by interpolation": {
        "nlsolve": {"solver": {"kind": "newton", "globalization": {"kind": "cubic"}}},
        "petsc": petsc(degree=2),
    },
    "modified Newton, K* renewed at poor contraction": {
        "nlsolve": {"solver": {"kind": "modified-newton"}},
        "petsc": petsc() | POOR,
    },
    "the same, steps between two bounds": {
        "nlsolve": {"solver": {"kind": "modified-newton", "globalization": {"kind": "goldstein"}}},
        "kinsol, its own bounds": kinsol("line-search") | POOR,
    },
    "modified Newton, K* renewed every 5 iterations": {
        "nlsolve": {"solver": {"kind": "modified-newton"}} | FIFTH,
        "petsc": petsc(lag=5, persists=True),
    },
    "Anderson, depth 5, the first K*": {
        "nlsolve": {"solver": {"kind": "anderson"}} | NEVER,
        "petsc": petsc(method="anderson") | NEVER,
        "kinsol, fixed point": kinsol("fixed-point") | NEVER,
    },
    "Newton-Krylov, the first K*": {
        "nlsolve": {"solver": {"kind": "newton-krylov", "products": "jacobian"}} | NEVER,
        "petsc": petsc(linear="gmres") | NEVER,
        "kinsol, its own search": kinsol("line-search", linear="gmres") | NEVER,
    },
}
COUNTS = ("factorizations", "triangular_solves", "residuals", "jacobians")
WORK = ("factorization", "triangular_solve", "residual", "jacobian", "series")


def solve(scene: dict[str, Any], strategy: dict[str, Any]) -> dict[str, Any]:
    """The row of one run, with the seconds that are the method's own."""
    study = {
        "question": "is it the same work?",
        "discretizer": {"kind": "mls"},
        "linear": {"kind": "superlu", "ordering": "mmd-ata"},
        "stop": {"tolerance": 1e-8},
        **scene,
        **strategy,
    }
    row = dict(nlsolve.run(study).runs.iloc[0])
    return row | {"own": row["seconds"] - sum(row[f"seconds_{kind}"] for kind in WORK)}


def compare(name: str, scene: dict[str, Any], rounds: int) -> None:
    """Print the table of one scene."""
    head = "".join(f"{word:>8s}" for word in ("factor", "solves", "resid", "jacob", "s", "own ms"))
    print(f"\n{name}\n{'':44s}{head}  ours/theirs")
    for strategy, peers in STRATEGIES.items():
        runs = [{peer: solve(scene, settings) for peer, settings in peers.items()} for _ in range(rounds)]
        print(f"  {strategy}")
        for peer in peers:
            row, ours = runs[0][peer], runs[0]["nlsolve"]
            if row["status"] != "converged":
                print(f"    {peer:40s}{row['status']}")
                continue
            counts = "".join(f"{row[count]:8d}" for count in COUNTS)
            seconds, own = (statistics.median(each[peer][what] for each in runs) for what in ("seconds", "own"))
            print(f"    {peer:40s}{counts}{seconds:8.3f}{1e3 * own:8.1f}", end="")
            if peer != "nlsolve" and ours["status"] == "converged":
                ratio = statistics.median(each["nlsolve"]["seconds"] / each[peer]["seconds"] for each in runs)
                equal = all(row[count] == ours[count] for count in COUNTS)
                print(f"{ratio:8.3f}  {'equal counts' if equal else 'other counts'}", end="")
            print(flush=True)


if __name__ == "__main__":
    for title, document in SCENES.items():
        compare(title, document, int(sys.argv[1]) if len(sys.argv) > 1 else 5)
