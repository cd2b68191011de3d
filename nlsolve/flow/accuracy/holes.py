"""The largest circle inside a cloud without a node in it, beside the spacing of the nodes around it.

r / s : r is the circumradius of a Delaunay triangle whose centre lies in the flow
        s is the largest, over its corners, of the median length of the edges that meet there
"""

from __future__ import annotations

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud, Indices
from nlsolve.flow.accuracy.enrichment import edges_of
from nlsolve.flow.claims.finding import NOTHING, Finding
from nlsolve.series import Array


def largest_hole(cloud: Cloud) -> Finding:
    """The largest r/s: 0.58 where triangles are equilateral, 0.71 on a square grid, more where nodes are missing.

    A triangle lies in the flow when a corner is an inner node; where all three are at walls it may lie outside.
    """
    nodes = cloud.nodes
    triangulation = scipy.spatial.Delaunay(nodes)
    corners = triangulation.simplices
    centres = circumcentres(nodes[corners])
    at = triangulation.find_simplex(np.nan_to_num(centres, nan=np.inf))
    in_flow = ~cloud.on_boundary[corners].all(axis=1)
    inside = np.flatnonzero(in_flow & (at >= 0) & in_flow[at])
    if not len(inside):
        return NOTHING
    radii = np.linalg.norm(nodes[corners[inside, 0]] - centres[inside], axis=1)
    ratios = radii / spacings(nodes, edges_of(corners))[corners[inside]].max(axis=1)
    largest = int(ratios.argmax())
    x, y = centres[inside[largest]]
    return Finding(
        float(ratios[largest]),
        f"there is no node within {radii[largest]:.3g} mm of ({x:.3g}, {y:.3g}), {ratios[largest]:.2g} times the "
        "spacing around: add nodes there",
    )


def circumcentres(corners: Array) -> Array:
    """Centres of the circles through the corners (T, 3, 2) of triangles, (T, 2); not finite for three on a line."""
    first = corners[:, 0]
    sides = corners[:, 1:] - first[:, None]  # (T, 2, 2)
    squares = np.einsum("tsa,tsa->ts", sides, sides)
    twice = 2.0 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (sides[:, 1, 1] * squares[:, 0] - sides[:, 0, 1] * squares[:, 1]) / twice
        y = (sides[:, 0, 0] * squares[:, 1] - sides[:, 1, 0] * squares[:, 0]) / twice
    return first + np.stack([x, y], axis=1)


def spacings(nodes: Array, edges: Indices) -> Array:
    """The median length of the edges (E, 2) that meet at each node (N, 2), (N,); infinite where none does."""
    lengths = np.linalg.norm(nodes[edges[:, 0]] - nodes[edges[:, 1]], axis=1)
    ends, both = edges.T.ravel(), np.concatenate([lengths, lengths])
    order = np.lexsort((both, ends))
    counts = np.bincount(ends, minlength=len(nodes))
    middle = np.cumsum(counts) - counts + (counts - 1) // 2
    return np.where(counts > 0, both[order][np.minimum(middle, len(both) - 1)], np.inf)
