"""Does the tangent by triangles pay as the preconditioner of a wider stencil's? The steady spin by `mls`, n = 0.1324.

    python benchmarks/triangles.py [most nodes]

For clouds of 4,000 to 100,000 nodes (default: up to 20,000) prints the products that GMRES needs for Newton's
correction at the solution's neighbour of n = 0.15, to 10⁻² and 10⁻⁴; then, of Newton's method and of newton-krylov
preconditioned with triangles, each on the same way from n = 1 and without the estimate of the error: the matrices
factorised and the pairs of triangular solves on the way and after it, the entries of the last factors, and processor
seconds of the whole; and the ratio of the latter. Both have the best linear solver installed (`auto`).
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from nlsolve_discretizers import LinearTriangles
from nlsolve_solvers.krylov.gmres import gmres
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.momentum import Flow
from nlsolve.solving.simulate import run_case

INDEX, BEFORE = 0.1324, 0.15
SCALES = (0.74, 0.37, 0.22, 0.143)  # of all spacings: 4,000 to 100,000 nodes
METHODS: dict[str, dict[str, Any]] = {
    "newton": {"kind": "newton"},
    "triangles": {"kind": "newton-krylov", "preconditioner": "triangles"},
}


def parts(scale: float, solver: dict[str, Any]) -> Any:
    """The components of the steady spin on graded rings; nothing estimates its error."""
    nodes = {"kind": "graded-rings", "first": 0.1 * scale, "growth": 0.12 * scale, "spacing": 0.25 * scale}
    study = {
        "question": "does the tangent by triangles pay?",
        "scene": {"kind": "stirring-tool", "nodes": nodes},
        "law": {"kind": "power-law", "index": INDEX, "regularization": 1e-3},
        "discretizer": {"kind": "mls"},
        "solver": solver,
        "start": {"solver": solver},
    }
    return nlsolve.Study.from_dict(study).cases[0].parts.model_copy(update={"error_estimator": None})


def products(case: Any, tolerances: tuple[float, ...]) -> list[int]:
    """Products of GMRES for Newton's correction at the exact spin of n = 0.15."""
    cloud = case.scene.cloud(case.law)
    walls = case.scene.boundary_velocity(cloud, case.law, 0.0)
    flow = Flow(cloud, case.discretizer.operators(cloud, False), case.law, walls)
    u = flow.unknowns(case.scene.exact(case.law.with_(index=BEFORE), cloud.nodes, 0.0).velocity)
    residual, jacobian = flow.residual(u), flow.jacobian(u)
    factors = case.linear.factorize(flow.jacobian_by(LinearTriangles(), u))
    size = float(np.linalg.norm(residual))
    return [gmres(jacobian.__matmul__, factors.solve, -residual, part * size, 60).count for part in tolerances]


def main(most: int) -> None:
    """Print a line for each cloud and method."""
    print("  nodes  products   method      factorised   solves   entries   seconds   ratio   velocity error")
    for scale in SCALES:
        case = parts(scale, METHODS["newton"])
        nodes = len(case.scene.cloud(case.law).nodes)
        if nodes > most:
            break
        fewer, more = products(case, (1e-2, 1e-4))
        first: float | None = None
        for name, solver in METHODS.items():
            row = run_case(parts(scale, solver)).summary
            assert row["status"] == "converged", row["message"]
            factorised, solves = (row[k] + row[f"start_{k}"] for k in ("factorizations", "triangular_solves"))
            first = first or row["seconds_all"]
            print(
                f"{nodes:7d} {fewer:5d},{more:3d}   {name:10s} {factorised:11d} {solves:8d} {row['fill'] / 1e6:7.1f} M"
                f"{row['seconds_all']:10.1f} {first / row['seconds_all']:7.2f} {100 * row['velocity_error']:14.4f} %",
                flush=True,
            )


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
