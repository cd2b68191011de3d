"""1 − 2 (1 − c) t (1 − η) ≤ ‖R(u + t w)‖²/‖R(u)‖² ≤ 1 − 2 c t (1 − η) : neither too long a step nor too short a one."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import NonlinearProblem, Search
from nlsolve_rules.least_residual import OVER, Backtracking, ComparedBy, Trials, compared, interpolated


class Goldstein(Backtracking):
    """‖R‖² must fall by a good part of what its slope promises (Goldstein 1965), and where it falls by nearly all of
    that before t = 1, the step is made longer: t is interpolated down, then bisected up.

    The line search of KINSOL has these two bounds, the upper one with 10⁻⁴ for c: a full step that hardly gains is
    taken there, and cut here.
    """

    kind: Literal["goldstein"] = "goldstein"  # type: ignore[assignment]
    fraction: float = Field(0.1, gt=0, lt=0.5, description="c, part of the promised decrease")

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve, which remembers nothing."""
        return TwoSided(self.trials, self.fraction, self.measure)


class TwoSided:
    """The search between the two bounds; t ≤ 1. Where `trials` lengths do not meet them, the best of those is taken."""

    def __init__(self, trials: int, fraction: float, measure: ComparedBy) -> None:
        self._trials, self._fraction, self._measure = trials, fraction, measure

    def length(
        self,
        problem: NonlinearProblem,
        state: np.ndarray,
        residual: np.ndarray,
        direction: np.ndarray,
        predicted_decrease: float = 1.0,
    ) -> tuple[float, np.ndarray]:
        """The first t within the bounds, else the best of those tried; and R(u + t w), (U,)."""
        size = compared(problem, residual, self._measure)
        short, long, length = 0.0, 1.0, 1.0  # t that is too short, t that is too long, the next one
        best_length, least, best = 1.0, np.inf, residual
        tried: Trials = []
        for _ in range(self._trials + 1):
            trial = problem.residual(state + length * direction)
            ratio = compared(problem, trial, self._measure) / size if size else 0.0
            if ratio < least or not np.isfinite(least):
                best_length, least, best = length, ratio, trial
            ratio = min(ratio, OVER)
            gained, promised = 1.0 - ratio**2, 2.0 * predicted_decrease * length
            if gained >= self._fraction * promised:
                if length == 1.0 or gained <= (1.0 - self._fraction) * promised:
                    return length, trial
                short = length
            else:
                long = length
            tried.append((length, ratio))
            length = 0.5 * (short + long) if short else interpolated(tried, predicted_decrease)
        return best_length, best
