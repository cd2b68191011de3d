"""min ‖R(u) + J s‖₂ over ‖s‖₂ ≤ Δ, on Powell's dogleg from the steepest descent to −K*⁻¹ R : a trust-region method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np

from nlsolve.plugin import (
    KeptTangent,
    NonlinearProblem,
    NonlinearSolver,
    SolveError,
    Status,
    Step,
    cached_jacobian,
    norm,
    unit,
)

ACCEPTED = 1e-4  # decrease of ‖R‖ over the predicted one from which a step is taken
POOR, GOOD = 0.25, 0.75  # the same ratio below which Δ is cut to a quarter of the step, above which it is doubled
SMALLEST = 1e-12  # Δ over ‖u‖ + ‖K*⁻¹ R‖: no decrease within it, no solution


class TrustRegion(NonlinearSolver):
    """Powell (1970). With g = Jᵀ R the path runs from 0 to the Cauchy point −g ‖g‖²/‖J g‖² and on to −K*⁻¹ R, and ends
    where it leaves the region; with a K* older than J its end need not be better than what lies before it, and then
    the region shrinks as it does for a poor model. At first Δ = ‖K*⁻¹ R‖.
    """

    kind: Literal["trust-region"] = "trust-region"
    default_refresh: ClassVar = {"kind": "poor-contraction"}
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …; raises SolveError (stagnated) when no step in the smallest region lowers ‖R‖."""
        jacobian, state, radius = cached_jacobian(problem), start, np.inf
        residual = problem.residual(state)
        yield Step(state)
        while True:
            tangent.refresh_if_due(lambda: jacobian.operator(state))
            chord = -tangent.solve(residual)
            if norm(residual) == 0.0:
                yield Step(state)
                continue
            if not np.isfinite(radius):
                radius = norm(chord)
            step, residual, radius = self._accepted(problem, jacobian(state), state, residual, chord, radius)
            state = state + step
            yield Step(state)

    @staticmethod
    def _accepted(
        problem: NonlinearProblem,
        jacobian: Any,
        state: np.ndarray,
        residual: np.ndarray,
        chord: np.ndarray,
        radius: float,
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """The first dogleg step of shrinking regions that ‖R‖ falls for, the residual there, and the next Δ."""
        size = norm(residual)
        cauchy = cauchy_point(jacobian, residual)
        smallest = SMALLEST * (norm(state) + norm(chord))
        while radius > smallest:
            step = dogleg(cauchy, chord, radius)
            length = norm(step)
            trial = problem.residual(state + step)
            predicted = size - norm(residual + jacobian @ step)
            ratio = (size - norm(trial)) / predicted if predicted > 0.0 else -1.0
            if not ratio >= POOR:
                radius = POOR * length
            elif ratio > GOOD:
                radius = max(radius, 2.0 * length)
            if ratio >= ACCEPTED:
                return step, trial, radius
        raise SolveError(Status.STAGNATED, f"no step within {radius:.1e} of the state lowers ‖R‖")


def cauchy_point(jacobian: Any, residual: np.ndarray) -> np.ndarray:
    """−g ‖g‖²/‖J g‖² with g = Jᵀ R: where ‖R + J s‖ is least along the steepest descent."""
    size = unit(residual)  # powers of two, which keep squares finite and round nothing
    gradient = jacobian.T @ (residual / size)
    steep = unit(gradient)
    gradient = gradient / steep
    along = jacobian @ gradient
    far = unit(along)
    along = along / far
    return (-gradient * (gradient @ gradient) / (along @ along)) * (steep / far) * (size / far)


def dogleg(cauchy: np.ndarray, chord: np.ndarray, radius: float) -> np.ndarray:
    """The point furthest along 0, `cauchy`, `chord` with ‖s‖ ≤ radius."""
    size = unit(chord)
    if size != 1.0:
        return size * dogleg(cauchy / size, chord / size, radius / size)
    if norm(chord) <= radius:
        return chord
    length = norm(cauchy)
    if length >= radius:
        return cauchy * (radius / length)
    # |cauchy + t leg|² = Δ²
    leg = chord - cauchy
    half, square = cauchy @ leg, leg @ leg
    t = (-half + np.sqrt(half**2 + square * (radius**2 - length**2))) / square
    return cauchy + t * leg
