"""The Delaunay triangles of a cloud: their edges' midpoints, and merged pairs of them as volume points.

The mean of div v over a patch of two linear triangles is taken at about one patch per node; a volumetric penalty on
every triangle or strain point would lock. S_θ = −A_i⁻¹ B_θᵀ A, the conservative partner of B_θ, keeps the penalty
semi-definite, so that no λ can make the tangent singular, and a constant pressure exerts no force.

Linear triangles themselves are the smallest conservative discretisation: ∇φ of hat functions, one point a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.plugin import (
    Cloud,
    PointOperators,
    SolveError,
    Status,
    doubled_areas,
    hat_gradients,
    in_order,
    on_one_wall,
    side_keys,
)
from nlsolve_discretizers.weights.assembly import rows_times


@dataclass(frozen=True)
class Triangles:
    """Triangles (T, 3) of a cloud, counter-clockwise, without those that span a hole or lie along a wall.

    whole : Delaunay's triangulation (T′, 3), with these.
    found : the same triangles on the cloud where they were found; None if its nodes have not moved since.
    """

    cloud: Cloud
    corners: np.ndarray
    whole: np.ndarray
    found: Triangles | None = None

    @classmethod
    def of(cls, cloud: Cloud) -> Triangles:
        """Delaunay's triangulation, less the triangles whose three nodes lie on one and the same boundary.

        Raises SolveError (bad cloud) if the nodes lie on one line or a node belongs to no triangle.
        """
        return cls._of(cloud, cloud.triangulation)

    def renewed(self, cloud: Cloud) -> Triangles:
        """The triangulation of a cloud whose nodes have moved, as `of` gives it; after a small motion in less time."""
        return self._of(cloud, cloud.triangulated_from(self.whole))

    @classmethod
    def _of(cls, cloud: Cloud, whole: np.ndarray) -> Triangles:
        triangles = cls(cloud, whole[~on_one_wall(cloud.walls.take(whole.T))], whole)
        if np.bincount(triangles.corners.ravel(), minlength=len(cloud.nodes))[cloud.interior].min(initial=1) == 0:
            raise SolveError(Status.BAD_CLOUD, "a node belongs to no triangle of the cloud: it coincides with another")
        return triangles

    def moved_to(self, cloud: Cloud) -> Triangles:
        """The same triangles, edges and patches with the nodes at other places."""
        return Triangles(cloud, self.corners, self.whole, self.found or self)

    @property
    def are_upright(self) -> bool:
        """Whether every triangle is still counter-clockwise: no motion of nodes has turned one inside out."""
        return bool((self.areas > 0.0).all())

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of each triangle [mm²]."""
        return 0.5 * doubled_areas(*np.ascontiguousarray(self.cloud.nodes.T), *self.corners.T)

    @cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (E, 2), each once, smaller node first, and for each the triangles beside it (E, 2), −1 for none."""
        if self.found is not None:
            return self.found.edges
        order, key = in_order(side_keys(self.corners, len(self.cloud.nodes)))
        first = np.flatnonzero(np.diff(key, prepend=-1))
        beside = np.full((len(first), 2), -1)
        beside[:, 0] = order[first] // 3
        twice = np.diff(np.append(first, len(key))) == 2
        beside[twice, 1] = order[first[twice] + 1] // 3
        return np.stack(np.divmod(key[first], len(self.cloud.nodes)), axis=1), beside

    @cached_property
    def inner_edges(self) -> np.ndarray:
        """The edges that have an end inside, (M, 2)."""
        ends, _ = self.edges
        one, other = self.cloud.on_boundary.take(ends.T)
        return ends[~(one & other)]

    def midpoints(self) -> np.ndarray:
        """Midpoints of the inner edges, (M, 2): the stress points between neighbours."""
        return _means(self.cloud.nodes, self.inner_edges)

    @cached_property
    def patch(self) -> np.ndarray:
        """Number of the patch of each triangle, (T,): its pair where the triangles were found."""
        return self.pairs() if self.found is None else self.found.patch

    def pairs(self) -> np.ndarray:
        """Number of the patch of each triangle, (T,): neighbours merged across their relatively longest common edges.

        Locally dominant matching (Preis 1999): rounds in which every edge that is the best one left for both its
        triangles merges them. Edge lengths are compared to six digits and ties broken by number, so that rounding does
        not change the patches.
        """
        ends, beside = self.edges
        inner = np.flatnonzero(beside[:, 1] >= 0)
        (x, y), (one, other) = np.ascontiguousarray(self.cloud.nodes.T), ends[inner].T
        dx, dy = x[one] - x[other], y[one] - y[other]
        sides = inner_sides = np.ascontiguousarray(beside[inner].T)
        merit = np.sqrt(dx * dx + dy * dy) / np.sqrt(_means(self.areas, sides.T))
        rank = np.empty(len(inner), dtype=int)
        rank[::-1][in_order(np.rint(1e6 * merit[::-1]).astype(int))[0]] = np.arange(len(inner))
        patch = np.arange(len(self.corners))
        free = np.ones(len(self.corners), dtype=bool)
        while len(rank):
            best = np.full(len(self.corners), -1)
            np.maximum.at(best, sides.ravel(), np.tile(rank, 2))
            one, other = sides[:, (best[sides] == rank).all(axis=0)]
            patch[other] = patch[one]
            free[one] = free[other] = False
            left = free[sides].all(axis=0)
            sides, rank = sides[:, left], rank[left]
        patch = self._without_held_patches(patch, inner_sides)
        return (np.cumsum(np.bincount(patch) > 0) - 1)[patch]

    def _without_held_patches(self, patch: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """`patch`, with patches whose nodes all lie on walls joined to a neighbour: no unknown moves such nodes.

        sides : the triangles beside each inner edge, (2, E).
        """
        moves = ~self.cloud.on_boundary.take(self.corners.T).all(axis=0)
        while True:
            held = np.bincount(patch, moves, len(patch))[patch] == 0.0
            one, other = sides[:, held[sides[0]] != held[sides[1]]]
            if not len(one):
                return patch
            inner = held[one]
            ours = patch[np.where(inner, one, other)]
            theirs = patch[np.where(inner, other, one)]
            joined = np.arange(len(patch))
            joined[ours] = theirs
            patch = joined[patch]

    @cached_property
    def hat_gradients(self) -> np.ndarray:
        """∇ of the linear hat function of each corner times the triangle's area, (T, 3, 2) [mm]."""
        return hat_gradients(self.cloud.nodes, self.corners)

    @cached_property
    def node_areas(self) -> np.ndarray:
        """A third of the triangles around each node, (N,) [mm²]."""
        return np.bincount(self.corners.ravel(), np.repeat(self.areas / 3.0, 3), len(self.cloud.nodes))

    def centroids(self) -> np.ndarray:
        """Centroid of each triangle, (T, 2) [mm]."""
        return _means(self.cloud.nodes, self.corners)

    def diamonds(self) -> tuple[np.ndarray, np.ndarray]:
        """Midpoints (E, 2) of all edges, and a third of the triangles beside each, (E,) [mm²]: they fill the cloud."""
        ends, beside = self.edges
        areas = np.where(beside >= 0, self.areas[beside], 0.0).sum(axis=1) / 3.0
        return _means(self.cloud.nodes, ends), areas

    def patches(self) -> Patches:
        """The mean of div v over each patch."""
        corners, areas, patch = self.corners, self.areas, self.patch
        count = int(patch.max()) + 1
        columns = (2 * corners[:, :, None] + np.arange(2)).astype(np.int32)  # as all other operators have them
        rows = np.broadcast_to(patch.astype(np.int32)[:, None, None], columns.shape)
        shape = (count, 2 * len(self.cloud.nodes))
        # Patch area times mean divergence: the net flux out of each patch.
        net_flux = sp.csr_array((self.hat_gradients.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        patch_areas = np.bincount(patch, areas, count)
        dilatation = rows_times(1.0 / patch_areas, net_flux)
        centres = np.stack([np.bincount(patch, areas * c, count) / patch_areas for c in self.centroids().T], axis=1)
        return Patches(self, dilatation, net_flux, patch_areas, centres)


def _means(values: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Means over the places or numbers `index` (P, m) of `values`, by adding them in turn."""
    total = values[index[:, 0]]
    for column in index.T[1:]:
        total += values[column]
    return total / index.shape[1]


@dataclass(frozen=True)
class Patches:
    """Volume points of a triangulation: B_θ (L, 2N), its rows times the areas (L,) [mm²], and centres (L, 2) [mm]."""

    triangles: Triangles
    dilatation: Any
    net_flux: Any
    areas: np.ndarray
    centres: np.ndarray

    def strong(self) -> PointOperators:
        """S_θ = −W⁻¹ B_θᵀ A (2F, L) at the interior nodes, per area W of their material."""
        inside = self.triangles.cloud.interior
        free = np.stack([2 * inside, 2 * inside + 1], axis=1).ravel()
        per_area = -1.0 / np.repeat(self.triangles.node_areas[inside], 2)
        force = rows_times(per_area, self.net_flux.T.tocsr()[free])
        return PointOperators(self.dilatation, force, self.centres, self.areas)

    def conservative(self) -> PointOperators:
        """S_θ = −B_θᵀ A (2F, L) at the interior nodes."""
        return PointOperators.conservative(self.triangles.cloud, self.dilatation, self.centres, self.areas)
