"""A cloud with triangles of six nodes: the corners are nodes of a scene, the others lie in the middles of edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from nlsolve.plugin import Cloud, SolveError, Status, subdivided, wall_edges, wall_middles
from nlsolve_discretizers.elements import functions
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.triangles import Triangles


@dataclass(frozen=True)
class Samples:
    """x = Σ_i φ_i x_i at the same points L of every triangle: point after point of one triangle, triangles in order.

    points : x, (T, P, 2) [mm].
    sizes : |∂x/∂(L_2, L_3)|, twice the area of a triangle whose edges are straight, (T, P) [mm²].
    gradient : ∇φ, for T P targets.
    """

    points: np.ndarray
    sizes: np.ndarray
    gradient: Gradient


@dataclass(frozen=True)
class Mesh(Cloud):
    """A cloud of the nodes of triangles.

    elements : the nodes of each, (T, 6), in the order of `functions`.
    patch : the number of the patch of each, (T,): two neighbours, or a few more.
    """

    elements: np.ndarray
    patch: np.ndarray

    @classmethod
    def of(cls, cloud: Cloud) -> Mesh:
        """The triangles of a cloud, with a node in the middle of each edge.

        The middle of an edge on a wall lies on the curve through the nodes around. Raises SolveError (bad cloud).
        """
        triangles = Triangles.of(cloud)
        (ends, beside), count = triangles.edges, len(cloud.nodes)

        def number(pairs: np.ndarray) -> np.ndarray:
            """Which edges these are, by their two nodes (…, 2)."""
            found: np.ndarray = np.searchsorted(ends @ [count, 1], np.sort(pairs, axis=-1) @ [count, 1])
            return found

        middles, walls = cloud.nodes[ends].mean(axis=1), wall_edges(cloud, triangles.whole)
        middles[number(walls[:, 1:3])] = wall_middles(cloud.nodes, walls)
        outer = (beside[:, 1] < 0) & cloud.on_boundary[ends].all(axis=1)
        elements = np.column_stack([triangles.corners, count + number(triangles.corners[:, functions.EDGES])])
        patch = _without_single_ones(triangles.patch, beside[beside[:, 1] >= 0])
        nodes, groups = np.concatenate([cloud.nodes, middles]), _with_middles(cloud, ends, outer)
        before = subdivided(triangles.whole, ends, count)
        return cls(nodes, groups, elements, patch, triangles_before=before, between=ends)

    def samples(self, at: np.ndarray) -> Samples:
        """Places, sizes and gradients at points L (P, 3). Raises SolveError (bad cloud) if a triangle is turned inside
        out there.
        """
        nodes, slopes = self.nodes[self.elements], functions.slopes(at)
        points = functions.values(at) @ nodes
        along, across = (np.einsum("pi,tia->atp", slopes[..., k], nodes) for k in (0, 1))
        sizes = along[0] * across[1] - along[1] * across[0]
        if not (sizes > 0.0).all():
            x, y = points[~(sizes > 0.0)][0]
            raise SolveError(
                Status.BAD_CLOUD,
                f"a triangle of degree 2 is turned inside out at ({x:.6g}, {y:.6g}): use finer nodes at curved walls, "
                "and linear triangles (delaunay) where nodes move far",
            )
        inverse = np.array([[across[1], -across[0]], [-along[1], along[0]]]) / sizes  # ∂(L_2, L_3)/∂(x, y)
        both = np.einsum("pik,katp->atpi", slopes, inverse)
        near = np.repeat(self.elements, len(at), axis=0)
        return Samples(points, sizes, Gradient(near, both.reshape(2, len(near), -1)))


def _without_single_ones(patch: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """`patch` (T,), with each triangle that is alone joined to the first of its neighbours that are not.

    sides : the triangles on both sides of inner edges, (E, 2).
    """
    alone = np.bincount(patch)[patch] == 1
    both = np.concatenate([sides, sides[:, ::-1]])
    single, neighbour = both[alone[both[:, 0]] & ~alone[both[:, 1]]].T
    first = np.arange(len(patch))
    first[single] = len(patch)
    np.minimum.at(first, single, neighbour)
    joined = patch[first]
    return (np.cumsum(np.bincount(joined) > 0) - 1)[joined]


def _with_middles(cloud: Cloud, ends: np.ndarray, outer: np.ndarray) -> Mapping[str, np.ndarray]:
    """The groups of the boundary with the middles of the `outer` ones of the edges between `ends` (E, 2).

    A middle is in the groups that both ends are in; where there are none, the edge begins at a corner between two
    walls, and it is in the one that is named last: scenes name first the wall that a corner belongs to.
    """
    groups, rest = dict(cloud.boundaries), outer.copy()

    def add(name: str, edges: np.ndarray) -> None:
        groups[name] = np.concatenate([groups[name], len(cloud.nodes) + np.flatnonzero(edges)])

    for name, group in cloud.boundaries.items():
        shared = outer & np.isin(ends, group).all(axis=1)
        add(name, shared)
        rest &= ~shared
    for name in reversed(list(cloud.boundaries)):
        chosen = rest & np.isin(ends, cloud.boundaries[name]).any(axis=1)
        add(name, chosen)
        rest &= ~chosen
    return groups
