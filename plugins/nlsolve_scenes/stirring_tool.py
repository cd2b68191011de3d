"""An annulus of material around a tool that spins or orbits: the scene of the 2015 paper."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import (
    AdaptiveNodes,
    Cloud,
    ConstitutiveLaw,
    Exact,
    FlowScene,
    NodeMotion,
    SolveError,
    Spacing,
    Status,
    local_index,
)
from nlsolve_scenes.nodes.files import NodeFile
from nlsolve_scenes.nodes.fronts import annulus
from nlsolve_scenes.nodes.rings import SPIN, Auto, GradedRings, Rings, Scattered, orbit

Nodes = Annotated[Rings | GradedRings | Scattered | Auto | AdaptiveNodes | NodeFile, Field(discriminator="kind")]
ON_CIRCLE = 1e-3  # largest distance of a wall node read from a file from its circle, in radii
THINNEST = 1e-3  # least local index of the law that a layer is computed with: a perfectly plastic law has n = 0


BEFORE = {"resolution": 2.0, "layers": 1.0, "growth": 0.4}
"""The auto nodes on which adaptive ones begin: few, but some in every layer."""


class StirringTool(FlowScene):
    """r_t ≤ r ≤ r_p, plane strain; the tool's wall moves, the outer wall is held, adhesion is perfect.

    spin : V = ω r_t (−sin θ, cos θ) on the tool. Quasi-static exact solution for the pure power law (incompressible):
           u_θ = ω r (r^(−2/n) − r_p^(−2/n)) / (r_t^(−2/n) − r_p^(−2/n)),  τ_rθ r² constant.
    orbit: V = r_t ω (−cos ωt, sin ωt), the same on the whole circle, as printed in the 2015 paper: the tool's centre
           runs along a circle of radius r_t, without spin.

    Timesli, Braikat, Lahmam, Zahrouni (2015), section 4; its figures show the spin.
    """

    kind: Literal["stirring-tool"] = "stirring-tool"
    moving_wall: ClassVar = "tool"
    motion: Literal["spin", "orbit"] = Field(
        "spin", description="the tool spins about its centre, or translates along a circle"
    )
    tool_radius: float = Field(1.5, gt=0, description="r_t [mm]")
    plate_radius: float = Field(6.0, gt=0, description="r_p [mm]")
    angular_speed: float = Field(100.0, gt=0, description="ω [rad/s]")
    nodes: Nodes = Field(
        default_factory=Rings, description="node set: rings, graded-rings, scattered, auto, adaptive or file"
    )

    @model_validator(mode="after")
    def _radii_in_order(self) -> Self:
        if self.tool_radius >= self.plate_radius:
            raise ValueError(
                f"tool_radius = {self.tool_radius:g} mm must be smaller than plate_radius = {self.plate_radius:g} mm"
            )
        return self

    @property
    def reference_rate(self) -> float:
        """Tool speed over tool radius, ω."""
        return self.angular_speed

    def layer(self, law: ConstitutiveLaw) -> float:
        """Distance over which the strain rate at the tool falls by e [mm]; at most a quarter of the gap.

        spin : r_t n/2, as τ r² is constant and dr/r = −½ d log τ = −(n/2) d log γ̇; there γ̇ = 2 ω/n for a power law.
        orbit: r_t n² at the sides of the tool, as measured for power laws (0.022 mm for n = 0.1324); there γ̇ ~ ω/n².

        n is the local index of the law at that rate, ε̄ = γ̇/√3, found by iteration.
        """
        n, before = 1.0, np.nan
        for _ in range(30):
            if n == before:
                break
            rate = (2.0 / n if self.motion == "spin" else 1.0 / n**2) * self.angular_speed / np.sqrt(3.0)
            n, before = max(local_index(law, rate), THINNEST), n
        layer = self.tool_radius * (0.5 * n if self.motion == "spin" else n**2)
        return min(layer, 0.25 * (self.plate_radius - self.tool_radius))

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """Nodes with the boundary groups "tool" and "plate".

        Raises SolveError (bad cloud) when a wall node read from a file is off its circle.
        """
        if not isinstance(self.nodes, NodeFile):
            nodes = self.nodes
            if isinstance(nodes, AdaptiveNodes):
                nodes = Auto(spacing=nodes.spacing, middle=nodes.spacing, **BEFORE)
            if isinstance(nodes, Auto):
                layer = self.layer(law)
                nodes = nodes.rings(layer, SPIN if self.motion == "spin" else orbit(layer / self.tool_radius))
            return nodes.cloud(self.tool_radius, self.plate_radius)
        cloud = self.nodes.cloud(("tool", "plate"))
        for group, radius in (("tool", self.tool_radius), ("plate", self.plate_radius)):
            found = np.hypot(*cloud.nodes[cloud.boundaries[group]].T)
            worst = found[np.abs(found - radius).argmax()]
            if abs(worst - radius) > ON_CIRCLE * radius:
                raise SolveError(
                    Status.BAD_CLOUD,
                    f"{self.nodes.path}: a node of the group {group!r} lies at r = {worst:.6g} mm, "
                    f"{group}_radius = {radius:g} mm: change one of them",
                )
        return cloud

    @property
    def adaptive(self) -> AdaptiveNodes | None:
        """The node set, where it follows the solution."""
        return self.nodes if isinstance(self.nodes, AdaptiveNodes) else None

    def graded(self, spacing: Spacing, nodes: AdaptiveNodes) -> Cloud:
        """Fronts around the tool, then scattered nodes; boundary groups "tool" and "plate"."""
        return annulus(self.tool_radius, self.plate_radius, spacing, nodes.seed)

    def boundary_position(self, cloud: Cloud, time: float) -> np.ndarray:
        """The tool's nodes turned by ωt, or shifted by r_t (−sin ωt, 1 − cos ωt); the plate's nodes stay."""
        position = cloud.nodes.copy()
        tool = cloud.boundaries["tool"]
        angle = self.angular_speed * time
        sine, cosine = np.sin(angle), np.cos(angle)
        if self.motion == "spin":
            position[tool] = cloud.nodes[tool] @ np.array([[cosine, sine], [-sine, cosine]])
        else:
            position[tool] += self.tool_radius * np.array([-sine, 1.0 - cosine])
        return position[cloud.boundary]

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        """Adhesion: V of the tool on its nodes, 0 on the plate's."""
        velocity = np.zeros_like(cloud.nodes)
        tool = cloud.boundaries["tool"]
        if self.motion == "spin":
            velocity[tool] = self.angular_speed * np.stack([-cloud.nodes[tool, 1], cloud.nodes[tool, 0]], axis=1)
        else:
            angle = self.angular_speed * time
            velocity[tool] = self.tool_radius * self.angular_speed * np.array([-np.cos(angle), np.sin(angle)])
        return velocity[cloud.boundary]

    def exact(self, law: ConstitutiveLaw, points: np.ndarray, time: float) -> Exact | None:
        """Spin of a power law: velocity, and torque per mm T = 2 π r² τ_rθ; None for the orbit and other laws."""
        form = law.power_form()
        if self.motion != "spin" or form is None:
            return None
        power = -2.0 / form.index
        inner, outer, omega = self.tool_radius, self.plate_radius, self.angular_speed
        # (r/r_t)^(−2/n) rather than r^(−2/n): no overflow as n → 0.
        radius = np.hypot(points[:, 0], points[:, 1])
        far = (outer / inner) ** power
        turn = omega * ((radius / inner) ** power - far) / (1.0 - far)
        velocity = np.stack([-turn * points[:, 1], turn * points[:, 0]], axis=1)
        shear_rate = (2.0 / form.index) * omega / (1.0 - far)  # γ̇ at the tool
        torque = 2.0 * np.pi * inner**2 * form.shear_consistency * shear_rate**form.index
        return Exact(velocity, {"torque": torque})

    def contour(self, motion: NodeMotion) -> np.ndarray | None:
        """The circle of radius √(r_t r_p) about the centre of the annulus; none once the tool has left that centre."""
        if self.motion == "orbit" and motion.moving:
            return None
        angle = 2.0 * np.pi * np.arange(720) / 720
        return np.sqrt(self.tool_radius * self.plate_radius) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
