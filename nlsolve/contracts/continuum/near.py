"""min_j |x_i − x_j| of moving nodes, from a few that were near each one before the motion (lists of Verlet 1967)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from nlsolve.series import Array, Indices

LISTED = 8
"""Nodes that are listed around each one."""


@dataclass(frozen=True)
class Near:
    """The nodes that are near each of N nodes.

    nodes : (N, 2) [mm].
    listed : (N, k), other nodes near each one.
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
        near = cls(nodes, np.zeros((len(nodes), count), np.intp), nothing, nothing.copy())
        return near._filled(np.arange(len(nodes)), tree) if count else near

    def moved_to(self, nodes: Array, tree: Callable[[], scipy.spatial.cKDTree]) -> Near:
        """The same for the nodes at other places (N, 2); their tree is asked about those whose list may be too short.

        |x_i − x_j| ≥ r_i − |δx_i| − max_j |δx_j| for all j that are not listed.
        """
        steps = np.linalg.norm(nodes - self.nodes, axis=1)
        reach = self.reach - steps - steps.max(initial=0.0)
        x, y = np.ascontiguousarray(nodes.T)
        squared = (x[self.listed] - x[:, None]) ** 2 + (y[self.listed] - y[:, None]) ** 2
        distance = np.sqrt(squared.min(axis=1, initial=np.inf))
        short = np.flatnonzero(~(distance < reach) & np.isfinite(reach))
        if not len(short):
            return Near(nodes, self.listed, reach, distance)
        return Near(nodes, self.listed.copy(), reach, distance)._filled(short, tree())

    def _filled(self, which: Indices, tree: scipy.spatial.cKDTree) -> Near:
        """These, still in nobody's hands, with what the tree finds for the nodes `which`."""
        count = self.listed.shape[1]
        distance, index = tree.query(
            self.nodes[which], np.arange(2, count + 2)
        )  # the nearest of all is the node itself
        self.listed[which], self.distance[which] = index, distance[:, 0]
        self.reach[which] = distance[:, -1] if count < len(self.nodes) - 1 else np.inf
        return self
