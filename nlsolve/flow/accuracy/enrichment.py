"""A cloud with more nodes: in the middle of the edges of its triangulation, those of curved walls on the curve; or
those that a discretizer adds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import edges_of, on_one_wall, subdivided
from nlsolve.contracts.continuum.walls import middles, wall_edges
from nlsolve.series import Array, Indices

FEW, MANY = 8, 64
"""Triangles near a point among which the one that holds it is looked for, at first and then."""

BEYOND = 1.0
"""How far outside of its triangle a point may be, as a barycentric coordinate, for values to go on linearly there."""


class Finer(Protocol):
    """A cloud whose first N nodes are those of a coarser one."""

    @property
    def cloud(self) -> Cloud:
        """The cloud, M nodes."""

    def carry(self, values: Array, /) -> Array:
        """Values at the coarser cloud's nodes (N, …) -> at all nodes (M, …)."""


@dataclass(frozen=True)
class Completed:
    """A cloud to which a discretizer has added nodes of its own."""

    cloud: Cloud
    coarser: Cloud

    def carry(self, values: Array) -> Array:
        """Linear between the coarser cloud's nodes."""
        return carried(self.coarser, self.cloud)(values)


@dataclass(frozen=True)
class Enriched:
    """A cloud (N + E nodes) whose first N nodes are those of a coarser one.

    ends : the nodes between which each further node was put, (E, 2).
    """

    cloud: Cloud
    ends: Indices

    def carry(self, values: Array) -> Array:
        """Values at the coarser cloud's nodes (N, …) -> at all nodes (N + E, …): means of both ends."""
        return np.concatenate([values, values[self.ends].mean(axis=1)])

    def interpolation(self, coarser: Cloud) -> Any:
        """`carry` of velocities that are zero on the boundary, (2F, 2 F_c): from the unknowns of the `coarser` cloud
        to those of this one, of each node side by side.
        """
        count, added = len(coarser.nodes), len(self.ends)
        means = sp.csr_array((np.full(2 * added, 0.5), self.ends.ravel(), 2 * np.arange(added + 1)), (added, count))
        carry = sp.vstack([sp.eye_array(count), means], format="csr")
        return sp.kron(carry[self.cloud.interior][:, coarser.interior], sp.eye_array(2), format="csr")


def inner_edges(cloud: Cloud) -> Indices:
    """The edges of the Delaunay triangulation with a node inside, (E, 2). Across a hole both ends are at its wall."""
    edges = edges_of(cloud.triangulation)
    return edges[~cloud.on_boundary[edges].all(axis=1)]


def enriched(cloud: Cloud, edges: Indices) -> Enriched:
    """The cloud with a node in the middle of each of these edges (E, 2); the cloud itself without any."""
    if not len(edges):
        return Enriched(cloud, edges)
    return _with_nodes(cloud, edges, cloud.nodes[edges].mean(axis=1), cloud.boundaries)


def twice_as_fine(cloud: Cloud) -> Enriched:
    """The cloud with a node in the middle of each edge inside and at walls: about four times as many."""
    within, walls = inner_edges(cloud), wall_edges(cloud, cloud.triangulation)
    both_in = [np.isin(walls[:, 1:3], group).all(axis=1) for group in cloud.boundaries.values()]
    named = np.array(both_in).reshape(len(both_in), len(walls)).any(axis=0)
    numbers = len(cloud.nodes) + len(within) - 1 + np.cumsum(named)
    groups = {
        name: np.concatenate([group, numbers[both & named]])
        for (name, group), both in zip(cloud.boundaries.items(), both_in, strict=True)
    }
    places = np.concatenate([cloud.nodes[within].mean(axis=1), middles(cloud.nodes, walls[named])])
    return _with_nodes(cloud, np.concatenate([within, walls[named, 1:3]]), places, groups)


def _with_nodes(cloud: Cloud, edges: Indices, places: Array, boundaries: Mapping[str, Indices]) -> Enriched:
    """The cloud with a node at each of `places` (E, 2) near the middle of `edges` (E, 2)."""
    triangles = subdivided(cloud.triangulation, edges, len(cloud.nodes))
    nodes = np.concatenate([cloud.nodes, places])
    return Enriched(Cloud(nodes, boundaries, triangles_before=triangles), edges)


def carried(here: Cloud, there: Cloud) -> Callable[[Array], Array]:
    """Values (N, …) at the nodes `here` -> at the nodes `there`: linear on the triangles and a little beyond them, and
    further away those of the nearest node.
    """
    corners = here.triangulation[~on_one_wall(here.walls[here.triangulation.T])]
    tree = scipy.spatial.cKDTree(here.nodes[corners].mean(axis=1))
    places, shares = _shares(here, corners, tree, there.nodes, FEW)
    far = np.flatnonzero(shares.min(axis=1) < 0.0)
    places[far], shares[far] = _shares(here, corners, tree, there.nodes[far], MANY)
    away = np.flatnonzero(shares.min(axis=1) < -BEYOND)
    places[away] = here.tree.query(there.nodes[away])[1][:, None]
    shares[away] = 1.0 / 3.0
    rows = np.repeat(np.arange(len(there.nodes)), 3)
    weights = sp.csr_array((shares.ravel(), (rows, places.ravel())), shape=(len(there.nodes), len(here.nodes)))
    return lambda values: weights @ values


def _shares(here: Cloud, corners: Indices, tree: Any, points: Array, count: int) -> tuple[Indices, Array]:
    """Of the triangles with the `count` nearest centroids that in which the least barycentric coordinate of a point is
    largest, so that it holds the point if one does: corners and coordinates, (P, 3).

    tree : of the centroids of the triangles with these `corners` (T, 3).
    """
    _, near = tree.query(points, np.arange(1, min(count, len(corners)) + 1))
    x, y = np.moveaxis(here.nodes[corners[near]] - points[:, None, None], 3, 0)  # (P, count, 3)
    areas = np.stack([x[..., k - 2] * y[..., k - 1] - x[..., k - 1] * y[..., k - 2] for k in range(3)], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.nan_to_num(areas / areas.sum(axis=2, keepdims=True), nan=-np.inf)  # of slivers
    best = np.arange(len(points)), shares.min(axis=2).argmax(axis=1)
    return corners[near[best]], shares[best]
