"""How do seconds and memory of a steady flow grow with its nodes? The spin at n = 0.1324, 4,000 to 101,000 nodes.

    python benchmarks/growth.py [most nodes]

Prints for `delaunay` with SciPy's SuperLU (up to 17,000 nodes) and with the best linear solver installed (`auto`), for
`triangles` of degree 2 with the same, and for `mls` by newton-krylov preconditioned with triangles: nodes, error of the
velocity inside, processor seconds of everything, of operators, and of audits with the estimate of the error, and memory
of the process [GB]; then the exponents of their growth from the smallest to the largest cloud that was run. Every case
runs in a process of its own, one at a time.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.solving.simulate import run_case

SCALES = (0.74, 0.37, 0.22, 0.143)  # of all spacings of `delaunay`: 4,000 to 101,000 nodes
NODES_AT_ONE, MOST_BY_SCIPY = 2_200, 17_000
METHODS: dict[str, dict[str, Any]] = {
    "delaunay, SciPy": {"discretizer": {"kind": "delaunay"}, "linear": {"kind": "superlu"}},
    "delaunay": {"discretizer": {"kind": "delaunay"}},
    "triangles": {"discretizer": {"kind": "triangles"}},
    "mls": {"discretizer": {"kind": "mls"}, "solver": {"kind": "newton-krylov", "preconditioner": "triangles"}},
}


@dataclass(frozen=True)
class Cost:
    """Of one case: nodes, relative error, processor seconds of everything, of operators, and of audits with the
    estimate of the error; and memory [GB].
    """

    nodes: int
    error: float
    seconds: float
    operators: float
    audits: float
    memory: float


def cost(name: str, scale: float) -> Cost:
    """Of one case, in this process, after a small one that imports and compiles what it needs."""
    with threadpool_limits(limits=1):
        run_case(parts(name, 4.0))
        case = parts(name, scale)
        begun = time.process_time()
        row = run_case(case).summary
        seconds = time.process_time() - begun
    assert row["status"] == "converged", row["message"]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    operators, audits = float(row["seconds_operators"]), seconds - float(row["seconds_all"])
    return Cost(int(row["nodes"]), float(row["velocity_error_inside"]), seconds, operators, audits, memory)


def parts(name: str, scale: float) -> Any:
    """The components; a triangle of degree 2 is twice as wide, and has as many nodes as four others."""
    width = 2.0 * scale if name == "triangles" else scale
    nodes = {"kind": "graded-rings", "first": 0.1 * width, "growth": 0.12 * width, "spacing": 0.25 * width}
    solver = METHODS[name].get("solver", {"kind": "newton"})
    study = {
        "question": "how do seconds grow with the nodes?",
        "scene": {"kind": "stirring-tool", "nodes": nodes},
        "law": {"kind": "power-law", "index": 0.1324, "regularization": 1e-3},
        "start": {"solver": solver, "tolerance": 1e-8},
        "stop": {"tolerance": 1e-8},
        **METHODS[name],
        "solver": solver,
    }
    return nlsolve.Study.from_dict(study).cases[0].parts


def main(most: int) -> None:
    """Print the costs and the exponents."""
    print("method              nodes    error inside   seconds   operators     audits     GB")
    found: dict[str, list[Cost]] = {}
    for name in METHODS:
        for scale in SCALES:
            if NODES_AT_ONE / scale**2 > (MOST_BY_SCIPY if "SciPy" in name else most):
                continue
            spawn = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(1, mp_context=spawn) as pool:
                one = pool.submit(cost, name, scale).result()
            found.setdefault(name, []).append(one)
            print(
                f"{name:16s} {one.nodes:8d} {100.0 * one.error:12.4f} % {one.seconds:9.2f} {one.operators:11.2f} "
                f"{one.audits:10.2f} {one.memory:6.2f}",
                flush=True,
            )
    print("\nexponent of N         seconds   operators   memory")
    for name, costs in found.items():
        first, last = costs[0], costs[-1]
        growth = np.log(last.nodes / first.nodes)
        exponents = [
            np.log(getattr(last, part) / getattr(first, part)) / growth for part in ("seconds", "operators", "memory")
        ]
        print(f"{name:16s} {exponents[0]:12.2f} {exponents[1]:11.2f} {exponents[2]:8.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
