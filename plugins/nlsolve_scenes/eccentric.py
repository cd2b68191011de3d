"""Viscous flow between two spinning cylinders, one off the centre of the other: the journal bearing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import Cloud, ConstitutiveLaw, Exact, FlowScene, NodeMotion
from nlsolve_scenes.nodes.grading import lines, relative_spacing
from nlsolve_scenes.nodes.scatter import jittered

LEAST_ECCENTRICITY = 1e-2  # in mean gaps: the poles move away like 1/e, and the closed form loses digits as they do


class EccentricCylinders(FlowScene):
    """|z| ≥ r_i and |z − e| ≤ r_o, z = x + i y: V = ω_i × z on the inner wall, ω_o × (z − e) on the outer one.

    For a Newtonian law the quasi-static incompressible flow is known in closed form, with the torque and the force of
    the inner wall (Jeffery 1922; Wannier 1950); see `Bearing`. Nodes lie on the circles of bipolar coordinates, among
    them both walls: as many across the narrow gap as across the wide one.
    """

    kind: Literal["eccentric-cylinders"] = "eccentric-cylinders"
    moving_wall: ClassVar = "inner"
    inner_radius: float = Field(1.0, gt=0, description="r_i [mm]")
    outer_radius: float = Field(2.0, gt=0, description="r_o [mm]")
    eccentricity: float = Field(0.5, gt=0, description="e, distance of the outer centre from the inner, along x [mm]")
    inner_spin: float = Field(100.0, description="ω_i, counter-clockwise [rad/s]")
    outer_spin: float = Field(0.0, description="ω_o, counter-clockwise [rad/s]")
    spacing: float = Field(0.1, gt=0, description="mean distance of nodes across the widest gap [mm]")
    grading: float = Field(0.7, gt=0, le=1, description="distance of circles at the walls over that in the middle")
    jitter: float = Field(
        0.0, ge=0, lt=0.5, description="random shift of interior nodes, as a fraction of the distance to the nearest"
    )
    seed: int = Field(0, ge=0, description="seed of the random shifts")
    keeps_nodes: ClassVar[str | None] = "nodes carried around the bearing crowd in its gap"

    @model_validator(mode="after")
    def _one_inside_the_other(self) -> Self:
        gap = self.outer_radius - self.inner_radius
        if not self.eccentricity < gap:
            raise ValueError(
                f"eccentricity = {self.eccentricity:g} mm: it must be smaller than "
                f"outer_radius − inner_radius = {gap:g} mm, or the cylinders touch"
            )
        if self.eccentricity < LEAST_ECCENTRICITY * gap:
            raise ValueError(
                f"eccentricity = {self.eccentricity:g} mm is less than {LEAST_ECCENTRICITY:g} of the mean gap of "
                f'{gap:g} mm: use the scene "couette" for cylinders with one centre'
            )
        if self.inner_spin == self.outer_spin == 0.0:
            raise ValueError("inner_spin = outer_spin = 0: nothing moves; let one of them spin")
        return self

    @property
    def reference_rate(self) -> float:
        """max(|ω_i| r_i, |ω_o| r_o)/(r_o − r_i) [1/s]."""
        speed = max(abs(self.inner_spin) * self.inner_radius, abs(self.outer_spin) * self.outer_radius)
        return speed / (self.outer_radius - self.inner_radius)

    @property
    def _poles(self) -> Poles:
        return Poles.of(self.inner_radius, self.outer_radius, self.eccentricity)

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """Nodes on bipolar circles, as far apart as the circles are; boundary groups "inner" and "outer"."""
        poles = self._poles
        first, last = (
            poles.level(r + centre) for r, centre in ((self.inner_radius, 0.0), (self.outer_radius, self.eccentricity))
        )
        widest = self.outer_radius - self.inner_radius + self.eccentricity
        count = max(2, round(widest / self.spacing))
        t = lines(count, self.grading)
        steps = (last - first) / count * relative_spacing(np.minimum(t, 1.0 - t), self.grading)
        counts = np.maximum(12, np.rint(2.0 * np.pi / steps).astype(int))
        # Every other circle is turned by half a step: cells in line would carry an alternating pressure.
        angle = 2.0 * np.pi * np.concatenate([(np.arange(m) + 0.5 * (i % 2)) / m for i, m in enumerate(counts)])
        z = poles.place(np.repeat(first + (last - first) * t, counts) + 1j * angle)
        nodes = np.stack([z.real, z.imag], axis=1)
        groups = {"inner": np.arange(counts[0]), "outer": np.arange(len(nodes) - counts[-1], len(nodes))}
        return jittered(Cloud(nodes, groups), self.jitter, self.seed)

    def boundary_position(self, cloud: Cloud, time: float) -> np.ndarray:
        """Both circles stay where they are: a spin turns each into itself."""
        return cloud.nodes[cloud.boundary]

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        """ω_i × z on "inner", ω_o × (z − e) on "outer"."""
        velocity = np.zeros_like(cloud.nodes)
        for name, spin, centre in (("inner", self.inner_spin, 0.0), ("outer", self.outer_spin, self.eccentricity)):
            x, y = cloud.nodes[cloud.boundaries[name]].T
            velocity[cloud.boundaries[name]] = spin * np.stack([-y, x - centre], axis=1)
        return velocity[cloud.boundary]

    def exact(self, law: ConstitutiveLaw, points: np.ndarray, time: float) -> Exact | None:
        """Velocity, and torque about the centre of the inner wall and its force, per mm; None unless n = 1."""
        form = law.power_form()
        if form is None or form.index != 1.0:
            return None
        bearing = Bearing.of(self.inner_radius, self.outer_radius, self._poles, self.inner_spin, self.outer_spin)
        velocity = bearing.velocity(points[:, 0] + 1j * points[:, 1])
        viscosity = form.consistency / 3.0
        quantities = {"torque": viscosity * bearing.torque, "force_x": 0.0, "force_y": viscosity * bearing.force}
        return Exact(np.stack([velocity.real, velocity.imag], axis=1), quantities)

    def contour(self, motion: NodeMotion) -> np.ndarray:
        """The bipolar circle half-way between the walls."""
        poles = self._poles
        level = 0.5 * (poles.level(self.inner_radius) + poles.level(self.outer_radius + self.eccentricity))
        ends = poles.place(np.array([level, level + 1j * np.pi])).real
        angle = 2.0 * np.pi * np.arange(720) / 720
        unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return 0.5 * abs(ends[0] - ends[1]) * unit + [0.5 * (ends[0] + ends[1]), 0.0]


@dataclass(frozen=True)
class Poles:
    """α + i β = log((Z − c)/(Z + c)), Z = z + d: both walls are circles α = constant about the poles Z = ± c.

    Circles of centre D and radius r about the poles have D² − r² = c²; the inner one has D = d, the outer D = d + e.
    """

    c: float
    d: float
    eccentricity: float

    @classmethod
    def of(cls, inner: float, outer: float, eccentricity: float) -> Poles:
        d = (outer**2 - inner**2 - eccentricity**2) / (2.0 * eccentricity)
        return cls(np.sqrt(d**2 - inner**2), d, eccentricity)

    def level(self, x: float) -> float:
        """α of the circle through (x, 0)."""
        return float(np.log(abs(x + self.d - self.c) / (x + self.d + self.c)))

    def place(self, bipolar: np.ndarray) -> np.ndarray:
        """z of α + i β."""
        w = np.exp(bipolar)
        return self.c * (1.0 + w) / (1.0 - w) - self.d


@dataclass(frozen=True)
class Bearing:
    """ψ = a₀ |z|² + X Re F(z) + Re G(z),  F = a₃ L + a₄/(Z − c) + a₅/(Z + c),  G = a₁ z + a₂ L,  u + i v = ψ_y − i ψ_x.

    L = log((Z − c)/(Z + c)) and X = Re Z = x + d. ∇²∇²ψ = 0 whatever the coefficients, and the pressure −2 μ Im F′ is
    single-valued. Jeffery's (1922) solution in bipolar coordinates has no other modes, so the six coefficients meet
    both walls' velocities exactly; they are found from more points of the walls than needed.
    """

    poles: Poles
    a: np.ndarray

    @classmethod
    def of(cls, inner: float, outer: float, poles: Poles, inner_spin: float, outer_spin: float) -> Bearing:
        circle = np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16)
        wall = np.concatenate([inner * circle, poles.eccentricity + outer * circle])
        given = 1j * np.concatenate([inner_spin * inner * circle, outer_spin * outer * circle])
        modes = _modes(poles, wall)
        matrix = np.concatenate([modes.real, modes.imag], axis=1).T
        sizes = np.linalg.norm(matrix, axis=0)
        a = np.linalg.lstsq(matrix / sizes, np.concatenate([given.real, given.imag]), rcond=None)[0] / sizes
        return cls(poles, a)

    def velocity(self, z: np.ndarray) -> np.ndarray:
        """u + i v at z (N,)."""
        return self.a @ _modes(self.poles, z)

    @property
    def torque(self) -> float:
        """−∮ z × (σ n) ds/μ about the inner centre, from the jump of L by 2πi around it: −4π (a₂ + d a₃)."""
        return float(-4.0 * np.pi * (self.a[2] + self.poles.d * self.a[3]))

    @property
    def force(self) -> float:
        """−∮ σ n ds/μ, along y: 4π a₃."""
        return float(4.0 * np.pi * self.a[3])


def _modes(poles: Poles, z: np.ndarray) -> np.ndarray:
    """u + i v of each of the six terms of ψ, shape (6, N)."""
    near, far = z + (poles.d - poles.c), z + (poles.d + poles.c)
    nothing = np.zeros_like(z)
    log, log_slope = np.log(near / far), 1.0 / near - 1.0 / far
    modes = [2.0 * (z.imag - 1j * z.real)]
    for f, f_slope, g_slope in (
        (nothing, nothing, nothing + 1.0),
        (nothing, nothing, log_slope),
        (log, log_slope, nothing),
        (1.0 / near, -1.0 / near**2, nothing),
        (1.0 / far, -1.0 / far**2, nothing),
    ):
        x_slope = f.real + (z.real + poles.d) * f_slope.real + g_slope.real
        y_slope = -(z.real + poles.d) * f_slope.imag - g_slope.imag
        modes.append(y_slope - 1j * x_slope)
    return np.array(modes)
