"""Sections of a flow: the terms of the balance of momentum, the time steps, the motion of nodes, and the recording.

    ρ (∂V/∂t + (V·∇) V) = div σ + f,     σ = (λ tr(ε̇) − p) I + S(ε̇)

Inertia, convection, the penalty λ, the iterated pressure p and the motion of nodes are present only when a study
switches them on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.recording import IterateRecording
from nlsolve.series import Array


class Physics(Component):
    """The terms of the balance of momentum beside div S, and how incompressible the material is."""

    noun: ClassVar[str] = "physics"

    density: float = Field(default=2.81e-9, gt=0, description="mass density [t/mm³]")
    inertia: bool = Field(default=False, description="keep the term ρ (V − V_k)/Δt")
    convection: bool = Field(default=False, description="keep the term ρ (V·∇) V; for fixed nodes only")
    penalty: float | None = Field(
        default=None, ge=0, description="λ, in the unit of penalty_unit; absent: no volumetric term"
    )
    penalty_unit: Literal["reference", "local", "absolute"] = Field(
        default="reference",
        description="λ is a multiple of μ at the reference strain rate, of μ where it acts, or given in MPa s",
    )
    divergence_tolerance: float | None = Field(
        default=None,
        gt=0,
        description="‖div V‖/‖ε̄‖ to be reached by iterating the pressure (augmented Lagrangian); absent: penalty alone",
    )
    pressure_iterations: int = Field(
        default=60,
        gt=0,
        description="iterations of the pressure per increment, where a divergence_tolerance asks for them",
    )

    @model_validator(mode="after")
    def _a_pressure_needs_a_penalty(self) -> Self:
        if self.divergence_tolerance is not None and not self.penalty:
            raise ValueError(
                f"divergence_tolerance = {self.divergence_tolerance:g}: the pressure is iterated with a penalty; "
                "set penalty > 0"
            )
        return self

    def penalty_modulus(
        self, law: ConstitutiveLaw, reference_rate: float, rate_squared: Callable[[], Array]
    ) -> float | Array:
        """λ [MPa s]: penalty · μ at the reference rate [1/s], or penalty · μ(ε̄²) with the `rate_squared` (L,) of the
        volume points, or the penalty itself; 0 without a penalty.
        """
        if not self.penalty:
            return 0.0
        if self.penalty_unit == "absolute":
            return self.penalty
        if self.penalty_unit == "local":
            return self.penalty * law.viscosity(rate_squared())
        return self.penalty * float(law.viscosity(np.array([reference_rate**2]))[0])


class TimeSteps(Component):
    """A march by implicit Euler from the first state at t = 0 to `horizon`, or one steady state."""

    noun: ClassVar[str] = "time"

    horizon: float | None = Field(default=None, gt=0, description="end of the march [s]; absent: one steady state")
    increment: float = Field(default=1e-4, gt=0, description="Δt, time step of the march [s]")

    @property
    def increments(self) -> int:
        """Number of time steps; 0 for a steady state."""
        return 0 if self.horizon is None else max(1, round(self.horizon / self.increment))


class NodeMotion(Component):
    """Whether nodes stay or move with the material, and how the material is followed."""

    noun: ClassVar[str] = "motion"

    nodes: Literal["fixed", "lagrangian"] = Field(default="fixed", description="nodes stay, or move with the material")
    markers: bool = Field(
        default=False, description="carry material markers, from each node at t = 0; shifted nodes always do"
    )
    shifting: float = Field(
        default=0.0, ge=0, le=1, description="moving nodes: part of the overlap by which near ones part in an increment"
    )
    skin: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="moving nodes: neighbours and triangles are kept until the distance of two near nodes has changed "
        "by this part of the nearest one's; 0: found anew in each increment",
    )
    rates: Literal["of-velocity", "accumulated"] = Field(
        default="of-velocity",
        description="moving nodes: strain rates are those of the velocity at the present nodes, or carried with the "
        "material, to which each increment adds that of its velocity",
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.markers and self.moving and not self.shifting:
            raise ValueError(
                'markers = true: nodes that move are the markers themselves; use nodes = "fixed" or shifting'
            )
        if self.shifting and not self.moving:
            raise ValueError(f'shifting = {self.shifting:g}: fixed nodes are not shifted; use nodes = "lagrangian"')
        if self.skin and not self.moving:
            raise ValueError(
                f"skin = {self.skin:g}: the neighbours of fixed nodes never change; "
                'use nodes = "lagrangian" or leave it out'
            )
        if self.accumulates and not self.moving:
            raise ValueError(
                'rates = "accumulated": at fixed nodes they are those of the velocity; use nodes = "lagrangian"'
            )
        if self.accumulates and self.shifting:
            raise ValueError('rates = "accumulated": shifted nodes are not material points; leave shifting out')
        return self

    @property
    def accumulates(self) -> bool:
        """Whether strain rates are carried with the material."""
        return self.rates == "accumulated"

    @property
    def moving(self) -> bool:
        """Whether nodes move with the material."""
        return self.nodes == "lagrangian"


class Recording(IterateRecording):
    """What is recorded of a case beside its last state; `times` and `probe` are of flows only."""

    times: tuple[Annotated[float, Field(ge=0)], ...] = Field(
        default=(), description="times at which the fields are recorded, besides the last [s]"
    )
    probe: tuple[float, float] | None = Field(
        default=None, description="place whose nearest node is recorded in time [mm]"
    )

    @model_validator(mode="before")
    @classmethod
    def _is_a_table(cls, given: Any) -> Any:
        if isinstance(given, list | tuple):
            raise ValueError(f"should be a table now: record = {{ times = {list(given)} }}")
        return given
