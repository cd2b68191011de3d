"""Where the material is, what moves it, and which terms the balance of momentum needs: the contract of scenes.

    ρ (∂V/∂t + (V·∇) V) = div σ + f,     σ = (λ tr(ε̇) − p) I + S(ε̇)

Inertia, convection, the penalty λ, the iterated pressure p and the motion of nodes are present only when the scene
switches them on.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.cloud import Cloud, Exact
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.series import Array


class Scene(Component, ABC):
    """A material, its boundary, its motion and its time.

    With `horizon` None the scene is steady; otherwise it marches from the first state at t = 0 to `horizon` in steps of
    `increment` (implicit Euler).
    """

    noun: ClassVar[str] = "scene"
    moving_wall: ClassVar[str | None] = None
    """The boundary group within the contour; a conservative form takes force and torque from its nodes. None: every
    form takes them through the contour.
    """

    horizon: float | None = Field(None, gt=0, description="end of the march [s]; absent: one steady state")
    increment: float = Field(1e-4, gt=0, description="time step of the march [s]")
    density: float = Field(2.81e-9, gt=0, description="mass density [t/mm³]")
    inertia: bool = Field(False, description="keep the term ρ (V − V_k)/Δt")
    convection: bool = Field(False, description="keep the term ρ (V·∇) V; for fixed nodes only")
    penalty: float | None = Field(None, ge=0, description="λ, in the unit of penalty_unit; absent: no volumetric term")
    penalty_unit: Literal["reference", "local", "absolute"] = Field(
        "reference",
        description="λ is a multiple of μ at the reference strain rate, of μ where it acts, or given in MPa s",
    )
    divergence: float | None = Field(
        None,
        gt=0,
        description="‖div V‖/‖ε̄‖ to be reached by iterating the pressure (augmented Lagrangian); absent: penalty alone",
    )
    motion_of_nodes: Literal["fixed", "lagrangian"] = Field(
        "fixed", description="nodes stay, or move with the material"
    )
    markers: bool = Field(False, description="carry material markers, from each node at t = 0; shifted nodes always do")
    shifting: float = Field(
        0.0, ge=0, le=1, description="moving nodes: part of the overlap by which near ones part in an increment"
    )
    skin: float = Field(
        0.0,
        ge=0,
        le=1,
        description="moving nodes: neighbours and triangles are kept until the distance of two near nodes has changed "
        "by this part of the nearest one's; 0: found anew in each increment",
    )
    probe: tuple[float, float] | None = Field(None, description="place whose nearest node is recorded in time [mm]")

    @model_validator(mode="after")
    def _terms_fit_together(self) -> Self:
        if self.divergence is not None and not self.penalty:
            raise ValueError(
                f"divergence = {self.divergence:g}: the pressure is iterated with a penalty; set penalty > 0"
            )
        if self.convection and self.motion_of_nodes == "lagrangian":
            raise ValueError(
                'convection = true: nodes that move with the material carry it already; use motion_of_nodes = "fixed"'
            )
        if self.markers and self.motion_of_nodes == "lagrangian" and not self.shifting:
            raise ValueError(
                'markers = true: nodes that move are the markers themselves; use motion_of_nodes = "fixed" or shifting'
            )
        if self.shifting and self.motion_of_nodes == "fixed":
            raise ValueError(
                f'shifting = {self.shifting:g}: fixed nodes are not shifted; use motion_of_nodes = "lagrangian"'
            )
        if self.skin and self.motion_of_nodes == "fixed":
            raise ValueError(
                f"skin = {self.skin:g}: the neighbours of fixed nodes never change; "
                'use motion_of_nodes = "lagrangian" or leave it out'
            )
        return self

    @property
    def increments(self) -> int:
        """Number of time steps; 0 for a steady scene."""
        return 0 if self.horizon is None else max(1, round(self.horizon / self.increment))

    @property
    @abstractmethod
    def reference_rate(self) -> float:
        """Strain rate ε̄ [1/s] at which `penalty` and continuation compare viscosities."""

    def penalty_modulus(self, law: ConstitutiveLaw, rate_squared: Array) -> float | Array:
        """λ [MPa s]: penalty · μ at the reference rate, or penalty · μ(ε̄²) with the `rate_squared` (L,) of the volume
        points, or the penalty itself; 0 without a penalty.
        """
        if not self.penalty:
            return 0.0
        if self.penalty_unit == "absolute":
            return self.penalty
        if self.penalty_unit == "local":
            return self.penalty * law.viscosity(rate_squared)
        return self.penalty * float(law.viscosity(np.array([self.reference_rate**2]))[0])

    @abstractmethod
    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """The nodes at t = 0; they may be graded to the layers this law makes."""

    @abstractmethod
    def boundary_position(self, cloud: Cloud, time: float) -> Array:
        """Where the boundary nodes of the initial `cloud` are at `time`, shape (len(cloud.boundary), 2) [mm]."""

    @abstractmethod
    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> Array:
        """V on the boundary nodes of the (current) `cloud`, shape (len(cloud.boundary), 2) [mm/s]."""

    def body_force(self, points: Array, law: ConstitutiveLaw) -> Array | None:
        """f at points (N, 2) [N/mm³], or None."""
        return None

    def exact(self, law: ConstitutiveLaw, points: Array, time: float) -> Exact | None:
        """The closed quasi-static solution for this law, or None where there is none."""
        return None

    def contour(self) -> Array | None:
        """A closed polygon (C, 2) in the material around the moving wall, for force and torque; None: no such wall."""
        return None
