"""R(u + t w)·w ≈ 0 : the potential that R is the gradient of, at its least along w."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalization, NonlinearProblem, Search, SolveError, Status

SLOPE_LEFT = 0.1  # slope of Φ along w over the one at t = 0: small enough to stop searching


class Energy(Globalization):
    """For an R that is the gradient of a convex potential: the potential falls at each step, even where ‖R‖ grows."""

    kind: Literal["energy"] = "energy"
    trials: int = Field(10, gt=0, description="lengths t that may be tried besides the full step")

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve. Raises SolveError (not applicable) if R has no potential."""
        if not problem.is_gradient:
            raise SolveError(
                Status.NOT_APPLICABLE,
                'the globalization "energy" needs a residual with a potential: choose a conservative discretizer '
                '(form = "conservative", or "delaunay"), without convection',
            )
        return LeastEnergy(self.trials)


class LeastEnergy:
    """The slope R(u + t w)·w rises with t from R(u)·w < 0 to zero where the potential Φ is least; a full step is taken
    when it ends before that point or just behind it, else t is found there by regula falsi, which cannot fail.
    """

    def __init__(self, trials: int) -> None:
        self._trials = trials

    def length(
        self,
        problem: NonlinearProblem,
        state: np.ndarray,
        residual: np.ndarray,
        direction: np.ndarray,
        predicted_decrease: float = 1.0,
    ) -> tuple[float, np.ndarray]:
        """t and R(u + t w), (U,). The zero of the slope is bracketed once a trial lies behind it."""
        before, low = float(residual @ direction), 0.0
        high, behind = np.inf, np.inf
        slope_low, following = before, 1.0
        for _ in range(self._trials + 1):
            length = following
            trial = problem.residual(state + length * direction)
            slope = float(trial @ direction)
            if (slope <= 0.0 and length == 1.0) or abs(slope) <= SLOPE_LEFT * abs(before):
                break
            if slope > 0.0 or not np.isfinite(slope):
                high, behind = length, slope
            else:
                low, slope_low = length, slope
            secant = low - slope_low * (high - low) / (behind - slope_low) if np.isfinite(behind) else low
            margin = 0.1 * (high - low)
            following = min(max(secant, low + margin), high - margin)
        return length, trial
