"""The Delaunay triangles of a cloud: their edges' midpoints, and merged pairs of them as volume points.

The mean of div v over a patch of two linear triangles is taken at about one patch per node; a volumetric penalty on
every triangle or strain point would lock. S_θ = −A_i⁻¹ B_θᵀ A, the conservative partner of B_θ, keeps the penalty
semi-definite, so that no λ can make the tangent singular, and a constant pressure exerts no force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import Delaunay, QhullError

from nlsolve import Cloud, SolveError, Status


@dataclass(frozen=True)
class Triangles:
    """Triangles (T, 3) of a cloud, counter-clockwise, without those that span a hole or lie along a wall."""

    cloud: Cloud
    corners: np.ndarray

    @classmethod
    def of(cls, cloud: Cloud) -> Triangles:
        """Delaunay's triangulation, less the triangles whose three nodes lie on one and the same boundary."""
        try:
            corners = Delaunay(cloud.nodes).simplices
        except QhullError as error:
            raise SolveError(Status.BAD_CLOUD, "the nodes lie on one line: they span no triangles") from error
        group = np.zeros(len(cloud.nodes), dtype=int)
        for number, members in enumerate(cloud.boundaries.values(), start=1):
            group[members] = number
        groups = group[corners]
        along_wall = (groups[:, 0] > 0) & (groups[:, 0] == groups[:, 1]) & (groups[:, 0] == groups[:, 2])
        triangles = cls(cloud, corners[~along_wall])
        if np.bincount(triangles.corners.ravel(), minlength=len(group))[cloud.interior].min(initial=1) == 0:
            raise SolveError(Status.BAD_CLOUD, "a node belongs to no triangle of the cloud: it coincides with another")
        return triangles

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of each triangle [mm²]."""
        a, b, c = (self.cloud.nodes[self.corners[:, i]] for i in range(3))
        return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))

    @cached_property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (E, 2), each once, smaller node first, and for each the triangles beside it (E, 2), −1 for none."""
        sides = np.sort(self.corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        owner = np.repeat(np.arange(len(self.corners)), 3)
        key = sides[:, 0] * len(self.cloud.nodes) + sides[:, 1]
        order = np.argsort(key, kind="stable")
        first = np.flatnonzero(np.diff(key[order], prepend=-1))
        beside = np.full((len(first), 2), -1)
        beside[:, 0] = owner[order[first]]
        twice = np.diff(np.append(first, len(key))) == 2
        beside[twice, 1] = owner[order[first[twice] + 1]]
        return sides[order[first]], beside

    def midpoints(self) -> np.ndarray:
        """Midpoints of the edges that have an end inside, (M, 2): the stress points between neighbours."""
        ends, _ = self.edges
        inner = ~self.cloud.on_boundary[ends].all(axis=1)
        return self.cloud.nodes[ends[inner]].mean(axis=1)

    def pairs(self) -> np.ndarray:
        """Number of the patch of each triangle, (T,): neighbours merged across their relatively longest common edges.

        Locally dominant matching (Preis 1999): rounds in which every edge that is the best one left for both its
        triangles merges them. Edge lengths are compared to six digits and ties broken by number, so that rounding does
        not change the patches.
        """
        ends, beside = self.edges
        inner = np.flatnonzero(beside[:, 1] >= 0)
        sides = beside[inner]
        length = np.linalg.norm(self.cloud.nodes[ends[inner, 0]] - self.cloud.nodes[ends[inner, 1]], axis=1)
        merit = np.round(length / np.sqrt(self.areas[sides].mean(axis=1)), 6)
        rank = np.empty(len(inner), dtype=int)
        rank[np.lexsort((-np.arange(len(inner)), merit))] = np.arange(len(inner))
        patch = np.arange(len(self.corners))
        free = np.ones(len(self.corners), dtype=bool)
        while len(sides):
            best = np.full(len(self.corners), -1)
            np.maximum.at(best, sides.ravel(), np.repeat(rank, 2))
            dominant = (best[sides] == rank[:, None]).all(axis=1)
            merged = sides[dominant]
            patch[merged[:, 1]] = patch[merged[:, 0]]
            free[merged.ravel()] = False
            left = free[sides].all(axis=1)
            sides, rank = sides[left], rank[left]
        return np.unique(patch, return_inverse=True)[1]

    def volumetric(self) -> tuple[Any, Any, np.ndarray]:
        """B_θ (L, 2N), S_θ (2F, L) and the centres (L, 2) of the patches."""
        nodes, corners, areas = self.cloud.nodes, self.corners, self.areas
        # 2 A ∂/∂x of the linear hat function of a corner is the difference of y across the opposite side.
        ahead, behind = nodes[corners[:, [1, 2, 0]]], nodes[corners[:, [2, 0, 1]]]
        flux = 0.5 * np.stack([ahead[..., 1] - behind[..., 1], behind[..., 0] - ahead[..., 0]], axis=-1)  # (T, 3, 2)
        patch = self.pairs()
        count = int(patch.max()) + 1
        columns = 2 * corners[:, :, None] + np.arange(2)
        rows = np.broadcast_to(patch[:, None, None], columns.shape)
        # Patch area times mean divergence: the net flux out of each patch.
        net_flux = sp.csr_array((flux.ravel(), (rows.ravel(), columns.ravel())), shape=(count, 2 * len(nodes)))
        patch_area = np.bincount(patch, areas, count)
        node_area = np.bincount(corners.ravel(), np.repeat(areas / 3.0, 3), len(nodes))
        free = np.stack([2 * self.cloud.interior, 2 * self.cloud.interior + 1], axis=1).ravel()
        dilatation = sp.diags_array(1.0 / patch_area) @ net_flux
        per_area = sp.diags_array(-1.0 / np.repeat(node_area[self.cloud.interior], 2))
        pressure_force = per_area @ net_flux[:, free].T
        centroids = nodes[corners].mean(axis=1)
        centres = np.stack([np.bincount(patch, areas * c, count) / patch_area for c in centroids.T], axis=1)
        return dilatation.tocsr(), pressure_force.tocsr(), centres
