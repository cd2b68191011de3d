"""h(x) ~ |∇∇V|^(−2/5) : the spacing of N nodes between which linear interpolation of V is best in the mean of order 4.

An error of e ~ h² |∇∇V| with N = ∫ 2/(√3 h²) dA nodes has the least ∫ e^p dA for h ~ |∇∇V|^(−p/(2p + 2)) (Chen, Sun
& Xu 2007). Order 2 neglects the worst point, and the largest error alone would take most nodes into layers at walls.

h grows by at most `GROWTH` per mm: h(x) = min_y (h(y) + GROWTH |x − y|).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import edges_of
from nlsolve.series import Array, Indices

POWER = 0.4
"""p/(2p + 2) for p = 4."""

GROWTH = 0.25
"""Largest slope of h."""

NEIGHBOURS = 14
"""Nodes to which a parabola of six coefficients is fitted."""

FLAT = 1e-9
"""The least second derivatives that count, as a part of the largest."""

FINEST = 1e-5
"""The least spacing, as a part of the width of the cloud."""

HALVINGS = 40


@dataclass(frozen=True)
class NodalSpacing:
    """h(x) by linear interpolation between nodes (N, 2) of h (N,) [mm] there; beyond them, that of the nearest."""

    nodes: Array
    values: Array

    def __call__(self, points: Array) -> Array:
        """h (P,) at points (P, 2)."""
        h = self._inside(points)
        beyond = np.isnan(h)
        if beyond.any():
            h[beyond] = self.values[self._tree.query(points[beyond])[1]]
        return h

    @cached_property
    def _inside(self) -> scipy.interpolate.LinearNDInterpolator:
        return scipy.interpolate.LinearNDInterpolator(self.nodes, self.values)

    @cached_property
    def _tree(self) -> scipy.spatial.cKDTree:
        return scipy.spatial.cKDTree(self.nodes)


def wanted_spacing(cloud: Cloud, velocity: Array, count: int, largest: float) -> NodalSpacing:
    """The spacing h ≤ `largest` [mm] with about `count` nodes for the `velocity` (N, 2), or with those that
    h = `largest` throughout takes.
    """
    sizes = second_derivatives(cloud, velocity)
    shape = np.maximum(sizes, FLAT * max(sizes.max(), np.finfo(float).tiny)) ** -POWER
    triangles = _Triangles.of(cloud)
    finest = FINEST * float(np.ptp(cloud.nodes, axis=0).max())

    def spacing(factor: float) -> Array:
        return triangles.growing_slowly(np.clip(factor * shape, finest, largest))

    low, high = np.log(finest / shape.max()), np.log(largest / shape.min())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if triangles.nodes_at(spacing(np.exp(middle))) > count else (low, middle)
    return NodalSpacing(cloud.nodes, spacing(np.exp(high)))


def second_derivatives(cloud: Cloud, velocity: Array) -> Array:
    """|∇∇V| = √Σ (∂²V_c/∂x_a ∂x_b)² at the nodes, (N,) [1/(mm s)], of parabolas fitted to the nearest nodes."""
    nodes = cloud.nodes
    distance, near = scipy.spatial.cKDTree(nodes).query(nodes, min(NEIGHBOURS, len(nodes)))
    reach = distance[:, -1]
    x, y = np.moveaxis((nodes[near] - nodes[:, None]) / reach[:, None, None], 2, 0)
    terms = np.stack([np.ones_like(x), x, y, 0.5 * x**2, x * y, 0.5 * y**2], axis=2)
    weights = (1.05 - distance / reach[:, None])[:, :, None]
    xx, xy, yy = np.moveaxis(np.linalg.pinv(terms * weights) @ (velocity[near] * weights), 1, 0)[3:]
    return np.sqrt((xx**2 + 2.0 * xy**2 + yy**2).sum(axis=1)) / reach**2


@dataclass(frozen=True)
class _Triangles:
    """The Delaunay triangles of a cloud with a node inside: across a hole all corners are at its wall.

    areas : (T,) [mm²]; corners : (T, 3); sides : distances of neighbours, sparse (N, N) [mm].
    """

    areas: Array
    corners: Indices
    sides: scipy.sparse.csr_array

    @classmethod
    def of(cls, cloud: Cloud) -> _Triangles:
        corners = cloud.triangulation
        corners = corners[~cloud.on_boundary[corners].all(axis=1)]
        (ax, ay), (bx, by) = ((cloud.nodes[corners[:, end]] - cloud.nodes[corners[:, 0]]).T for end in (1, 2))
        i, j = edges_of(corners).T
        length = np.linalg.norm(cloud.nodes[i] - cloud.nodes[j], axis=1)
        size = len(cloud.nodes)
        return cls(0.5 * np.abs(ax * by - ay * bx), corners, scipy.sparse.csr_array((length, (i, j)), (size, size)))

    def nodes_at(self, spacing: Array) -> float:
        """∫ 2/(√3 h²) dA for h (N,) at the nodes."""
        return float(2.0 / np.sqrt(3.0) * self.areas @ (1.0 / spacing[self.corners] ** 2).mean(axis=1))

    def growing_slowly(self, spacing: Array) -> Array:
        """min_j (h_j + GROWTH · length of the way from j along the sides), (N,): distances from a further node, from
        which node j is h_j away.
        """
        size = len(spacing)
        i, j, length = scipy.sparse.find(self.sides)
        i, j = np.append(i, np.full(size, size)), np.append(j, np.arange(size))
        ways = scipy.sparse.csr_array((np.append(GROWTH * length, spacing), (i, j)), (size + 1, size + 1))
        return scipy.sparse.csgraph.dijkstra(ways, directed=False, indices=size)[:size]
