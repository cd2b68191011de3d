"""∂/∂x and ∂/∂y from the nearest nodes by other libraries, where they are installed: treverhines-rbf, pycompadre."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import scipy

Weights = Callable[[np.ndarray, np.ndarray, int, int], object]
"""Called with nodes (N, 2), points (T, 2), the degree of the polynomials and the number of neighbours."""


def polyharmonic() -> Weights:
    """r³ and polynomials by treverhines-rbf (Hines 2025), as sparse matrices."""
    weight_matrix = import_module("rbf.pde.fd").weight_matrix

    def weights(nodes: np.ndarray, points: np.ndarray, degree: int, count: int) -> object:
        given = {"n": count, "phi": "phs3", "order": degree, "diffs": [[1, 0], [0, 1]], "sum_terms": False}
        return weight_matrix(points, nodes, **given)

    return weights


def moving_least_squares() -> Weights:
    """Moving least squares by QR of pycompadre (Kuberry, Bosler & Trask 2019), on one thread.

    It is given the neighbours that ours has; what it finds stays with it.
    """
    library = import_module("pycompadre")
    kokkos = library.KokkosParser(["--kokkos-num-threads=1"])  # runs as long as it is held

    def weights(nodes: np.ndarray, points: np.ndarray, degree: int, count: int) -> object:
        assert kokkos is not None
        distance, index = scipy.spatial.cKDTree(nodes).query(points, count + 1)
        problem = library.GMLS(degree, 2, "QR", "STANDARD")
        helper = library.ParticleHelper(problem)
        helper.generateKDTree(nodes)
        helper.setTargetSites(points)
        helper.setNeighbors(np.column_stack([np.full(len(points), count), index[:, :count]]).astype(np.int32))
        helper.setWindowSizes(distance[:, -2:].mean(axis=1))
        problem.setWeightingType("power")
        problem.addTargets([library.PartialXOfScalarPointEvaluation, library.PartialYOfScalarPointEvaluation])
        problem.generateAlphas(1, False)
        return None

    return weights


PACKAGES = {"pycompadre": ("pycompadre", moving_least_squares), "treverhines-rbf": ("rbf", polyharmonic)}


def installed() -> dict[str, Weights]:
    """The libraries that are installed, by the names under which pip installs them."""
    return {name: load() for name, (module, load) in PACKAGES.items() if find_spec(module) is not None}
