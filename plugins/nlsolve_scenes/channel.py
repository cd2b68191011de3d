"""Power-law Poiseuille flow between two plates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import (
    AdaptiveNodes,
    Cloud,
    ConstitutiveLaw,
    Exact,
    FlowScene,
    Misfit,
    Physics,
    SolveError,
    Spacing,
    Status,
)
from nlsolve_scenes.nodes.files import NodeFile
from nlsolve_scenes.nodes.rectangle import sides
from nlsolve_scenes.nodes.scatter import jittered, scatter

NO_POWER_LAW = (
    "is no power law, whose profile the channel prescribes at its ends: choose the law power-law or norton-hoff, or "
    "the scene couette, which takes any law"
)


class Channel(FlowScene):
    """|y| ≤ H, 0 ≤ x ≤ L, driven by a uniform force f = (G, 0); walls held, exact velocity imposed at both ends.

    u(y) = n/(n + 1) (G/m)^(1/n) (H^((n+1)/n) − |y|^((n+1)/n)),  τ = −G y, for the pure power law τ = m γ̇ⁿ.
    """

    kind: Literal["channel"] = "channel"
    half_height: float = Field(1.0, gt=0, description="H [mm]")
    length: float = Field(2.0, gt=0, description="L [mm]")
    mean_speed: float = Field(100.0, gt=0, description="mean velocity of the pure power law, which sets G [mm/s]")
    spacing: float = Field(0.1, gt=0, description="distance of nodes [mm]")
    nodes: Literal["grid", "scattered"] | AdaptiveNodes | NodeFile = Field(
        "grid", description="a regular grid, scattered nodes, nodes that follow the solution, or those of a file"
    )
    jitter: float = Field(
        0.0, ge=0, lt=0.5, description="random shift of interior nodes, as a fraction of the distance to the nearest"
    )
    seed: int = Field(0, ge=0, description="seed of scattered nodes and of the random shifts")

    keeps_nodes: ClassVar[str | None] = "material leaves the channel"

    def check(self, parts: Any) -> None:
        """Raises Misfit for a law that is no power law."""
        super().check(parts)
        if parts.law.power_form() is None:
            raise Misfit("law", "kind", NO_POWER_LAW)

    @property
    def reference_rate(self) -> float:
        """mean_speed/H [1/s]."""
        return self.mean_speed / self.half_height

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """Nodes with the boundary groups "bottom", "top", "inlet" and "outlet"; interior nodes are jittered."""
        if isinstance(self.nodes, NodeFile):
            cloud = self.nodes.cloud(("bottom", "top", "inlet", "outlet"))
        else:
            cloud = self._scattered(self._grid()) if self.nodes == "scattered" else self._grid()
        return jittered(cloud, self.jitter, self.seed)

    @property
    def adaptive(self) -> AdaptiveNodes | None:
        """The node set, where it follows the solution; it begins on the regular grid."""
        return self.nodes if isinstance(self.nodes, AdaptiveNodes) else None

    def graded(self, spacing: Spacing, nodes: AdaptiveNodes) -> Cloud:
        """Nodes at equal steps of ∫ ds/h on the four sides, and scattered nodes between them."""
        low, high = (0.0, -self.half_height), (self.length, self.half_height)
        walls = sides(low, high, spacing)
        ends = {"inlet": walls.pop("left"), "outlet": walls.pop("right")}
        return jittered(self._filled(walls | ends, spacing, nodes.seed), self.jitter, self.seed)

    def boundary_position(self, cloud: Cloud, time: float) -> np.ndarray:
        """The walls and both ends stay where they are, at any time."""
        return cloud.nodes[cloud.boundary]

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        """The exact profile at both ends, zero on the plates."""
        velocity, _ = self._profile(law, cloud.nodes[cloud.boundary])
        return velocity

    def body_force(self, points: np.ndarray, law: ConstitutiveLaw, physics: Physics) -> np.ndarray:
        """(G, 0) [N/mm³], with G = m ((2n + 1)/n · mean speed/H)ⁿ / H."""
        _, gradient = self._profile(law, points)
        return np.tile([gradient, 0.0], (len(points), 1))

    def exact(self, law: ConstitutiveLaw, points: np.ndarray, time: float) -> Exact | None:
        """The profile above; None for a law that is no power law."""
        if law.power_form() is None:
            return None
        velocity, gradient = self._profile(law, points)
        return Exact(velocity, {"pressure_gradient": gradient})

    def _grid(self) -> Cloud:
        columns = max(2, round(self.length / self.spacing)) + 1
        rows = max(2, round(2.0 * self.half_height / self.spacing)) + 1
        x, y = np.meshgrid(
            np.linspace(0.0, self.length, columns), np.linspace(-self.half_height, self.half_height, rows)
        )
        number = np.arange(rows * columns).reshape(rows, columns)
        boundaries = {"bottom": number[0], "top": number[-1], "inlet": number[1:-1, 0], "outlet": number[1:-1, -1]}
        return Cloud(np.stack([x.ravel(), y.ravel()], axis=1), boundaries)

    def _scattered(self, grid: Cloud) -> Cloud:
        """The boundary nodes of the grid, and scattered nodes between them."""
        walls = {name: grid.nodes[group] for name, group in grid.boundaries.items()}
        return self._filled(walls, lambda points: np.full(len(points), self.spacing), self.seed)

    def _filled(self, walls: Mapping[str, np.ndarray], spacing: Spacing, seed: int) -> Cloud:
        middle, reach = np.array([0.5 * self.length, 0.0]), np.array([0.5 * self.length, self.half_height])
        return scatter(walls, lambda points: (np.abs(points - middle) < reach).all(axis=1), spacing, seed)

    def _profile(self, law: ConstitutiveLaw, points: np.ndarray) -> tuple[np.ndarray, float]:
        """Exact velocity (N, 2) and G. Raises SolveError (not applicable) for a law that is no power law."""
        form = law.power_form()
        if form is None:
            raise SolveError(Status.NOT_APPLICABLE, f"{law.called()!r} {NO_POWER_LAW}")
        n, height = form.index, self.half_height
        # u_max = (2n + 1)/(n + 1) · mean speed, and γ̇ at the wall = (2n + 1)/n · mean speed/H.
        wall_rate = (2.0 * n + 1.0) / n * self.mean_speed / height
        relative = np.minimum(np.abs(points[:, 1]) / height, 1.0)
        speed = (2.0 * n + 1.0) / (n + 1.0) * self.mean_speed * (1.0 - relative ** (1.0 + 1.0 / n))
        return np.stack([speed, np.zeros_like(speed)], axis=1), form.shear_consistency * wall_rate**n / height
