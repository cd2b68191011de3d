"""dx/dt = V(x, t) : the motion of markers when nodes stay or are shifted.

N nodes. Markers that start on a wall follow its exact motion; all others are integrated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.series import Array

HALFWAY: dict[int, tuple[float, ...]] = {
    1: (1.0,),
    2: (1 / 2, 1 / 2),
    3: (3 / 8, 6 / 8, -1 / 8),
    4: (5 / 16, 15 / 16, -5 / 16, 1 / 16),
}
"""Weights of V at t + Δt, t, t − Δt, t − 2Δt in the polynomial through them, at t + Δt/2."""

LOST = 1.5
"""A marker that is more spacings than this away from every node, or outside their rectangle, has left the cloud."""


def halfway(velocities: Sequence[Array]) -> Array:
    """V(t + Δt/2), shape (N, 2), from V at t + Δt, t, t − Δt, t − 2Δt, as many as are known (one to four)."""
    return np.tensordot(HALFWAY[len(velocities)], np.stack(velocities), 1)


NodalField = Sequence[tuple[Array, Array]]
"""Terms of a velocity field, each given by nodes (N, 2) and the velocities (N, 2) there."""


def runge_kutta(
    places: Array,
    start: NodalField,
    middle: NodalField,
    end: NodalField,
    increment: float,
    at: Callable[[NodalField, Array], Array],
) -> Array:
    """x(t + Δt) of places (T, 2) by the classical method; `at(V, x)` takes a nodal field to places x (T, 2)."""
    first = at(start, places)
    second = at(middle, places + 0.5 * increment * first)
    third = at(middle, places + 0.5 * increment * second)
    fourth = at(end, places + increment * third)
    return places + increment / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


class Markers:
    """Material points that start at the nodes and are carried by the velocities of fixed or shifted nodes.

    Within an increment velocities are interpolated in time. At fixed nodes the polynomial goes through up to four
    velocities, so that places are of fourth order in Δt once three increments have passed. At moving nodes it is linear
    and places are of second order, like the motion of the nodes.
    """

    def __init__(
        self, scene: Geometry, increment: float, discretizer: Discretizer, initial: Cloud, velocity: Array
    ) -> None:
        self.scene, self.increment, self.discretizer, self.initial = scene, increment, discretizer, initial
        self.places = initial.nodes.copy()  # (N, 2) [mm]; NaN once a marker has left the cloud
        self._known = [(initial.nodes, velocity)]

    def advance(self, cloud: Cloud, velocity: Array, time: float) -> None:
        """Carry the markers over the increment that ends at `time` [s] with `cloud` and `velocity` (N, 2) [mm/s]."""
        self._known = [(cloud.nodes, velocity), *self._known][: max(HALFWAY)]
        end, start = self._known[:2]
        middle = [(nodes, 0.5 * velocity) for nodes, velocity in (end, start)]
        if end[0] is start[0]:
            middle = [(cloud.nodes, halfway([velocity for _, velocity in self._known]))]
        inside = self.initial.interior
        followed = inside[np.isfinite(self.places[inside, 0])]
        moved = runge_kutta(self.places[followed], [start], middle, [end], self.increment, self._velocity_at)
        distance, nearest = scipy.spatial.cKDTree(cloud.nodes).query(moved)
        lost = (distance > LOST * cloud.nearest_distance[nearest]) | (moved != within(cloud.nodes, moved)).any(axis=1)
        moved[lost] = np.nan
        self.places[followed] = moved
        self.places[self.initial.boundary] = self.scene.boundary_position(self.initial, time)

    def forget_earlier(self) -> None:
        """Forget all velocities but the last: V changes so fast before it that no polynomial goes through both."""
        self._known = self._known[:1]

    def _velocity_at(self, field: NodalField, places: Array) -> Array:
        values = self.discretizer.values
        return np.sum([values(nodes, within(nodes, places)) @ velocity for nodes, velocity in field], axis=0)


def within(nodes: Array, places: Array) -> Array:
    """`places` (T, 2), of which those outside the rectangle around `nodes` (N, 2) are moved to its edge."""
    return np.clip(places, nodes.min(axis=0), nodes.max(axis=0))
