"""‖R(u + t w)‖ ≤ (1 − 10⁻⁴ t (1 − η)) · the largest of the last m values of ‖R‖, t shrunk from 1 until that holds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalization, NonlinearProblem, Search, norm

SUFFICIENT_DECREASE = 1e-4  # of ‖R‖, as part of the decrease predicted per unit of step length (Armijo 1966)
OVER = 1e30  # larger ratios of residuals are set to this, so that their fourth power stays finite
SHORTEST, LONGEST = 0.1, 0.5  # the next length over the last one (Dennis & Schnabel 1983, A6.3.1)

ComparedBy = Literal["euclidean", "equations"]
COMPARED_BY = (
    "how residuals are compared: by ‖R‖₂, or by each equation over the largest terms that it has had, which no unit "
    "changes (the same for a flow)"
)

Trials = list[tuple[float, float]]
"""Lengths t tried so far and the ‖R(u + t w)‖/‖R(u)‖ found there."""


class Backtracking(Globalization):
    """‖R‖ must fall at each step; t is halved. After `trials` lengths the one with the smallest residual is taken."""

    kind: Literal["backtracking"] = "backtracking"
    trials: int = Field(10, gt=0, description="lengths t that may be tried besides the full step")
    measure: ComparedBy = Field("equations", description=COMPARED_BY)

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve; a step is compared with the last residual alone."""
        return LeastResidual(self.trials, 1, halved, self.measure)


class NonMonotone(Backtracking):
    """‖R‖ must fall below the largest of its last values; t is halved (Grippo, Lampariello & Lucidi 1986)."""

    kind: Literal["non-monotone"] = "non-monotone"  # type: ignore[assignment]
    memory: int = Field(10, gt=0, description="m, residuals the largest of which a step is compared with")

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve; a step is compared with the largest of the last m residuals."""
        return LeastResidual(self.trials, self.memory, halved, self.measure)


class Cubic(Backtracking):
    """‖R‖ must fall at each step; t is where a polynomial through what is known of ‖R‖² along w is least."""

    kind: Literal["cubic"] = "cubic"  # type: ignore[assignment]

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve; a step is compared with the last residual alone."""
        return LeastResidual(self.trials, 1, interpolated, self.measure)


class LeastResidual:
    """The search of these three; they differ in how many residuals a step is compared with, and in the next t."""

    def __init__(
        self, trials: int, memory: int, shorter: Callable[[Trials, float], float], measure: ComparedBy = "equations"
    ) -> None:
        self._trials, self._shorter, self._measure = trials, shorter, measure
        self._sizes: deque[float] = deque(maxlen=memory)

    def length(
        self,
        problem: NonlinearProblem,
        state: np.ndarray,
        residual: np.ndarray,
        direction: np.ndarray,
        predicted_decrease: float = 1.0,
    ) -> tuple[float, np.ndarray]:
        """The first t with enough decrease, else the best of those tried; and R(u + t w), (U,)."""
        size = compared(problem, residual, self._measure)
        self._sizes.append(size)
        length, best_length, best_size, best = 1.0, 1.0, np.inf, residual
        tried: Trials = []
        for _ in range(self._trials + 1):
            trial = problem.residual(state + length * direction)
            trial_size = compared(problem, trial, self._measure)
            if trial_size < best_size or not np.isfinite(best_size):
                best_length, best_size, best = length, trial_size, trial
            if not size or trial_size <= (1.0 - SUFFICIENT_DECREASE * length * predicted_decrease) * max(self._sizes):
                break
            tried.append((length, min(trial_size / size, OVER)))
            length = self._shorter(tried, predicted_decrease)
        return best_length, best


def compared(problem: NonlinearProblem, residual: np.ndarray, measure: ComparedBy) -> float:
    """‖R‖, as searches compare it."""
    return problem.size(residual) if measure == "equations" else norm(residual)


def halved(tried: Trials, predicted_decrease: float) -> float:
    """t/2."""
    return 0.5 * tried[-1][0]


def interpolated(tried: Trials, predicted_decrease: float) -> float:
    """The least point of φ(t) = ‖R(u + t w)‖²/‖R(u)‖², with φ(0) = 1, φ′(0) = −2 (1 − η) and the last values of φ: of a
    parabola after the first trial, of a cubic after that; within [0.1, 0.5] of the last t (Dennis & Schnabel 1983).
    """
    t, ratio = tried[-1]
    slope = -2.0 * predicted_decrease
    over = (ratio**2 - 1.0 - slope * t) / t**2  # of φ over its tangent at 0, over t²: c + d t
    if len(tried) == 1:
        least = -slope / (2.0 * over)
    else:
        s, before = tried[-2]
        over_before = (before**2 - 1.0 - slope * s) / s**2
        d = (over - over_before) / (t - s)
        c = over - d * t
        root = c**2 - 3.0 * d * slope  # φ′ = 3 d t² + 2 c t + slope = 0, at the larger root; of a parabola for d = 0
        least = -slope / (c + np.sqrt(root)) if root >= 0.0 else np.inf
    return float(np.clip(least, SHORTEST * t, LONGEST * t)) if np.isfinite(least) and least > 0.0 else SHORTEST * t
