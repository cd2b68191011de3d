"""A square of material under a moving lid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Cloud, ConstitutiveLaw, FlowScene, Misfit, Physics, Section
from nlsolve_scenes.nodes.rectangle import Rectangle


class Cavity(Rectangle):
    """0 ≤ x, y ≤ L; V = (U(x), 0) on the lid y = L, and 0 on the other walls and in the corners.

    plain :   U = lid_speed, which jumps to zero in the corners (Ghia, Ghia & Shin 1982).
    smooth :  U = 16 ξ² (1 − ξ)² lid_speed, ξ = x/L: no singularity in the corners (Bourcier & François 1969).

    Walls enclose the material, so the flow needs a penalty, best with an iterated pressure (`divergence_tolerance`).
    Nodes are scattered by default: on a regular grid the corners excite a pressure that alternates from cell to cell.
    With convection the Reynolds number is set by the density, Re = ρ lid_speed L/μ; see `reynolds`.
    """

    kind: Literal["cavity"] = "cavity"
    side: float = Field(1.0, gt=0, description="L [mm]")
    lid_speed: float = Field(1.0, gt=0, description="speed of the lid, at its middle [mm/s]")
    lid: Literal["plain", "smooth"] = Field("plain", description="profile of the lid's speed")
    nodes: Literal["grid", "scattered"] = Field("scattered", description="on grid lines, or scattered by repulsion")
    sections: ClassVar[Mapping[str, Section]] = {
        **FlowScene.sections,
        "physics": Section(Physics, {"penalty": 1000.0, "divergence_tolerance": 1e-6}),
    }

    def check(self, parts: Any) -> None:
        """Raises Misfit without a penalty, which a flow between walls needs."""
        super().check(parts)
        if not parts.physics.penalty:
            raise Misfit("physics", "penalty", "nothing flows in or out of a cavity, so its flow needs a penalty")

    @property
    def corners(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(0, 0) and (L, L)."""
        return (0.0, 0.0), (self.side, self.side)

    @property
    def reference_rate(self) -> float:
        """lid_speed/L [1/s]."""
        return self.lid_speed / self.side

    def reynolds(self, law: ConstitutiveLaw, density: float) -> float:
        """ρ lid_speed L/μ, with μ at the reference rate."""
        viscosity = float(law.viscosity(np.array([self.reference_rate**2]))[0])
        return density * self.lid_speed * self.side / viscosity

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        """(U(x), 0) on "top" without its two corners, 0 elsewhere."""
        lid = cloud.boundaries["top"]
        part = cloud.nodes[lid, 0] / self.side
        profile = np.ones(len(lid)) if self.lid == "plain" else 16.0 * part**2 * (1.0 - part) ** 2
        profile[(part == 0.0) | (part == 1.0)] = 0.0
        velocity = np.zeros_like(cloud.nodes)
        velocity[lid, 0] = self.lid_speed * profile
        return velocity[cloud.boundary]
