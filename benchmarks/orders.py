"""Orders of convergence on a manufactured solution, by weights and by degree.

    python benchmarks/orders.py

Prints, for nodes of a jittered grid and for scattered ones, and for n = 1 and 0.5, the relative ℓ² error of the inner
nodes' velocities at each spacing, and the order in N^(−1/2) between this spacing and the one before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import nlsolve

DISCRETIZERS: dict[str, dict[str, Any]] = {
    "mls, degree 2": {"kind": "mls"},
    "mls, degree 3": {"kind": "mls", "degree": 3, "support": 20, "force_support": 24},
    "mls, degree 4": {"kind": "mls", "degree": 4, "support": 30, "force_support": 34},
    "rbf r³, degree 2": {"kind": "rbf"},
    "rbf r⁵, degree 3": {"kind": "rbf", "degree": 3, "power": 5},
    "rbf r⁷, degree 3": {"kind": "rbf", "degree": 3, "power": 7},
    "rbf r⁵, degree 4": {"kind": "rbf", "degree": 4, "power": 5},
    "rbf r⁷, degree 4": {"kind": "rbf", "degree": 4, "power": 7},
    "mls, conservative": {"kind": "mls", "form": "conservative"},
    "rbf, conservative": {"kind": "rbf", "form": "conservative"},
    "linear triangles": {"kind": "delaunay"},
}
"""Least squares of degree 3 and 4 take twice as many neighbours as there are monomials; radial functions always do."""

NODES: dict[str, dict[str, Any]] = {"a jittered grid": {"jitter": 0.2}, "scattered nodes": {"nodes": "scattered"}}
SPACINGS = (0.1, 0.0667, 0.05, 0.025)


def errors(
    discretizer: dict[str, Any], nodes: dict[str, Any], index: float, spacings: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Number of nodes and error at each spacing. Raises RuntimeError for a case that does not converge."""
    counts, found = [], []
    for spacing in spacings:
        study = {
            "question": "how fast does the error fall?",
            "scene": {"kind": "manufactured", "spacing": spacing, **nodes},
            "law": {"kind": "power-law", "index": index, "regularization": 1e-3},
            "discretizer": discretizer,
            "solver": {"kind": "newton"},
            "stop": {"tolerance": 1e-10},
        }
        run = nlsolve.run(study).runs.iloc[0]
        if run["status"] != "converged":
            raise RuntimeError(f"{discretizer} at spacing {spacing}: {run['message']}")
        counts.append(int(run["nodes"]))
        found.append(float(run["velocity_error_inside"]))
    return np.array(counts), np.array(found)


def orders(counts: np.ndarray, found: np.ndarray) -> np.ndarray:
    """p of error ~ N^(−p/2) between each two spacings."""
    return 2.0 * np.log(found[:-1] / found[1:]) / np.log(counts[1:] / counts[:-1])


def table() -> None:
    """Print errors and orders of all discretizers."""
    for name, nodes in NODES.items():
        for index in (1.0, 0.5):
            print(f"\n{name}, n = {index}" + "".join(f"{h:>13.4g} mm" for h in SPACINGS))
            for label, discretizer in DISCRETIZERS.items():
                counts, found = errors(discretizer, nodes, index, SPACINGS)
                between = ["", *(f"{p:.2f}" for p in orders(counts, found))]
                cells = (f"{error:10.1e} {p:>5s}" for error, p in zip(found, between, strict=True))
                print(f"  {label:20s}     " + "".join(cells), flush=True)


if __name__ == "__main__":
    table()
