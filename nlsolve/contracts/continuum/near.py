"""min_j |x_i − x_j| of moving nodes, from a few that were near each one before the motion (lists of Verlet 1967)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from nlsolve.series import Array, Indices

LISTED = 8
"""Nodes that are listed around each one."""

AHEAD = 10
"""Further moves like the last for which a list should serve where the tree of the nodes is built anyway."""


@dataclass(frozen=True)
class Near:
    """The nodes that are near each of N nodes.

    nodes : (N, 2) [mm].
    listed : (k, N), other nodes near each one.
    reach : (N,) [mm], every node that is not listed is at least so far away.
    distance : (N,) [mm], to the nearest node; infinite for a single one.
    """

    nodes: Array
    listed: Indices
    reach: Array
    distance: Array

    @classmethod
    def of(cls, nodes: Array, tree: scipy.spatial.cKDTree) -> Near:
        """The nearest nodes by the tree of all."""
        count = min(LISTED, len(nodes) - 1)
        nothing = np.full(len(nodes), np.inf)
        near = cls(nodes, np.zeros((count, len(nodes)), np.intp), nothing, nothing.copy())
        return near._filled(np.arange(len(nodes)), tree) if count else near

    def moved_to(self, nodes: Array, tree: Callable[[], scipy.spatial.cKDTree]) -> Near:
        """The same for the nodes at other places (N, 2). Where the list of one may be too short, their tree is asked
        about all whose lists may be so within `AHEAD` such moves.

        |x_i − x_j| ≥ r_i − |δx_i| − max_j |δx_j| for all j that are not listed; the maximum is over those that are near
        enough to come so near.
        """
        x, y = np.ascontiguousarray(nodes.T)
        dx, dy = x - self.nodes[:, 0], y - self.nodes[:, 1]
        steps = np.sqrt(dx * dx + dy * dy)
        within = float(np.max(self.reach, where=np.isfinite(self.reach), initial=0.0)) + steps.max(initial=0.0)
        lost = steps + largest_near(self.nodes, steps, self.nodes, within)
        reach = self.reach - lost
        dx, dy = x.take(self.listed) - x, y.take(self.listed) - y
        distance = np.sqrt((dx * dx + dy * dy).min(axis=0, initial=np.inf))
        limited = np.isfinite(reach)
        if not (limited & ~(distance < reach)).any():
            return Near(nodes, self.listed, reach, distance)
        soon = np.flatnonzero(limited & ~(distance + AHEAD * lost < reach))
        return Near(nodes, self.listed.copy(), reach, distance)._filled(soon, tree())

    def _filled(self, which: Indices, tree: scipy.spatial.cKDTree) -> Near:
        """These, still in nobody's hands, with what the tree finds for the nodes `which`."""
        count = len(self.listed)
        distance, index = tree.query(
            self.nodes[which], np.arange(2, count + 2)
        )  # the nearest of all is the node itself
        self.listed[:, which], self.distance[which] = index.T, distance[:, 0]
        self.reach[which] = distance[:, -1] if count < len(self.nodes) - 1 else np.inf
        return self


def largest_near(places: Array, values: Array, targets: Array, within: float) -> Array:
    """An upper bound, (T,), of the `values` ≥ 0 (P,) at all `places` (P, 2) that are no farther than `within` from each
    of the `targets` (T, 2): the largest one in nine square cells around each, 0 where these are empty.
    """
    (x, y), (at_x, at_y) = places.T, targets.T
    west, south = min(x.min(), at_x.min()), min(y.min(), at_y.min())
    width, height = max(x.max(), at_x.max()) - west, max(y.max(), at_y.max()) - south
    side = max(within, max(width, height) / len(places) ** 0.5)  # no more cells than places
    if not side > 0.0:
        return np.full(len(targets), values.max(initial=0.0))

    columns, rows = int(width / side) + 3, int(height / side) + 3  # of cells, with empty ones on either side

    def cell(x: Array, y: Array) -> Indices:
        number: Indices = ((x - west) / side).astype(np.intp) * rows + ((y - south) / side).astype(np.intp)
        return number

    cells = np.zeros(columns * rows)
    np.maximum.at(cells[rows + 1 :], cell(x, y), values)
    of_three = np.maximum(np.maximum(cells[: -2 * rows], cells[rows:-rows]), cells[2 * rows :])
    of_nine: Array = np.maximum(np.maximum(of_three[:-2], of_three[1:-1]), of_three[2:])
    return of_nine[cell(at_x, at_y)]
