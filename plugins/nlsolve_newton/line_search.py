"""u + t w : how long a step may be. Each search gives t and the residual there."""

from __future__ import annotations

from collections import deque
from typing import Literal, Protocol

import numpy as np

from nlsolve import NonlinearProblem, SolveError, Status

SUFFICIENT_DECREASE = 1e-4  # of ‖R‖ per unit of step length (Armijo)
SLOPE_LEFT = 0.1  # of the potential along the direction, over the first: small enough to stop searching
MEMORY = 10  # residuals the largest of which a non-monotone search compares with
SHORTEST, LONGEST = 0.1, 0.5  # the next length over the last one (Dennis & Schnabel 1983, A6.3.1)

LineSearch = Literal["residual", "parabola", "non-monotone", "energy"]


class Search(Protocol):
    """A line search of one solve; it may remember the steps before."""

    def length(
        self, problem: NonlinearProblem, state: np.ndarray, residual: np.ndarray, direction: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Step length t and R(state + t direction)."""


def search(kind: LineSearch, halvings: int, problem: NonlinearProblem) -> Search:
    """The search of this name for one solve. Raises SolveError where the problem gives it nothing to search on."""
    if kind != "energy":
        return LeastResidual(halvings, MEMORY if kind == "non-monotone" else 1, interpolate=kind == "parabola")
    if not problem.is_gradient:
        raise SolveError(
            Status.NOT_APPLICABLE,
            'line_search = "energy" needs a residual with a potential: choose a conservative discretizer '
            '(form = "conservative", or "delaunay"), without convection',
        )
    return LeastEnergy(halvings)


class LeastResidual:
    """‖R(u + t w)‖ ≤ (1 − 10⁻⁴ t) · the largest of the last `memory` values of ‖R‖, t shrunk from 1 until that holds.

    memory = 1 asks for a decrease at each step (Armijo 1966), memory > 1 over several (Grippo, Lampariello & Lucidi
    1986). t is halved, or set where the parabola through ‖R‖² at 0 and t with the slope −2 ‖R‖² of a Newton step has
    its least value. When no length tried is enough the one with the smallest residual is taken.
    """

    def __init__(self, halvings: int, memory: int, interpolate: bool) -> None:
        self._halvings, self._interpolate = halvings, interpolate
        self._sizes: deque[float] = deque(maxlen=memory)

    def length(
        self, problem: NonlinearProblem, state: np.ndarray, residual: np.ndarray, direction: np.ndarray
    ) -> tuple[float, np.ndarray]:
        size = float(np.linalg.norm(residual))
        self._sizes.append(size)
        length = best_length = 1.0
        best_size, best = np.inf, residual
        for trial_number in range(self._halvings + 1):
            trial = problem.residual(state + length * direction)
            trial_size = float(np.linalg.norm(trial))
            if trial_size < best_size or trial_number == 0:
                best_length, best_size, best = length, trial_size, trial
            if trial_size <= (1.0 - SUFFICIENT_DECREASE * length) * max(self._sizes):
                break
            length *= self._shrink(length, trial_size / size) if self._interpolate and size else 0.5
        return best_length, best

    @staticmethod
    def _shrink(t: float, ratio: float) -> float:
        """The least point of 1 − 2 x + c x², with c from its value ratio² at t, over t; within [0.1, 0.5]."""
        curvature = (ratio**2 - 1.0 + 2.0 * t) / t**2
        return float(np.clip(1.0 / (curvature * t), SHORTEST, LONGEST)) if np.isfinite(curvature) else SHORTEST


class LeastEnergy:
    """For an R that is the gradient of a convex potential Φ. Its slope R(u + t w)·w rises with t from R(u)·w < 0 to
    zero where Φ is least; a full step is taken when it ends before that point or just behind it, else t is found there
    by regula falsi, which cannot fail.
    """

    def __init__(self, halvings: int) -> None:
        self._halvings = halvings

    def length(
        self, problem: NonlinearProblem, state: np.ndarray, residual: np.ndarray, direction: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """The slope is bracketed once a trial lies behind its zero."""
        before, low = float(residual @ direction), 0.0
        high, behind = np.inf, np.inf
        slope_low, following = before, 1.0
        for _ in range(self._halvings + 1):
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
