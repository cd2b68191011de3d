"""A cloud with more nodes: in the middle of the edges of its triangulation, those of curved walls on the curve; or
those that a discretizer adds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import on_one_wall, subdivided
from nlsolve.contracts.continuum.walls import middles, wall_edges
from nlsolve.series import Array, Indices

FEW, MANY = 8, 64
"""Triangles near a point among which the one that holds it is looked for, at first and then."""

BEYOND = 1.0
"""How far outside of its triangle a point may be, as a barycentric coordinate, for values to go on linearly there."""


@dataclass(frozen=True)
class Finer:
    """A cloud (M nodes) whose first N nodes are those of a coarser one.

    weights : sparse (M, N), values at the coarser cloud's nodes -> at all nodes.
    """

    cloud: Cloud
    coarser: Cloud
    weights: Any

    def carry(self, values: Array) -> Array:
        """Values at the coarser cloud's nodes, (N,) or (N, 2) -> at all nodes: linear in between."""
        carried: Array = self.weights @ values
        return carried

    @property
    def interpolation(self) -> Any:
        """`weights` for velocities that are zero on the boundary, sparse (2F, 2 F_c): from the unknowns of the coarser
        cloud to those of this one, those of a node side by side.
        """
        inside = self.weights[self.cloud.interior][:, self.coarser.interior]
        return sp.kron(inside, sp.eye_array(2), format="csr")


def inner_edges(cloud: Cloud) -> Indices:
    """The edges of the Delaunay triangulation with a node inside, (E, 2). Across a hole both ends are at its wall."""
    return cloud.edges[~cloud.on_boundary[cloud.edges].all(axis=1)]


def the_same(cloud: Cloud) -> Finer:
    """The cloud without further nodes."""
    return Finer(cloud, cloud, sp.eye_array(len(cloud.nodes), format="csr"))


def completed(cloud: Cloud, coarser: Cloud) -> Finer:
    """A `cloud` whose first nodes are those of a `coarser` one."""
    if cloud.between is not None and len(cloud.nodes) == len(coarser.nodes) + len(cloud.between):
        return Finer(cloud, coarser, _with_means(cloud.between, len(coarser.nodes)))
    added = interpolation(coarser, cloud.nodes[len(coarser.nodes) :])
    return Finer(cloud, coarser, _after_its_own(added))


def twice_as_fine(cloud: Cloud) -> Finer:
    """The cloud with a node in the middle of each edge inside and at walls: about four times as many."""
    within, walls = inner_edges(cloud), wall_edges(cloud, cloud.triangulation)
    both_in = [np.isin(walls[:, 1:3], group).all(axis=1) for group in cloud.boundaries.values()]
    named = np.array(both_in).reshape(len(both_in), len(walls)).any(axis=0)
    numbers = len(cloud.nodes) + len(within) - 1 + np.cumsum(named)
    groups = {
        name: np.concatenate([group, numbers[both & named]])
        for (name, group), both in zip(cloud.boundaries.items(), both_in, strict=True)
    }
    edges = np.concatenate([within, walls[named, 1:3]])
    places = np.concatenate([cloud.nodes[within].mean(axis=1), middles(cloud.nodes, walls[named])])
    nodes, triangles = np.concatenate([cloud.nodes, places]), subdivided(cloud.triangulation, edges, len(cloud.nodes))
    finer = Cloud(nodes, groups, triangles_before=triangles, between=edges)
    return Finer(finer, cloud, _with_means(edges, len(cloud.nodes)))


def _with_means(between: Indices, nodes: int) -> Any:
    """The weights of further nodes in the middle `between` two, (E, 2), of a cloud, below those of its own."""
    starts = np.concatenate([np.arange(nodes), nodes + np.arange(0, between.size + 1, 2)])
    places, shares = np.concatenate([np.arange(nodes), between.ravel()]), np.ones(nodes + between.size)
    shares[nodes:] = 0.5
    return sp.csr_array((shares, places, starts), shape=(nodes + len(between), nodes))


def _after_its_own(added: Any) -> Any:
    """A cloud's weights (E, N) of further nodes below those of its own."""
    return sp.vstack([sp.eye_array(added.shape[1]), added], format="csr")


def interpolation(cloud: Cloud, points: Array) -> Any:
    """Sparse (P, N), values at the nodes of a cloud -> at points (P, 2): linear on the triangles and a little beyond
    them, and further away those of the nearest node.
    """
    corners = cloud.triangulation[~on_one_wall(cloud.walls[cloud.triangulation.T])]
    tree = scipy.spatial.cKDTree(cloud.nodes[corners].mean(axis=1))
    places, shares = _shares(cloud, corners, tree, points, FEW)
    far = np.flatnonzero(shares.min(axis=1) < 0.0)
    places[far], shares[far] = _shares(cloud, corners, tree, points[far], MANY)
    away = np.flatnonzero(shares.min(axis=1) < -BEYOND)
    places[away] = cloud.tree.query(points[away])[1][:, None]
    shares[away] = 1.0 / 3.0
    rows = np.repeat(np.arange(len(points)), 3)
    return sp.csr_array((shares.ravel(), (rows, places.ravel())), shape=(len(points), len(cloud.nodes)))


def _shares(cloud: Cloud, corners: Indices, tree: Any, points: Array, count: int) -> tuple[Indices, Array]:
    """Of the triangles with the `count` nearest centroids that in which the least barycentric coordinate of a point is
    largest, so that it holds the point if one does: corners and coordinates, (P, 3).

    tree : of the centroids of the triangles with these `corners` (T, 3).
    """
    _, near = tree.query(points, np.arange(1, min(count, len(corners)) + 1))
    x, y = np.moveaxis(cloud.nodes[corners[near]] - points[:, None, None], 3, 0)  # (P, count, 3)
    areas = np.stack([x[..., k - 2] * y[..., k - 1] - x[..., k - 1] * y[..., k - 2] for k in range(3)], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.nan_to_num(areas / areas.sum(axis=2, keepdims=True), nan=-np.inf)  # of slivers
    best = np.arange(len(points)), shares.min(axis=2).argmax(axis=1)
    return corners[near[best]], shares[best]
