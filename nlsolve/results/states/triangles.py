"""Triangles on the nodes of a flow: those of the material, and the linear interpolant of nodal values on them.

N nodes, T triangles, P points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from nlsolve.series import Array

FLAT = 1e-12
"""Area of a triangle, over that of the cloud, below which it has none."""

NUDGE = 1e-9
"""How far outside of the triangles a point may lie by rounding, as a part of the width of the cloud."""


def boundaries(rows: pd.DataFrame) -> NDArray[Any]:
    """Boundary group of every node, (N,) words; empty inside, also where a CSV file came back with NaN."""
    return rows["boundary"].astype(object).fillna("").astype(str).to_numpy()


def outside_material(nodes: Array, groups: NDArray[Any], corners: NDArray[Any]) -> NDArray[np.bool_]:
    """True for triangles (T,) between nodes of one boundary group (holes, and slivers along the hull), and for those
    without area.

    nodes, groups : (N, 2) [mm] and (N,); corners : (T, 3).
    """
    (x, y), group = nodes.T, groups[corners]
    hole = (group[:, 0] != "") & (group == group[:, :1]).all(axis=1)
    (ax, bx, cx), (ay, by, cy) = x[corners].T, y[corners].T
    area = np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    flat: NDArray[np.bool_] = area <= FLAT * np.ptp(x) * np.ptp(y)
    return hole | flat


class Material:
    """The Delaunay triangles of the nodes of `fields` at one time that lie in the material.

    nodes : (N, 2) [mm]; corners : (T, 3), counter-clockwise.
    """

    def __init__(self, rows: pd.DataFrame) -> None:
        self.nodes = rows[["x", "y"]].to_numpy(float)
        self._all = scipy.spatial.Delaunay(self.nodes)
        self._kept = ~outside_material(self.nodes, boundaries(rows), self._all.simplices)
        self.corners = self._all.simplices[self._kept]

    def interpolant(self, points: Array) -> tuple[Array, NDArray[Any]]:
        """Barycentric coordinates (P, 3) of points (P, 2) and the corners (P, 3) of their triangles: Σ_k λ_k f(x_k) is
        the piecewise linear interpolant of f, exact for linear f. NaN for a point outside of all triangles.
        """
        found = self._found(points)
        lost = np.flatnonzero(found < 0)
        if len(lost) and len(self.corners):  # on an edge of the material, and beside it by rounding
            centres = self.nodes[self.corners].mean(axis=1)
            towards = centres[scipy.spatial.cKDTree(centres).query(points[lost])[1]] - points[lost]
            length = np.linalg.norm(towards, axis=1, keepdims=True)
            step = NUDGE * float(np.ptp(self.nodes, axis=0).max()) / np.where(length > 0.0, length, 1.0)
            found[lost] = self._found(points[lost] + step * towards)
        affine = self._all.transform[found]
        first = np.einsum("pij,pj->pi", affine[:, :2], points - affine[:, 2])
        weights = np.concatenate([first, 1.0 - first.sum(axis=1, keepdims=True)], axis=1)
        weights[found < 0] = np.nan
        return weights, self._all.simplices[found]

    def _found(self, points: Array) -> NDArray[Any]:
        """The triangle of the material that each point lies in, −1 for none."""
        found = self._all.find_simplex(points)
        return np.where((found >= 0) & self._kept[found], found, -1)
