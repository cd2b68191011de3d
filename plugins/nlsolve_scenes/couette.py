"""The spinning tool with any law, and its velocity and torque by quadrature."""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy
from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw, Exact, Series
from nlsolve_scenes.stirring_tool import StirringTool

SLOWEST = np.log(1e-140)  # log of the smallest shear rate told from rest [1/s]; its square is still a normal number
FASTEST = np.log(1e12)  # log of the largest wall shear rate tried, over the smallest possible one
PANEL = 2.0  # largest width, in log γ̇, of a panel of the quadrature
GAUSS = np.polynomial.legendre.leggauss(12)  # abscissae and weights in a panel


class Couette(StirringTool):
    """τ_rθ = T / (2π r²),  τ = μ(γ̇²/3) γ̇,  γ̇ = −r d(u_θ/r)/dr : r_t ≤ r ≤ r_p, the inner wall spins at ω.

    The quasi-static incompressible solution for any law whose τ grows with γ̇, its regularisation included. As τ r² is
    constant, dr/r = −½ d log τ, and both T and u_θ follow from a quadrature over s = log γ̇, in which laws are smooth:

        u_θ(r)/r = ½ ∫ γ̇ (d log τ/ds) ds from γ̇(r_p) to γ̇(r),  with T such that u_θ(r_t) = ω r_t.
    """

    kind: Literal["couette"] = "couette"  # type: ignore[assignment]
    motion: Literal["spin"] = Field("spin", description="the tool spins about its centre")

    def exact(self, law: ConstitutiveLaw, points: np.ndarray, time: float) -> Exact | None:
        """Velocity, and torque per mm T = 2π r² τ_rθ; None unless τ grows with γ̇ throughout and some rate carries ω."""
        wall = self._wall_log_rate(law)
        if wall is None:
            return None
        radius = np.clip(np.hypot(points[:, 0], points[:, 1]), self.tool_radius, self.plate_radius)
        radii, place = np.unique(np.concatenate([[self.tool_radius, self.plate_radius], radius]), return_inverse=True)
        turn = _turn(law, self._log_rates(law, wall, radii))[place]
        spin = (self.angular_speed / turn[0] * turn)[2:]  # turn[0] is ω to the tolerance of the root
        log_stress = float(_log_stress(law, np.array([wall])).coefficient(0)[0])
        torque = 2.0 * np.pi * self.tool_radius**2 * np.exp(log_stress)
        return Exact(np.stack([-spin * points[:, 1], spin * points[:, 0]], axis=1), {"torque": float(torque)})

    def _wall_log_rate(self, law: ConstitutiveLaw) -> float | None:
        """log γ̇ at the tool. It is at least log(ω / log(r_p/r_t)), because no γ̇ exceeds that at the tool."""
        walls = np.array([self.tool_radius, self.plate_radius])

        def excess(wall: float) -> float:
            return float(np.log(_turn(law, self._log_rates(law, wall, walls))[0] / self.angular_speed))

        low = float(np.log(self.angular_speed / np.log(self.plate_radius / self.tool_radius)))
        slope = _log_stress(law, np.linspace(SLOWEST, low + FASTEST, 4000)).coefficient(1)
        if not (slope > 0.0).all() or not excess(low) <= 0.0 <= excess(low + FASTEST):
            return None
        return float(scipy.optimize.brentq(excess, low, low + FASTEST, xtol=1e-14))

    def _log_rates(self, law: ConstitutiveLaw, wall: float, radii: np.ndarray) -> np.ndarray:
        """log γ̇ at `radii` (R,) where it is `wall` at the tool: log τ is less by 2 log(r/r_t)."""
        at_wall = _log_stress(law, np.array([wall])).coefficient(0)
        return _log_rate(law, at_wall - 2.0 * np.log(radii / self.tool_radius), wall)


def _log_stress(law: ConstitutiveLaw, log_rate: np.ndarray) -> Series:
    """log τ = log μ(γ̇²/3) + s at s = log γ̇, of any shape; coefficient 1 is d log τ/ds, the index of the law there."""
    s = Series.seed(log_rate)
    return s + np.log(law.viscosity(np.exp(2.0 * s) / 3.0))


def _log_rate(law: ConstitutiveLaw, log_stress: np.ndarray, largest: float) -> np.ndarray:
    """The inverse of log τ(s), shape (R,), between SLOWEST and `largest`: Newton's method, halving where it leaves."""
    low, high = np.full_like(log_stress, SLOWEST), np.full_like(log_stress, largest)
    s = high.copy()
    for _ in range(200):
        found = _log_stress(law, s)
        excess = found.coefficient(0) - log_stress
        low, high = np.where(excess < 0.0, s, low), np.where(excess > 0.0, s, high)
        newton = s - excess / found.coefficient(1)
        before, s = s, np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        if np.abs(s - before).max() <= 1e-12:  # and by Newton's rate the last step left far less
            break
    return s


def _turn(law: ConstitutiveLaw, log_rates: np.ndarray) -> np.ndarray:
    """½ ∫ γ̇ d log τ from the smallest of `log_rates` (R,) to each of them, shape (R,) [rad/s]."""
    low, high = log_rates.min(), log_rates.max()
    knots = np.union1d(log_rates, np.linspace(low, high, 2 + int((high - low) / PANEL)))
    half = 0.5 * np.diff(knots)[:, None]
    s = 0.5 * (knots[1:] + knots[:-1])[:, None] + half * GAUSS[0]
    panels = 0.5 * (half * np.exp(s) * _log_stress(law, s).coefficient(1)) @ GAUSS[1]
    return np.concatenate([[0.0], np.cumsum(panels)])[np.searchsorted(knots, log_rates)]
