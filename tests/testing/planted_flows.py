"""Laws, discretizers, scenes and systems that each break one promise of their contract."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_systems import Bratu
from pydantic import Field

from nlsolve.plugin import (
    Cloud,
    ConstitutiveLaw,
    Discretizer,
    Exact,
    NonlinearProblem,
    Operators,
    PointOperators,
    Scene,
    Series,
    SingleSolve,
    System,
    as_column,
)


class PlantedLaw(ConstitutiveLaw):
    """1/(1 + ε̄²)^½, with one promise broken."""

    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def viscosity(self, rate_squared: Any) -> Any:
        is_series = isinstance(rate_squared, Series)
        mu = (1.0 + rate_squared) ** -0.5
        if self.breaks == "shape" and not is_series:
            return 1.0
        if self.breaks == "complex" and not is_series:
            return mu + 0.0j
        if self.breaks == "positive":
            return mu - 1e-3
        if self.breaks == "dissipation":
            return -mu
        if self.breaks == "series" and is_series:
            return mu.coefficient(0)
        if self.breaks == "derivative" and is_series:
            return (1.0 + rate_squared.coefficient(0)) ** -0.5 + 0.0 * rate_squared
        if self.breaks == "coefficients" and is_series and rate_squared.order == 0 and len(self.asked) > 1:
            return mu
        if self.breaks == "far rates":
            return mu / (1.0 - (rate_squared == 0.0)) * (rate_squared / rate_squared) if not is_series else mu
        if self.breaks == "no mutation" and not is_series:
            rate_squared *= 1.0 + 1e-15
        self.asked.append(1)
        return mu * (1.0 + (1e-15 * len(self.asked) if self.breaks == "memory" else 0.0))


class Refusing(ConstitutiveLaw):
    """Says that it is continued by its index, and takes none but small ones."""

    kind: Literal["refusing"] = "refusing"
    continued_by: ClassVar[Any] = {"index": "larger"}
    index: float = Field(0.3, gt=0, lt=0.4)

    def viscosity(self, rate_squared: Any) -> Any:
        return rate_squared ** (0.5 * (self.index - 1.0))


class Misnamed(ConstitutiveLaw):
    """Is continued by what is no field."""

    kind: Literal["misnamed"] = "misnamed"
    continued_by: ClassVar[Any] = {"indx": "larger"}

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 + 0.0 * rate_squared


class Kinked(ConstitutiveLaw):
    """Its series is that of another law from the second order on."""

    kind: Literal["kinked"] = "kinked"

    def viscosity(self, rate_squared: Any) -> Any:
        if not isinstance(rate_squared, Series):
            return (1.0 + rate_squared) ** -0.5
        x = rate_squared.coefficient(0)
        return (1.0 + x) ** -0.5 - 0.5 * (1.0 + x) ** -1.5 * (rate_squared - x)


class PlantedDiscretizer(Discretizer):
    """Linear triangles, or moving least squares, with one promise broken."""

    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def _inner(self) -> Discretizer:
        return MovingLeastSquares() if self.breaks == "forces" else LinearTriangles()

    def completed(self, cloud: Cloud) -> Cloud:
        return replace(cloud, nodes=cloud.nodes + 1.0) if self.breaks == "completed" else cloud

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        if self.breaks == "too few nodes" and len(cloud.nodes) == 4:
            return Operators(PointOperators(sp.csr_array((3, 8)), sp.csr_array((4, 3)), np.zeros((1, 2))))
        found = self._inner().operators(cloud, volumetric or self.breaks == "operators")
        strain = found.strain
        self.asked.append(1)
        if self.breaks == "shapes":
            return replace(found, strain=replace(strain, rate=strain.rate[:-1]))
        if self.breaks == "complex":
            return replace(found, strain=replace(strain, rate=strain.rate.astype(complex)))
        if self.breaks == "rates":
            return replace(
                found, strain=PointOperators(1.01 * strain.rate, 1.01 * strain.force, strain.points, strain.areas)
            )
        if self.breaks == "forces":
            return replace(found, strain=replace(strain, force=1.01 * strain.force))
        if self.breaks == "adjoint":
            return replace(found, strain=replace(strain, force=1.01 * strain.force))
        if self.breaks == "determinism":
            return replace(found, strain=replace(strain, rate=strain.rate * (1.0 + 1e-15 * len(self.asked))))
        return found

    def gradient(self, cloud: Cloud) -> Any:
        dx, dy = self._inner().gradient(cloud)
        return (dy, dx) if self.breaks == "gradients" else (dx, dy)

    def values(self, sources: Any, targets: Any) -> Any:
        return (1.01 if self.breaks == "values" else 1.0) * self._inner().values(sources, targets)


class PlantedScene(StirringTool):
    """The spinning tool with one promise broken."""

    kind: Literal["planted"] = "planted"  # type: ignore[assignment]
    nodes: Rings = Rings(spacing=0.5)  # type: ignore[assignment]
    breaks: str
    asked: ClassVar[list[int]] = []
    moving_wall: ClassVar[str | None] = "tool"

    @property
    def reference_rate(self) -> float:
        return 0.0 if self.breaks == "reference rate" else super().reference_rate

    def cloud(self, law: Any) -> Cloud:
        cloud = super().cloud(law)
        groups = dict(cloud.boundaries)
        if self.breaks == "cloud":
            first = next(iter(groups))
            groups["twice"] = groups[first][:1]
        if self.breaks == "contour":
            groups = {f"other {name}": group for name, group in groups.items()}
        return replace(cloud, boundaries=groups)

    def boundary_position(self, cloud: Any, time: float) -> Any:
        position = super().boundary_position(cloud, time)
        return position[::-1] if self.breaks == "boundary position" else position

    def boundary_velocity(self, cloud: Any, law: Any, time: float) -> Any:
        velocity = super().boundary_velocity(cloud, law, time)
        self.asked.append(1)
        if self.breaks == "boundary velocity":
            return velocity.ravel()
        return velocity * (1.0 + (1e-15 * len(self.asked) if self.breaks == "determinism" else 0.0))

    def body_force(self, points: Any, law: Any, physics: Any) -> Any:
        return np.zeros(2) if self.breaks == "body force" else None

    def exact(self, law: Any, points: Any, time: float) -> Exact | None:
        found = super().exact(law, points, time)
        if found is None or self.breaks not in ("exact boundary", "exact solution"):
            return found
        if self.breaks == "exact boundary":
            return Exact(1.01 * found.velocity)
        r = np.hypot(points[:, 0], points[:, 1])  # falls linearly from the tool to the wall, whatever the law
        spin = (
            self.angular_speed * self.tool_radius / r * (self.plate_radius - r) / (self.plate_radius - self.tool_radius)
        )
        return Exact(np.stack([-spin * points[:, 1], spin * points[:, 0]], axis=1))


class Called(Channel):
    """`reference_rate` without @property."""

    kind: Literal["called"] = "called"  # type: ignore[assignment]

    def reference_rate(self) -> float:  # type: ignore[override]
        return 1.0


class PlantedSystem(System):
    """u² − c = 0 with one promise broken."""

    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def formula(self, u: Any) -> Any:
        self.asked.append(1)
        f = u**2 - as_column(np.array([2.0, 3.0]), u)
        is_series = isinstance(u, Series)
        if self.breaks == "formula" and not is_series:
            return f[0]
        if self.breaks == "complex" and not is_series:
            return f + 0.0j
        if self.breaks == "no mutation" and not is_series and u.ndim == 2:
            u *= 1.0 + 1e-14
        if self.breaks == "jacobian" and is_series:
            return 1.1 * f
        if self.breaks == "expansion" and is_series and len(u.shape) == 1:
            return 2.0 * u.coefficient(0) * (u - u.coefficient(0)) + f.coefficient(0)
        return f

    def standard_start(self) -> Any:
        return np.array([1.0, np.nan if self.breaks == "start" else 1.5])

    def pattern(self) -> Any:
        return sp.csr_array(np.array([[0, 1], [1, 0]] if self.breaks == "pattern" else np.eye(2)))

    def roots(self) -> Any:
        return np.array([[1.41, 1.73]] if self.breaks == "roots" else np.sqrt([[2.0, 3.0]]))


class SquareProblem(NonlinearProblem):
    def __init__(self, breaks: str) -> None:
        self._breaks = breaks

    def residual(self, u: Any) -> Any:
        return (u**2 - 2.0)[:, None] if self._breaks == "sample" else u**2 - 2.0

    def jacobian(self, u: Any) -> Any:
        return sp.csr_array(np.diag((3.0 if self._breaks == "jacobian" else 2.0) * u))


class PlantedPDE(Scene):
    """A scene of its own with one promise broken."""

    kind: Literal["planted"] = "planted"
    breaks: str

    def simulation(self, parts: Any, entry: Any) -> Any:
        problem = SquareProblem(self.breaks)
        return problem if self.breaks == "simulation" else SingleSolve(problem, np.array([1.0, 2.0]))


LAWS = {
    **{
        (check, check): PlantedLaw(breaks=check)
        for check in ("shape", "positive", "dissipation", "series", "derivative", "far rates", "no mutation")
    },
    ("shape", "complex"): PlantedLaw(breaks="complex"),
    ("no mutation", "memory"): PlantedLaw(breaks="memory"),
    ("coefficients", "kinked"): Kinked(),
    ("continuation", "refusing"): Refusing(),
    ("continuation", "misnamed"): Misnamed(),
}
DISCRETIZERS = {
    **{
        (check, check): PlantedDiscretizer(breaks=check)
        for check in (
            "completed",
            "operators",
            "shapes",
            "rates",
            "forces",
            "adjoint",
            "gradients",
            "values",
            "determinism",
            "too few nodes",
        )
    },
    ("shapes", "complex"): PlantedDiscretizer(breaks="complex"),
}
SCENES = {
    **{
        (check, check): PlantedScene(breaks=check)
        for check in (
            "reference rate",
            "cloud",
            "boundary position",
            "boundary velocity",
            "body force",
            "contour",
            "exact boundary",
            "exact solution",
            "determinism",
        )
    },
    ("reference rate", "called"): Called(),
}
SYSTEMS = {
    **{
        (check, check): PlantedSystem(breaks=check)
        for check in ("start", "formula", "no mutation", "jacobian", "expansion", "pattern", "roots")
    },
    ("formula", "complex"): PlantedSystem(breaks="complex"),
}
SIMULATIONS = {(check, check): PlantedPDE(breaks=check) for check in ("simulation", "sample", "jacobian")}
SOUND = (Bratu(nodes=4), Channel(), LinearTriangles())
