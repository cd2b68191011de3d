"""The nodes of a flow with the named groups of its boundary, and the closed solution of a flow at given points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from nlsolve.contracts.continuum.near import Near
from nlsolve.contracts.continuum.triangulation import doubled_areas, edges_of, found, kept, spacings
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, Indices


@dataclass(frozen=True)
class Cloud:
    """Nodes (N, 2) [mm] and the named groups of boundary nodes among them.

    Raises SolveError (bad cloud) when there is none, a coordinate is not finite, or two nodes coincide.
    """

    nodes: Array
    boundaries: Mapping[str, Indices]
    near_before: Near | None = field(default=None, repr=False, compare=False, kw_only=True)
    """What was near each of the same nodes before they moved here."""

    triangles_before: Indices | None = field(default=None, repr=False, compare=False, kw_only=True)
    """Triangles (T, 3) of these nodes, from which a few flips of edges lead to Delaunay's."""

    between: Indices | None = field(default=None, repr=False, compare=False, kw_only=True)
    """The two nodes (E, 2) in the middle of which each of the last E nodes lies, on a wall on its curve."""

    def __post_init__(self) -> None:
        if not len(self.nodes):
            raise SolveError(Status.BAD_CLOUD, "there are no nodes")
        if not np.isfinite(self.nodes).all():
            bad = int(np.flatnonzero(~np.isfinite(self.nodes).all(axis=1))[0])
            raise SolveError(Status.BAD_CLOUD, f"node {bad} has a coordinate that is not a finite number")
        if self._are_corners():
            return
        spread = max(float(np.ptp(x)) for x in self.nodes.T)
        nearest = self.nearest_distance
        first = int(nearest.argmin())
        if not nearest[first] > 1e-9 * spread:
            x, y = self.nodes[first]
            raise SolveError(Status.BAD_CLOUD, f"two nodes coincide at ({x:.6g}, {y:.6g}): remove one of them")

    def _are_corners(self) -> bool:
        """Whether each node is the corner of a known triangle and all of these are upright, so that no two coincide."""
        corners = self.triangles_before
        if corners is None:
            return False
        all_are = (np.bincount(corners.ravel(), minlength=len(self.nodes)) > 0).all()
        return bool(all_are and (doubled_areas(*np.ascontiguousarray(self.nodes.T), *corners.T) > 0.0).all())

    @cached_property
    def nearest_distance(self) -> Array:
        """Distance of every node to its nearest neighbour, shape (N,) [mm]; infinite for a single one."""
        return self.near.distance if self.near_before else self.tree.query(self.nodes, [2])[0][:, 0]

    @cached_property
    def near(self) -> Near:
        """The nodes that are near each node."""
        before = self.near_before
        if before is None or len(before.nodes) != len(self.nodes):
            return Near.of(self.nodes, self.tree)
        return before.moved_to(self.nodes, lambda: self.tree)

    @cached_property
    def tree(self) -> scipy.spatial.cKDTree:
        """The tree of the nodes, for whoever looks for the nearest of them."""
        return scipy.spatial.cKDTree(self.nodes)

    @cached_property
    def triangulation(self) -> Indices:
        """Delaunay's triangulation of all nodes, shape (T, 3), counter-clockwise: holes and hollows of the flow have
        triangles too. Raises SolveError (bad cloud) if the nodes lie on one line.
        """
        before = self.triangles_before
        return found(self.nodes) if before is None else self.triangulated_from(before)

    @cached_property
    def edges(self) -> Indices:
        """The edges (E, 2) of the triangulation, each once, the smaller node first, in the order of their nodes."""
        return edges_of(self.triangulation)

    @cached_property
    def spacing(self) -> Array:
        """The median length of the edges that meet at each node, shape (N,) [mm]; infinite where none does."""
        return spacings(self.nodes, self.edges)

    def triangulated_from(self, corners: Indices) -> Indices:
        """Delaunay's triangulation (T, 3) by flips in another one; where these do not lead there it is found anew."""
        whole = kept(corners, self.nodes, self.walls)
        return found(self.nodes) if whole is None else whole

    @cached_property
    def walls(self) -> Indices:
        """The number of the boundary group of each node, from 1 on, 0 inside, shape (N,)."""
        numbers = np.zeros(len(self.nodes), dtype=np.intp)
        for number, group in enumerate(self.boundaries.values(), start=1):
            numbers[group] = number
        return numbers

    @cached_property
    def on_boundary(self) -> NDArray[np.bool_]:
        """True for nodes of any boundary group, shape (N,)."""
        return self.walls > 0

    @cached_property
    def interior(self) -> Indices:
        """Indices of the nodes whose velocity is unknown, shape (F,)."""
        return np.flatnonzero(~self.on_boundary)

    @cached_property
    def boundary(self) -> Indices:
        """Indices of the nodes whose velocity is prescribed, shape (N − F,)."""
        return np.flatnonzero(self.on_boundary)

    def moved_to(self, nodes: Array) -> Cloud:
        """A cloud with the same groups and other places `nodes` (N, 2) [mm]. Raises SolveError (bad cloud)."""
        return replace(self, nodes=nodes, near_before=self.near, triangles_before=None, between=None)


@dataclass(frozen=True)
class Exact:
    """A closed solution: velocity (N, 2) [mm/s] at points (N, 2), and named quantities such as the torque."""

    velocity: Array
    quantities: Mapping[str, float] = field(default_factory=dict)


def node_major(nodes: Indices) -> Indices:
    """Indices 2 i, 2 i + 1 of the velocity components of `nodes`."""
    return np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()


def hat_gradients(nodes: Array, corners: Indices) -> Array:
    """A ∇φ (T, 3, 2) [mm]: the triangles' areas times the gradients of the linear hat functions of their `corners`.

    nodes : (N, 2) [mm].
    corners : (T, 3), counter-clockwise.
    """
    (x, y), ahead, behind = np.ascontiguousarray(nodes.T), corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]
    return 0.5 * np.stack([y[ahead] - y[behind], x[behind] - x[ahead]], axis=-1)
