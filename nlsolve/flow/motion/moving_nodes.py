"""dx/dt = V(x, t) : the motion of nodes with the material.

N nodes. Boundary nodes follow the exact motion of their wall; all others are integrated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.terms import NodeMotion
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array

LEAST_QUALITY = 0.05
"""Smallest distance to the nearest node, over that at t = 0, with which a moving cloud goes on."""

LARGEST_SHIFT = 0.1
"""Largest shift of a node in one increment, over its own spacing."""

NEIGHBOURS = 8


class Neighbourhoods:
    """The k nodes j of a cloud that are nearest to each node i, and their distances d_ij [mm], both (N, k)."""

    def __init__(self, cloud: Cloud) -> None:
        distance, near = scipy.spatial.cKDTree(cloud.nodes).query(cloud.nodes, min(NEIGHBOURS + 1, len(cloud.nodes)))
        self.distance, self.near = distance[:, 1:], near[:, 1:]

    def parted(self, nodes: Array) -> float:
        """max_ij | |x_i − x_j| − d_ij | / min_j d_ij of nodes (N, 2) that were d_ij apart: 0 for a rigid motion."""
        distance = np.linalg.norm(nodes[:, None] - nodes[self.near], axis=2)
        return float((np.abs(distance - self.distance) / self.distance[:, :1]).max())


class MovingNodes:
    """Nodes that move with the material, their spacing, and their operators.

    quality : smallest distance to the nearest node over that of the same node at t = 0, so far.
    searches : how often neighbours were found, so far.

    Shifted nodes are not material points any more; markers are.
    """

    def __init__(
        self, scene: Geometry, motion: NodeMotion, increment: float, discretizer: Discretizer, initial: Cloud
    ) -> None:
        self.scene, self.motion, self.increment = scene, motion, increment
        self.discretizer, self.initial = discretizer, initial
        self.quality = 1.0
        self.searches = 0
        self._operators: Operators | None = None
        self._found: Neighbourhoods | None = None

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """The operators of the moved cloud. The neighbours found last are used again while none has parted by more than
        the `skin` (lists of Verlet 1967) and while the discretizer can keep them.

        Raises SolveError (bad cloud) when supports fail.
        """
        operators, last = None, self._operators
        if last is not None and self._found is not None and self._found.parted(cloud.nodes) <= self.motion.skin:
            operators = self.discretizer.moved(last, cloud)
        if operators is None:
            if last is None or last.neighbours is None:
                operators = self.discretizer.operators(cloud, volumetric)
            else:
                operators = self.discretizer.renewed(last, cloud)
            keeps = self.motion.skin and operators.neighbours is not None
            self._found = Neighbourhoods(cloud) if keeps else None
            self.searches += 1
        self._operators = operators
        return operators

    def move(self, cloud: Cloud, velocity: Array, before: Array | None, time: float) -> tuple[Cloud, Any]:
        """x_{k+1} = x_k + Δt (3/2 v_k − 1/2 v_{k−1}) (Adams-Bashforth), then shifted if the motion asks for it.

        velocity, before : v_k and v_{k−1} of all nodes, shape (N, 2) [mm/s]; None before the first increment.
        Returns the cloud at `time` [s] and, when it was shifted, the matrix (N, N) that gives the change of nodal
        values: values interpolated at the shifted nodes less those interpolated at the unshifted ones, so that a small
        shift smooths little.
        Raises SolveError (bad cloud) when two nodes have come too close.
        """
        step = velocity if before is None else 1.5 * velocity - 0.5 * before
        nodes = cloud.nodes + self.increment * step
        nodes[self.initial.boundary] = self.scene.boundary_position(self.initial, time)
        moved, carry = cloud.moved_to(nodes), None
        if self.motion.shifting:
            moved = moved.moved_to(nodes + shifts(moved, self.initial.nearest_distance, self.motion.shifting))
            values = self.discretizer.values
            carry = values(nodes, moved.nodes) - values(nodes, nodes)
        self._watch(moved, time)
        return moved, carry

    def _watch(self, cloud: Cloud, time: float) -> None:
        ratio = cloud.nearest_distance / self.initial.nearest_distance
        worst = int(ratio.argmin())
        self.quality = min(self.quality, float(ratio[worst]))
        if self.quality < LEAST_QUALITY:
            x, y = cloud.nodes[worst]
            raise SolveError(
                Status.BAD_CLOUD,
                f"at t = {time:.6g} s the node at ({x:.6g}, {y:.6g}) is {self.quality:.2g} times as far from its "
                "neighbour as at t = 0: raise motion.shifting, shorten time.increment, or use "
                'motion = { nodes = "fixed", markers = true }',
            )


def shifts(cloud: Cloud, spacing: Array, fraction: float) -> Array:
    """δx_i = fraction · Σ_j (h_ij − |x_i − x_j|)₊ e_ij, shape (N, 2) [mm]; zero on the boundary.

    e_ij points from j to i, h_ij is the mean of the spacings (N,) wanted at the two: nodes that come nearer than at
    t = 0 push each other away, others stay. Repulsion of Persson & Strang (2004), used as particle shifting (Lind, Xu,
    Stansby & Rogers 2012).
    """
    found = Neighbourhoods(cloud)
    distance, near = found.distance, found.near
    push = np.maximum(0.5 * (spacing[:, None] + spacing[near]) - distance, 0.0) / distance
    shift = fraction * (push[..., None] * (cloud.nodes[:, None] - cloud.nodes[near])).sum(axis=1)
    shift[cloud.boundary] = 0.0
    most = LARGEST_SHIFT * spacing
    length = np.maximum(np.linalg.norm(shift, axis=1), np.finfo(float).tiny)
    return shift * np.minimum(1.0, most / length)[:, None]
