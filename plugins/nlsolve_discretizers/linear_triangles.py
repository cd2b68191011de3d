"""Linear triangles on the cloud's own triangulation: the baseline that meshless forms must beat at equal cost."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from nlsolve.plugin import Cloud, Discretizer, Operators, PointOperators
from nlsolve_discretizers import kernels
from nlsolve_discretizers.moving_least_squares import MovingLeastSquares
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.diagnostics import diagnosis
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles

NEARBY = MovingLeastSquares(degree=1, support=6)
"""Gives values at any points, for observables and figures."""


class LinearTriangles(Discretizer):
    """∇φ of the hat functions, one strain point a triangle, S = −Bᵀ A: linear finite elements (Courant 1943).

    The volumetric term is the mean of div v over patches of two triangles; on every triangle it would lock.
    """

    kind: Literal["delaunay"] = "delaunay"

    def compiled_by(self) -> str | None:
        """numba, where it is installed, for the rows of B and for values at any points."""
        return kernels.loaded()

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when asked for, B_θ, S_θ, in conservative form."""
        return _operators(Triangles.of(cloud), volumetric)

    def moved(self, operators: Operators, cloud: Cloud) -> Operators | None:
        """The operators on the moved cloud with the same triangles; None if a triangle is turned inside out."""
        triangles = operators.neighbours.moved_to(cloud)
        return _operators(triangles, operators.volumetric is not None) if triangles.are_upright else None

    def renewed(self, operators: Operators, cloud: Cloud) -> Operators:
        """The operators on the moved cloud, its triangles found with the help of those of before."""
        return _operators(operators.neighbours.renewed(cloud), operators.volumetric is not None)

    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """∂/∂x and ∂/∂y at the nodes: means over the triangles around each, by area."""
        triangles = Triangles.of(cloud)
        t, n = len(triangles.corners), len(cloud.nodes)
        around = sp.csr_array(
            (np.repeat(triangles.areas / 3.0, 3), (triangles.corners.ravel(), np.repeat(np.arange(t), 3))), shape=(n, t)
        )
        mean = sp.diags_array(1.0 / triangles.node_areas) @ around
        dx, dy = _gradient(triangles).matrices(n)
        return mean @ dx, mean @ dy

    def values(self, sources: np.ndarray, targets: np.ndarray) -> Any:
        """Sparse (T, N) matrix of values of a linear fit to the neighbours."""
        return NEARBY.values(sources, targets)

    def diagnostics(self, cloud: Cloud) -> list[dict[str, Any]]:
        """One row, for the strain weights; their supports are the triangles."""
        triangles = Triangles.of(cloud)
        gradient, centroids = _gradient(triangles), triangles.centroids()
        radius = np.linalg.norm(cloud.nodes[triangles.corners] - centroids[:, None], axis=2).max(axis=1)
        supports = Supports(triangles.corners, np.full(len(radius), 3), radius, radius)
        row = diagnosis(cloud.nodes, centroids, supports, gradient.both, 1)
        return [{"operator": "strain", **row, "grown": 0}]


def _operators(triangles: Triangles, volumetric: bool) -> Operators:
    cloud = triangles.cloud
    rate = _gradient(triangles).strain(len(cloud.nodes))
    return Operators(
        PointOperators.conservative(cloud, rate, triangles.centroids(), triangles.areas),
        triangles.patches().conservative() if volumetric else None,
        triangles.node_areas[cloud.interior],
        neighbours=triangles,
    )


def _gradient(triangles: Triangles) -> Gradient:
    hats = triangles.hat_gradients / triangles.areas[:, None, None]
    return Gradient(triangles.corners, np.moveaxis(hats, 2, 0))
