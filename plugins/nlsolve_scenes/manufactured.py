"""A given velocity field in a rectangle, and the body force that makes it the solution for any law."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import (
    Cloud,
    ConstitutiveLaw,
    Exact,
    NoSeriesHere,
    Physics,
    Series,
    SolveError,
    Status,
    stress,
    tangent_moduli,
)
from nlsolve_scenes.formulas import Formula, Jet
from nlsolve_scenes.nodes.rectangle import Rectangle, grid

SAMPLES = 21  # points on a side of the grid on which the field is checked
ROUNDING = 1e-10  # largest divergence that counts as zero, as a fraction of the largest velocity gradient


class Manufactured(Rectangle):
    """f = ρ (V·∇) V − div S(ε̇(V)) + ∇p for the given V = (u, v) and p: V is the exact solution for any law.

    Formulas are texts in x and y [mm] that give mm/s and MPa. V must be free of divergence, so that the volumetric
    term of a penalty vanishes for it. ∇p is part of f with a penalty only, since nothing carries a pressure without
    one; a penalty λ alone leaves an error of the order p/λ, an iterated pressure (`divergence_tolerance`) none. All
    derivatives are exact: formulas and law are run on truncated series. Method: Roache (2002).
    """

    kind: Literal["manufactured"] = "manufactured"
    u: Formula = Field("2*y + 0.3*sin(pi*x)*cos(pi*y)", description="velocity, x [mm/s]: a formula in x and y")
    v: Formula = Field("-0.3*cos(pi*x)*sin(pi*y)", description="velocity, y [mm/s]: a formula in x and y")
    p: Formula = Field("20*cos(x)*y", description="pressure, with a penalty [MPa]: a formula in x and y")
    width: float = Field(1.0, gt=0, description="width of the rectangle, along x [mm]")
    height: float = Field(1.0, gt=0, description="height of the rectangle, along y [mm]")
    origin: tuple[float, float] = Field((0.0, 0.0), description="lower left corner of the rectangle [mm]")

    @model_validator(mode="after")
    def _a_smooth_field_without_divergence(self) -> Self:
        points = self._samples
        with np.errstate(all="ignore"):
            jets = {name: self._jet(name, points) for name in ("u", "v", "p")}
        u, v = jets["u"], jets["v"]
        largest = float(np.abs([u.x, u.y, v.x, v.y]).max())
        dilatation = np.abs(u.x + v.y)
        worst = int(dilatation.argmax())
        if dilatation[worst] > ROUNDING * largest:
            x, y = points[worst]
            raise ValueError(
                f"u = {self.u!r} and v = {self.v!r}: their divergence is {(u.x + v.y)[worst]:.3g} 1/s at "
                f"({x:.6g}, {y:.6g}) and must vanish; derive both from one stream function"
            )
        if not np.abs(_strain_rate(u, v)).max() > ROUNDING * largest:
            raise ValueError(f"u = {self.u!r} and v = {self.v!r} are a rigid motion: nothing is strained")
        return self

    def _jet(self, name: str, points: np.ndarray) -> Jet:
        """The jet of a field at points (N, 2). Raises ValueError where a part of it is not finite."""
        try:
            jet = Jet.of(getattr(self, name), points)
            bad = np.flatnonzero(~np.isfinite([jet.f, jet.x, jet.y, jet.xx, jet.xy, jet.yy]).all(axis=0))
        except NoSeriesHere as refusal:
            bad = np.array(refusal.entry)
        if len(bad):
            x, y = points[bad[0]]
            raise ValueError(
                f"{name} = {getattr(self, name)!r} or a derivative of it is not finite at ({x:.6g}, {y:.6g}): "
                "change it, or the rectangle"
            )
        return jet

    @property
    def corners(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """`origin`, and the corner opposite to it [mm]."""
        x, y = self.origin
        return (x, y), (x + self.width, y + self.height)

    @property
    def _samples(self) -> np.ndarray:
        """Points of a regular grid in the rectangle and on its sides, shape (SAMPLES², 2)."""
        (x, y), (x_end, y_end) = self.corners
        return grid(np.linspace(x, x_end, SAMPLES), np.linspace(y, y_end, SAMPLES)).nodes

    @property
    def reference_rate(self) -> float:
        """Root mean square of ε̄ over the rectangle."""
        exx, eyy, exy = _strain_rate(Jet.of(self.u, self._samples), Jet.of(self.v, self._samples))
        return float(np.sqrt(np.mean(2.0 / 3.0 * (exx**2 + eyy**2 + 2.0 * exy**2))))

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        """V at the boundary nodes."""
        return self._velocity(cloud.nodes[cloud.boundary])

    def exact(self, law: ConstitutiveLaw, points: np.ndarray, time: float) -> Exact:
        """V, the same for every law."""
        return Exact(self._velocity(points))

    def body_force(self, points: np.ndarray, law: ConstitutiveLaw, physics: Physics) -> np.ndarray:
        """f above [N/mm³]. Raises SolveError (non finite) where the law has no finite viscosity, as at ε̄ = ε₀ = 0."""
        u, v = Jet.of(self.u, points), Jet.of(self.v, points)
        rate = _strain_rate(u, v)
        with np.errstate(all="ignore"):
            xx, _, xy = _slope_of_stress(law, rate, np.stack([u.xx, v.xy, 0.5 * (u.xy + v.xx)]))
            _, yy, yx = _slope_of_stress(law, rate, np.stack([u.xy, v.yy, 0.5 * (u.yy + v.xy)]))
        force = -np.stack([xx + yx, xy + yy], axis=1)
        if physics.penalty:
            p = Jet.of(self.p, points)
            force += np.stack([p.x, p.y], axis=1)
        if physics.convection:
            force += physics.density * np.stack([u.f * u.x + v.f * u.y, u.f * v.x + v.f * v.y], axis=1)
        bad = np.flatnonzero(~np.isfinite(force).all(axis=1))
        if len(bad):
            x, y = points[bad[0]]
            raise SolveError(
                Status.NON_FINITE,
                f"the law {law.kind_name()!r} gives no finite divergence of stress at ({x:.6g}, {y:.6g}): "
                "regularise it, or choose a field that is strained everywhere",
            )
        return force

    def _velocity(self, points: np.ndarray) -> np.ndarray:
        return np.stack([Jet.of(text, points).f for text in (self.u, self.v)], axis=1)


def _strain_rate(u: Jet, v: Jet) -> np.ndarray:
    """ε̇ in the order xx, yy, xy, shape (3, N)."""
    return np.stack([u.x, v.y, 0.5 * (u.y + v.x)])


def _slope_of_stress(law: ConstitutiveLaw, rate: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """∂S along a direction in which ε̇ (3, N) has the given slope: coefficient 1 of S(ε̇ + a ∂ε̇), or C ∂ε̇ for a law
    that has a tangent at rest, and no series.
    """
    path = Series(rate)
    path.append(slope)
    try:
        return stress(law, path).coefficient(1)
    except NoSeriesHere:
        return np.einsum("ijm,jm->im", tangent_moduli(law, rate), slope)
