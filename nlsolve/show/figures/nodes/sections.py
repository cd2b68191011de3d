"""Triangles on a cloud of nodes: the walls they leave free, and straight sections through nodal values.

N nodes, E edges; `rows` are nodes of `fields` at one time, see `nlsolve.results.columns`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd

from nlsolve.results.states.triangles import boundaries, outside_material
from nlsolve.series import Array
from nlsolve.show import plotting

NodalValue = Literal["u", "v", "exx", "eyy", "exy", "rate", "viscosity", "sxx", "syy", "sxy", "pressure"]
"""The columns of `fields` that figures show."""

POSITIVE = ("rate", "viscosity")
"""Those of them that have no sign."""


def triangulate(rows: pd.DataFrame, value: Array | None = None) -> plotting.Triangulation:
    """Delaunay triangles of the cloud. Masked: those between nodes of one boundary group (holes, and slivers along the
    hull), those without area, and those with a node whose value is not finite."""
    x, y = rows["x"].to_numpy(float), rows["y"].to_numpy(float)
    triangulation = plotting.Triangulation(x, y)
    corners = triangulation.triangles
    outside = outside_material(np.stack([x, y], axis=1), boundaries(rows), corners)
    unknown = ~np.isfinite(value[corners]).all(axis=1) if value is not None else np.zeros(len(corners), dtype=bool)
    triangulation.set_mask(outside | unknown)
    return triangulation


def outline(triangulation: plotting.Triangulation) -> Array:
    """Edges of a single unmasked triangle, shape (E, 2, 2): the walls."""
    corners = triangulation.get_masked_triangles()
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    pairs, counts = np.unique(edges, axis=0, return_counts=True)
    return np.stack([triangulation.x, triangulation.y], axis=1)[pairs[counts == 1]]


def slice_triangles(
    triangulation: plotting.Triangulation, along: Array, across: Array, value: Array
) -> tuple[Array, Array]:
    """The piecewise linear interpolant of nodal values on the line across = 0: places and values, NaN between pieces.

    Every crossed triangle contributes its straight piece, so the result is exact whatever the resolution of the cloud;
    sampling would miss the thin layer at a tool.
    """
    corners = triangulation.get_masked_triangles()
    start, end = corners, np.roll(corners, -1, axis=1)
    a, b = across[start], across[end]
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(a == b, np.where(a == 0, 0.0, np.nan), a / (a - b))
    fraction[(fraction < 0) | (fraction > 1)] = np.nan
    crossed = np.isfinite(fraction).sum(axis=1) >= 2
    start, end, fraction = start[crossed], end[crossed], fraction[crossed]
    place = along[start] + fraction * (along[end] - along[start])
    height = value[start] + fraction * (value[end] - value[start])
    if not len(place):
        return np.empty(0), np.empty(0)
    rows = np.arange(len(place))
    first, last = np.nanargmin(place, axis=1), np.nanargmax(place, axis=1)
    pieces = sorted(
        zip(place[rows, first], place[rows, last], height[rows, first], height[rows, last], strict=True),
        key=lambda piece: (piece[0], piece[1]),
    )
    gap = 1e-9 * float(np.ptp(along))
    places, heights = [pieces[0][0]], [pieces[0][2]]
    for left, right, left_height, right_height in pieces:
        if left > places[-1] + gap:
            places += [np.nan, left]
            heights += [np.nan, left_height]
        if right > places[-1] + gap:
            places.append(right)
            heights.append(right_height)
    return np.array(places), np.array(heights)
