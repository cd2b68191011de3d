"""A cloud with more nodes: in the middle of the edges of its triangulation, those of curved walls on the curve; or
those that a discretizer adds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import edges_of, subdivided
from nlsolve.contracts.continuum.walls import middles, wall_edges
from nlsolve.series import Array, Indices


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
        return np.concatenate([values, carried(self.coarser, self.cloud)(values)[len(values) :]])


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


def inner_edges(cloud: Cloud) -> Indices:
    """The edges of the Delaunay triangulation with a node inside, (E, 2). Across a hole both ends are at its wall."""
    edges = edges_of(cloud.triangulation)
    return edges[~cloud.on_boundary[edges].all(axis=1)]


def enriched(cloud: Cloud, edges: Indices) -> Enriched:
    """The cloud with a node in the middle of each of these edges (E, 2); the cloud itself without any."""
    return (
        _with_nodes(cloud, edges, cloud.nodes[edges].mean(axis=1), cloud.boundaries)
        if len(edges)
        else Enriched(cloud, edges)
    )


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
    """Values (N, 2) at the nodes `here` -> at the nodes `there`: linear between nodes, the nearest beyond them."""
    triangles = scipy.spatial.Delaunay(here.nodes)
    nearest = here.tree.query(there.nodes)[1]

    def values(at_nodes: Array) -> Array:
        between = scipy.interpolate.LinearNDInterpolator(triangles, at_nodes)(there.nodes)
        return np.where(np.isnan(between), at_nodes[nearest], between)

    return values
