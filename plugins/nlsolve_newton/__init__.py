"""u ← u − t K*⁻¹ R(u) : Newton's method and modified Newton, which differ in the refresh rule of K* only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import (
    Component,
    KeptTangent,
    NonlinearProblem,
    NonlinearSolver,
    SolveError,
    Status,
    Step,
    hookimpl,
)

SUFFICIENT_DECREASE = 1e-4  # of ‖R‖ per unit of step length (Armijo)
SLOPE_LEFT = 0.1  # of the potential along the direction, over the first: small enough to stop searching


class Newton(NonlinearSolver):
    """K* w = −R(u),  u ← u + t w.

    residual : t is halved until ‖R(u + t w)‖ ≤ (1 − 10⁻⁴ t) ‖R(u)‖. When no length tried is enough the one with the
               smallest residual is taken, and the refresh rule is told.
    energy :   for an R that is the gradient of a convex potential Φ. Its slope R(u + t w)·w rises with t from R(u)·w
               < 0 to zero where Φ is least; a full step is taken when it ends before that point or just behind it, else
               t is found there by regula falsi, which cannot fail.
    """

    kind: Literal["newton"] = "newton"
    line_search: Literal["residual", "energy"] = Field("residual", description="what a step length must reduce")
    halvings: int = Field(10, ge=0, description="lengths t that may be tried besides the full step; 0: full steps")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        if self.line_search == "energy" and not problem.is_gradient:
            raise SolveError(
                Status.NOT_APPLICABLE,
                'line_search = "energy" needs a residual with a potential: choose a conservative discretizer '
                '(form = "conservative", or "delaunay"), without convection',
            )
        search = self._least_energy if self.line_search == "energy" else self._least_residual
        state = start
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            tangent.refresh_if_due(problem, state)
            direction = -tangent.solve(residual)
            length, residual = search(problem, state, residual, direction)
            state = state + length * direction
            contraction = float(np.linalg.norm(residual)) / size if size else 0.0
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"length": length, "contraction": contraction})

    def _least_residual(
        self, problem: NonlinearProblem, state: np.ndarray, residual: np.ndarray, direction: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Step length and the residual there."""
        size = float(np.linalg.norm(residual))
        best_length, best_size, best = 1.0, np.inf, residual
        for halving in range(self.halvings + 1):
            length = 0.5**halving
            trial = problem.residual(state + length * direction)
            trial_size = float(np.linalg.norm(trial))
            if trial_size < best_size or halving == 0:
                best_length, best_size, best = length, trial_size, trial
            if trial_size <= (1.0 - SUFFICIENT_DECREASE * length) * size:
                break
        return best_length, best

    def _least_energy(
        self, problem: NonlinearProblem, state: np.ndarray, residual: np.ndarray, direction: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Step length and the residual there. The slope is bracketed once a trial lies behind its zero."""
        before, low = float(residual @ direction), 0.0
        high, behind = np.inf, np.inf
        slope_low, length = before, 1.0
        for _ in range(self.halvings + 1):
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
            length = min(max(secant, low + margin), high - margin)
        return length, trial


class ModifiedNewton(Newton):
    """Newton's iteration with a tangent kept across iterations and increments until it contracts poorly."""

    kind: Literal["modified-newton"] = "modified-newton"  # type: ignore[assignment]
    default_refresh: ClassVar = {"kind": "poor-contraction"}


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Newton, ModifiedNewton]
