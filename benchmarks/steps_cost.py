"""What do one series of p orders, one Newton iteration and one moved cloud cost? Ratios measured in one run.

    python benchmarks/steps_cost.py [repeats]

Prints, on the 2015 paper's 1780 nodes, the median seconds of each piece of work and the two ratios that decide whether
a series is cheap: p orders over their p triangular solves, and operators over one factorisation.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.momentum import Flow

ORDER = 20
MOVED = "operators of a moved cloud"


def median_seconds(work: Callable[[], object], repeats: int) -> float:
    """Median processor time over `repeats` runs [s], after one that is not counted."""
    work()
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        work()
        seconds.append(time.process_time() - begun)
    return statistics.median(seconds)


def measure(volume_points: str, repeats: int) -> None:
    """Print the time of each piece of one increment of the paper's scene, with one form of the volumetric term."""
    study = nlsolve.Study.from_dict(
        {
            "question": "what does a step cost?",
            "scene": {"kind": "stirring-tool"},
            "physics": {"penalty": 100.0},
            "law": {"kind": "power-law"},
            "discretizer": {"kind": "mls", "volume_points": volume_points},
            "solver": {"kind": "newton"},
        }
    )
    parts = study.cases[0].parts
    scene, law, discretizer = parts.scene, parts.law, parts.discretizer
    cloud = scene.cloud(law)
    operators = discretizer.operators(cloud, True)
    flow = Flow(
        cloud,
        operators,
        law,
        scene.boundary_velocity(cloud, law, 0.0),
        parts.physics.penalty_modulus(law, scene.reference_rate, np.zeros(1)),
    )
    exact = scene.exact(law, cloud.nodes, 0.0)
    assert exact is not None
    state = flow.unknowns(exact.velocity)
    matrix = flow.jacobian(state)
    factors = parts.linear.factorize(matrix)
    rhs = flow.residual(state)

    within = list[float]()  # seconds of triangular solves inside each series, where the factors have left the cache

    def series() -> None:
        spent = 0.0
        expansion = flow.expand(state)
        step = -expansion.coefficient(0)
        for j in range(1, ORDER + 1):
            if j > 1:
                step = step - expansion.coefficient(j - 1)
            begun = time.process_time()
            w_j = factors.solve(step)
            spent += time.process_time() - begun
            expansion.append(w_j)
        within.append(spent)

    def solves() -> None:
        for _ in range(ORDER):
            factors.solve(rhs)

    pieces: dict[str, Callable[[], object]] = {
        MOVED: lambda: discretizer.operators(cloud.moved_to(cloud.nodes), True),
        "residual": lambda: flow.residual(state),
        "Jacobian": lambda: flow.jacobian(state),
        "factorisation": lambda: parts.linear.factorize(matrix, factors),
        f"{ORDER} triangular solves": solves,
        f"series of {ORDER} orders with its solves": series,
    }
    seconds = {name: median_seconds(work, repeats) for name, work in pieces.items()}
    whole, alone = seconds[f"series of {ORDER} orders with its solves"], seconds[f"{ORDER} triangular solves"]
    limit = 0.5 * seconds["factorisation"] + 0.030
    print(f"\nvolume points: {volume_points}; {len(cloud.nodes)} nodes, {matrix.nnz} nonzeros, {factors.ordering}")
    for name, value in seconds.items():
        print(f"  {name:42s}{1e3 * value:8.2f} ms")
    print(
        f"  series over the solves inside it          {whole / statistics.median(within):8.2f}      (aim: at most 2.5)"
    )
    print(f"  series over as many solves back to back   {whole / alone:8.2f}")
    print(f"  operators over (factorisation/2 + 30 ms)  {seconds[MOVED] / limit:8.2f}  (aim: at most 1)")


if __name__ == "__main__":
    np.seterr(all="raise")
    with threadpool_limits(limits=1):
        for form in ("pairs", "nodes"):
            measure(form, int(sys.argv[1]) if len(sys.argv) > 1 else 15)
