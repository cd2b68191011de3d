"""About a quarter of the nodes of a cloud: as many as can be, of which no two are neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import edges_of, on_one_wall
from nlsolve.series import Array, Mask

SEED = 0
CANDIDATES = 8
"""Triangles with the nearest centroids that a point may lie in."""


@dataclass(frozen=True)
class Thinned:
    """A cloud of K nodes out of the N of another one.

    weights : sparse (N, K), of the linear functions on the triangles of the kept nodes, at all nodes.
    """

    cloud: Cloud
    weights: Any

    @classmethod
    def of(cls, cloud: Cloud) -> Thinned:
        """The nodes that no edge of the triangulation joins, while every other node is joined to one of them; on walls
        first, so that these keep their shape. May raise SolveError (bad cloud).
        """
        keep = _independent(cloud)
        number = np.cumsum(keep) - 1
        groups = {name: number[group[keep[group]]] for name, group in cloud.boundaries.items()}
        fewer = Cloud(cloud.nodes[keep], groups)
        return cls(fewer, _linear(fewer, cloud.nodes))

    def carry(self, values: Array) -> Array:
        """Values at the kept nodes (K, …) -> at all nodes (N, …): linear between the kept ones."""
        carried: Array = self.weights @ values
        return carried


def _linear(cloud: Cloud, points: Array) -> Any:
    """The barycentric weights (P, N) of points (P, 2) in that triangle, among those with the nearest centroids, in
    which the least of them is largest: the one around the point, where there is one.
    """
    corners = cloud.triangulation[~on_one_wall(cloud.walls[cloud.triangulation.T])]
    count = min(CANDIDATES, len(corners))
    _, near = scipy.spatial.cKDTree(cloud.nodes[corners].mean(axis=1)).query(points, np.arange(1, count + 1))
    x, y = np.moveaxis(cloud.nodes[corners[near]] - points[:, None, None], 3, 0)  # (P, candidates, 3)
    areas = np.stack([x[..., k - 2] * y[..., k - 1] - x[..., k - 1] * y[..., k - 2] for k in range(3)], axis=2)
    shares = areas / areas.sum(axis=2, keepdims=True)
    best = shares.min(axis=2).argmax(axis=1)
    each = np.arange(len(points))
    rows = np.repeat(each, 3)
    entries = shares[each, best].ravel()
    return sp.csr_array((entries, (rows, corners[near[each, best]].ravel())), shape=(len(points), len(cloud.nodes)))


def _independent(cloud: Cloud) -> Mask:
    """Which nodes are kept, (N,): in rounds, those whose number drawn is larger than all of their neighbours' that are
    still undecided (Luby 1986).
    """
    size = len(cloud.nodes)
    drawn = np.random.default_rng(SEED).permutation(size) + size * cloud.on_boundary
    one, other = edges_of(cloud.triangulation).T
    keep, undecided = np.zeros(size, dtype=bool), np.ones(size, dtype=bool)
    while undecided.any():
        largest = np.full(size, -1)
        np.maximum.at(largest, one, drawn[other])
        np.maximum.at(largest, other, drawn[one])
        chosen = undecided & (drawn > largest)
        keep |= chosen
        beside = np.zeros(size, dtype=bool)
        beside[one[chosen[other]]] = beside[other[chosen[one]]] = True
        undecided &= ~(chosen | beside)
        left = undecided[one] & undecided[other]
        one, other = one[left], other[left]
    return keep
