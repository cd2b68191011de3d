"""The largest circle inside a cloud without a node in it, beside the spacing of the nodes around it.

r / s : r is the circumradius of a Delaunay triangle whose centre lies in the flow
        s is the largest, over its corners, of the median length of the edges that meet there
"""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.flow.claims.finding import NOTHING, Finding
from nlsolve.series import Array, Indices


def largest_hole(cloud: Cloud) -> Finding:
    """The largest r/s: 0.58 where triangles are equilateral, 0.71 on a square grid, more where nodes are missing.

    A triangle lies in the flow when a corner is an inner node; where all three are at walls it may lie outside.
    """
    nodes = cloud.nodes
    corners = cloud.triangulation[~cloud.on_boundary[cloud.triangulation].all(axis=1)]
    centres = circumcentres(nodes[corners])
    radii = np.linalg.norm(nodes[corners[:, 0]] - centres, axis=1)
    ratios = radii / cloud.spacing[corners].max(axis=1)
    largest = _first_within(centres, np.argsort(-ratios, kind="stable"), nodes[corners])
    if largest is None:
        return NOTHING
    x, y = centres[largest]
    return Finding(
        float(ratios[largest]),
        f"there is no node within {radii[largest]:.3g} mm of ({x:.3g}, {y:.3g}), {ratios[largest]:.2g} times the "
        "spacing around: add nodes there",
    )


def _first_within(points: Array, order: Indices, corners: Array) -> int | None:
    """The first of `points` (P, 2), in this order, in any triangle with these corners (T, 3, 2); None without one."""
    x, y = np.moveaxis(corners, 2, 0)
    low, high = corners.min(axis=1), corners.max(axis=1)
    for number in order:
        point = points[number]
        near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
        ahead, behind = (
            (x[near] - point[0], y[near] - point[1]),
            (
                np.roll(x[near], -1, axis=1) - point[0],
                np.roll(y[near], -1, axis=1) - point[1],
            ),
        )
        if (ahead[0] * behind[1] - ahead[1] * behind[0] >= 0.0).all(axis=1).any():
            return int(number)
    return None


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
