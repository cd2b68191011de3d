"""Do the factorisations of a solve grow with the grid? Bratu and the p-Laplacian on a line, up to 100,000 unknowns.

    python benchmarks/grids.py [LARGEST]

Prints, for each problem, method and number of unknowns N, how the solve ended, its factorisations, its seconds in the
method, its Newton correction and its distance from the nearest known root.
"""

from __future__ import annotations

import sys

import nlsolve

SIZES = [100, 1_000, 10_000, 100_000]
PROBLEMS = {
    "bratu, λ = 1": {"kind": "bratu", "strength": 1.0},
    "bratu, λ = 3.5": {"kind": "bratu", "strength": 3.5},
    "p-laplacian, p = 1.5": {"kind": "p-laplacian", "power": 1.5, "regularization": 0.01},
}
SHOWN = ["status", "factorizations", "seconds", "newton_correction", "root_error"]


def main() -> None:
    largest = int(sys.argv[1]) if len(sys.argv) > 1 else SIZES[-1]
    study = {
        "question": "Do the factorisations grow with the grid?",
        "scene": {"kind": "bratu"},
        "linear": {"kind": "superlu", "ordering": "colamd"},
        "stop": {"tolerance": 1e-9},
        "sweep": [
            {"name": "problem", "each": [{"name": name, "scene": scene} for name, scene in PROBLEMS.items()]},
            {"grid": {"solver.kind": ["newton", "robust", "broyden"]}},
            {"grid": {"scene.nodes": [size for size in SIZES if size <= largest]}},
        ],
    }
    runs = nlsolve.run(study, jobs=1).runs
    print(runs[["problem", "solver.kind", "scene.nodes", *SHOWN]].to_string(index=False, float_format="%.2g"))


if __name__ == "__main__":
    main()
