"""Where further nodes of a wall lie: in the middle of its edges, on the curve through the nodes around.

    x = Σ_k w_k x_k,   w : Lagrange's cubic through the two nodes of the edge and the two beside it, at its middle

over the lengths of the chords (of fourth order on a smooth wall: Dyn, Levin & Gregory 1987 for equal ones). At a corner
the edge itself is the wall.
"""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.triangulation import side_keys
from nlsolve.series import Array, Indices

CORNER = float(np.cos(np.pi / 4.0))
"""Cosine of the turning between two edges of a wall from which there is a corner between them."""


def wall_edges(cloud: Cloud, corners: Indices) -> Indices:
    """The edges of walls, each with the node before and the node behind it, (E, 4): before, first, second, behind.

    They are the edges of triangles in the flow that no other such triangle shares. A triangle with all corners in one
    group, such as between the nodes of a tool, is none in the flow. Where these edges do not pass every node of the
    boundary twice the way of the walls is not known, and there are none.

    corners : of the Delaunay triangles of the cloud, (T, 3).
    """
    nothing = np.empty((0, 4), dtype=int)
    in_flow = np.ones(len(corners), dtype=bool)
    for group in cloud.boundaries.values():
        member = np.zeros(len(cloud.nodes), dtype=bool)
        member[group] = True
        in_flow &= ~member[corners].all(axis=1)
    keys = np.sort(side_keys(corners[in_flow], len(cloud.nodes)))
    new = np.append(np.diff(keys, prepend=-1) > 0, True)
    alone = keys[new[:-1] & new[1:]]  # unlike the one before and the one behind it
    edges = np.stack(np.divmod(alone, len(cloud.nodes)), axis=1)
    edges = edges[cloud.on_boundary[edges].all(axis=1)]
    if not (np.bincount(edges.ravel(), minlength=len(cloud.nodes)) == 2 * cloud.on_boundary).all():
        return nothing
    ends = np.concatenate([edges, edges[:, ::-1]])
    neighbours = np.zeros((len(cloud.nodes), 2), dtype=int)
    neighbours[cloud.boundary] = ends[np.argsort(ends[:, 0], kind="stable"), 1].reshape(-1, 2)
    first, second = edges.T
    before, behind = (neighbours[end].sum(axis=1) - other for end, other in ((first, second), (second, first)))
    return np.stack([before, first, second, behind], axis=1)


def middles(nodes: Array, edges: Indices) -> Array:
    """The points (E, 2) of the walls in the middle of `edges` (E, 4)."""
    chords = np.diff(nodes[edges], axis=1)  # (E, 3, 2)
    lengths = np.linalg.norm(chords, axis=2)
    turning = np.einsum("eca,eca->ec", chords[:, :2], chords[:, 1:]) / (lengths[:, :2] * lengths[:, 1:])
    straight = (turning < CORNER).any(axis=1)
    weights = cubic_weights(lengths)
    weights[straight] = [0.0, 0.5, 0.5, 0.0]
    places: Array = np.einsum("ek,eka->ea", weights, nodes[edges])
    return places


def cubic_weights(lengths: Array) -> Array:
    """w (E, 4) of the cubic through four points at distances `lengths` (E, 3), in the middle of the second one."""
    at = np.cumsum(np.pad(lengths, ((0, 0), (1, 0))), axis=1)
    middle = 0.5 * (at[:, 1] + at[:, 2])
    weights = np.ones_like(at)
    for k in range(4):
        for other in set(range(4)) - {k}:
            weights[:, k] *= (middle - at[:, other]) / (at[:, k] - at[:, other])
    return weights
