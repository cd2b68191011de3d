"""−Δu = λ eᵘ in the unit interval or square, u = 0 on its boundary: Bratu's problem, with two roots, one or none."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy
from pydantic import Field
from scipy.linalg import solve_banded

from nlsolve.plugin import System
from nlsolve_systems.grids import minus_laplacian, on_points, places

STEEPEST = 1e3  # u′(0) up to which roots are looked for
BISECTIONS = 80
SHOT = 1023  # most points that roots are shot over
REFINEMENTS, REFINED = 30, 1e-13  # Newton's steps on a finer grid, and the last of them over the largest |u|


class Bratu(System):
    """By second differences. Below the fold (λ = 3.5138 in one dimension, 6.8081 in two; Boyd 1986) there is a lower
    and an upper root; a start of amplitude 0 leads to the lower one, one of 4 or more towards the upper.
    """

    kind: Literal["bratu"] = "bratu"
    strength: float = Field(1.0, ge=0, description="λ")
    dimension: Literal[1, 2] = Field(1, description="dimension of the domain")
    nodes: int = Field(32, gt=1, description="N, inner points on a side")
    amplitude: float = Field(0.0, ge=0, description="of the start, amplitude · sin πx (sin πy)")

    def formula(self, u: Any) -> Any:
        """−Δu − λ eᵘ by second differences."""
        return minus_laplacian(self.nodes, self.dimension) @ u - self.strength * np.exp(u)

    def standard_start(self) -> np.ndarray:
        """amplitude · sin πx, or amplitude · sin πx sin πy."""
        return self.amplitude * on_points(np.sin(np.pi * places(self.nodes)), self.dimension)

    def pattern(self) -> Any:
        """The pattern of the discrete Laplacian."""
        return minus_laplacian(self.nodes, self.dimension)

    def roots(self) -> np.ndarray | None:
        """In one dimension, by shooting: u_1 with u_{N+1} = 0 in u_{k+1} = 2 u_k − u_{k−1} − h² λ e^{u_k}; on a grid of
        more than `SHOT` points by Newton's steps from the roots on one of `SHOT`.
        """
        if self.dimension == 2:
            return None
        if self.nodes > SHOT:
            coarse = self.model_copy(update={"nodes": SHOT}).roots()
            refined = [] if coarse is None else [self._refined(root) for root in coarse]
            found = [root for root in refined if root is not None]
            return np.array(found) if found else None
        first = np.geomspace(1e-6, STEEPEST, 400).astype(np.longdouble) / (self.nodes + 1)
        ends = self._shoot(first)[-1]
        crossings = np.flatnonzero((ends[1:] > 0.0) != (ends[:-1] > 0.0))
        low, high, rising = first[crossings], first[crossings + 1], ends[crossings + 1] > ends[crossings]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            behind = (self._shoot(middle)[-1] > 0.0) == rising
            low, high = np.where(behind, low, middle), np.where(behind, middle, high)
        return self._shoot(low)[:-1].T.astype(float) if len(low) else None

    def _refined(self, coarse: np.ndarray) -> np.ndarray | None:
        """The root near one on `SHOT` points, whose corrections are solved for in double precision; None if they do not
        become small.
        """
        ends = np.linspace(0.0, 1.0, SHOT + 2)
        u = scipy.interpolate.CubicSpline(ends, [0.0, *coarse, 0.0])(places(self.nodes)).astype(np.longdouble)
        square = np.longdouble(self.nodes + 1) ** 2
        bands = np.full((3, self.nodes), -float(square))
        for _ in range(REFINEMENTS):
            growth = self.strength * np.exp(u)
            residual = square * (2.0 * u - np.append(u[1:], 0.0) - np.append(0.0, u[:-1])) - growth
            bands[1] = 2.0 * float(square) - growth.astype(float)
            step = solve_banded((1, 1), bands, residual.astype(float))
            u = u - step
            if np.abs(step).max() <= REFINED * np.abs(u).max():
                return u.astype(float)
        return None

    def _shoot(self, first: np.ndarray) -> np.ndarray:
        """u_1 … u_{N+1} for each of the u_1, (N + 1, K)."""
        before, now, h = np.zeros_like(first), first, np.longdouble(1) / (self.nodes + 1)
        values = [now]
        for _ in range(self.nodes):
            before, now = now, 2.0 * now - before - h**2 * self.strength * np.exp(np.minimum(now, STEEPEST))
            values.append(now)
        return np.array(values)
