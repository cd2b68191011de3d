"""Where the material of a flow is, what is prescribed on its boundary, and what is known of the flow in closed form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.adaptive import AdaptiveNodes, Spacing
from nlsolve.contracts.continuum.cloud import Cloud, Exact
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.continuum.terms import NodeMotion, Physics
from nlsolve.series import Array


class Geometry(Component, ABC):
    """Geometry and boundary of a flow."""

    keeps_nodes: ClassVar[str | None] = None
    """Why nodes must stay where they are, such as "material leaves the channel"; None when they may move."""
    moving_wall: ClassVar[str | None] = None
    """Name of the boundary group inside the contour, at whose nodes force and torque are computed. None: they are
    computed on the contour.
    """

    @property
    @abstractmethod
    def reference_rate(self) -> float:
        """Strain rate ε̄ [1/s] at which the penalty and the continuation compare viscosities."""

    @abstractmethod
    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """The nodes at t = 0. Their spacing may follow the layers that this law makes."""

    @abstractmethod
    def boundary_position(self, cloud: Cloud, time: float) -> Array:
        """Where the boundary nodes of the initial `cloud` are at `time`, shape (len(cloud.boundary), 2) [mm]."""

    @abstractmethod
    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> Array:
        """V on the boundary nodes of the (current) `cloud`, shape (len(cloud.boundary), 2) [mm/s]."""

    @property
    def adaptive(self) -> AdaptiveNodes | None:
        """What nodes that follow the solution are to reach; None for nodes that are known before it."""
        return None

    def graded(self, spacing: Spacing, nodes: AdaptiveNodes) -> Cloud:
        """Nodes at distances of about h(x) in the material and on its boundary, for a scene whose nodes are `adaptive`.

        May raise SolveError (bad cloud).
        """
        raise NotImplementedError(f"{type(self).__name__} has no nodes by a given spacing")

    def body_force(self, points: Array, law: ConstitutiveLaw, physics: Physics) -> Array | None:
        """f at `points` (N, 2), shape (N, 2) [N/mm³]; None when no body force acts."""
        return None

    def exact(self, law: ConstitutiveLaw, points: Array, time: float) -> Exact | None:
        """The closed quasi-static solution for this law at `points` (N, 2) [mm]; None when there is none."""
        return None

    def contour(self, motion: NodeMotion) -> Array | None:
        """A closed polygon (C, 2) [mm] around the moving wall, in the material, for force and torque; or None."""
        return None
