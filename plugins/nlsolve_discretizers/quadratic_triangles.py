"""Triangles of degree 2 on the cloud's own triangulation: errors fall with the third power of the spacing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field

from nlsolve.plugin import Cloud, Discretizer, Operators, PointOperators, SolveError, Status
from nlsolve_discretizers.elements import functions
from nlsolve_discretizers.elements.mesh import Mesh, Samples
from nlsolve_discretizers.moving_least_squares import MovingLeastSquares

NEARBY = MovingLeastSquares(degree=2, support=12)
"""Gives values at any points, for observables and figures."""


class QuadraticTriangles(Discretizer):
    """Velocities quadratic in each triangle, S = −Bᵀ A, B at three points of each (Zienkiewicz & Taylor 2000).

    The nodes of the scene are the corners; one more in the middle of each edge makes about four times as many, and
    edges on walls are curved by it. Pressures are linear on patches of two triangles, which have nine nodes, as a
    quadrilateral of degree 2 has: no λ locks, and the constraint is stable as it is there (Boland & Nicolaides 1983).
    """

    default_error_estimator: ClassVar[Mapping[str, Any] | None] = {"kind": "triangles"}
    order: ClassVar[float] = 3.0
    kind: Literal["triangles"] = "triangles"
    degree: Literal[2] = Field(2, description="degree of the velocity in a triangle; linear triangles are `delaunay`")

    def completed(self, cloud: Cloud) -> Mesh:
        """The cloud with the middles of edges."""
        return Mesh.of(cloud)

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when asked for, B_θ, S_θ, in conservative form."""
        mesh = _mesh(cloud)
        samples = mesh.samples(functions.POINTS)
        areas = samples.sizes / 6.0
        rate = samples.gradient.strain(len(mesh.nodes))
        return Operators(
            PointOperators.conservative(mesh, rate, samples.points.reshape(-1, 2), areas.ravel()),
            _volumetric(mesh, samples, areas) if volumetric else None,
            _node_areas(mesh, areas)[mesh.interior],
        )

    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """∂/∂x and ∂/∂y at the nodes: means over the triangles around each, by size."""
        mesh = _mesh(cloud)
        samples, n = mesh.samples(functions.NODES), len(mesh.nodes)
        places = mesh.elements.ravel(), np.arange(mesh.elements.size)
        around = sp.csr_array((samples.sizes.ravel(), places), shape=(n, mesh.elements.size))
        mean = sp.diags_array(1.0 / around.sum(axis=1)) @ around
        dx, dy = samples.gradient.matrices(n)
        return mean @ dx, mean @ dy

    def values(self, sources: np.ndarray, targets: np.ndarray) -> Any:
        """Sparse (T, N) matrix of values of a quadratic fit to the neighbours."""
        return NEARBY.values(sources, targets)


def _mesh(cloud: Cloud) -> Mesh:
    if isinstance(cloud, Mesh):
        return cloud
    raise SolveError(
        Status.BAD_CLOUD,
        "these nodes are not those of triangles of degree 2: `completed` of the discretizer gives a cloud its nodes",
    )


def _node_areas(mesh: Mesh, areas: np.ndarray) -> np.ndarray:
    """A third of the triangles around each middle of an edge, and 0 for corners, (N,) [mm²]: exact for quadratics."""
    return np.bincount(mesh.elements[:, 3:].ravel(), np.repeat(areas.sum(axis=1) / 3.0, 3), len(mesh.nodes))


def _volumetric(mesh: Mesh, samples: Samples, areas: np.ndarray) -> PointOperators:
    """B_θ v = ∫ ψ_k div v / ∫ ψ_k and S_θ = −B_θᵀ A, A = ∫ ψ_k, on every patch, with the linear functions

        ψ_k = (1 + √2 e · R_k)/3,   k = 1, 2, 3

    of e, the place from the centre of the patch in units in which its second moment is its area times the unit matrix;
    R_k are three unit vectors at 120°. They are orthogonal, their sum is 1 and ∫ ψ_k a third of the area: B_θ v is the
    projection of div v on linear functions, at the places e = √2 R_k where one of them is 1 and the others are 0.
    """
    count = int(mesh.patch.max()) + 1
    patch = np.repeat(mesh.patch, areas.shape[1])
    weights, points = areas.ravel(), samples.points.reshape(-1, 2)

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(patch, weights * values, count)

    whole = total(np.ones(len(patch)))
    centres = np.stack([total(x) for x in points.T], axis=1) / whole[:, None]
    x = points - centres[patch]
    moment = np.array([[total(x[:, i] * x[:, j]) for j in (0, 1)] for i in (0, 1)]) / whole
    unit = np.linalg.cholesky(moment.transpose(2, 0, 1))
    e = np.linalg.solve(unit[patch], x[..., None])[..., 0]
    angles = 2.0 * np.pi / 3.0 * np.arange(3)
    directions = np.sqrt(2.0) * np.stack([np.cos(angles), np.sin(angles)])
    psi = (1.0 + e @ directions) / 3.0  # (T P, 3)
    projection = sp.csr_array(
        (
            (psi * (3.0 * weights / whole[patch])[:, None]).ravel(),
            ((3 * patch[:, None] + np.arange(3)).ravel(), np.repeat(np.arange(len(patch)), 3)),
        ),
        shape=(3 * count, len(patch)),
    )
    rate = (projection @ samples.gradient.divergence(len(mesh.nodes))).tocsr()
    places = centres[:, None] + (unit @ directions).transpose(0, 2, 1)
    return PointOperators.conservative(mesh, rate, places.reshape(-1, 2), np.repeat(whole / 3.0, 3))
