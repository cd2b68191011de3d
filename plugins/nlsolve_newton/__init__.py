"""u ← u − t K*⁻¹ R(u) : Newton's method and modified Newton, which differ in the refresh rule of K* only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import Component, KeptTangent, NonlinearProblem, NonlinearSolver, Step, hookimpl

SUFFICIENT_DECREASE = 1e-4  # of ‖R‖ per unit of step length (Armijo)


class Newton(NonlinearSolver):
    """K* w = −R(u),  u ← u + t w, with t halved until ‖R(u + t w)‖ ≤ (1 − 10⁻⁴ t) ‖R(u)‖.

    When no length tried is enough the one with the smallest residual is taken, and the refresh rule is told.
    """

    kind: Literal["newton"] = "newton"
    halvings: int = Field(10, ge=0, description="halvings of the step length t that may be tried; 0: full steps")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        state = start
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            tangent.refresh_if_due(problem, state)
            direction = -tangent.solve(residual)
            best_length, best_size = 0.0, np.inf
            for halving in range(self.halvings + 1):
                length = 0.5**halving
                trial = problem.residual(state + length * direction)
                trial_size = float(np.linalg.norm(trial))
                if trial_size < best_size or halving == 0:
                    best_length, best_size, residual = length, trial_size, trial
                if trial_size <= (1.0 - SUFFICIENT_DECREASE * length) * size:
                    break
            state = state + best_length * direction
            contraction = best_size / size if size else 0.0
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"length": best_length, "contraction": contraction})


class ModifiedNewton(Newton):
    """Newton's iteration with a tangent kept across iterations and increments until it contracts poorly."""

    kind: Literal["modified-newton"] = "modified-newton"  # type: ignore[assignment]
    default_refresh: ClassVar = {"kind": "poor-contraction"}


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Newton, ModifiedNewton]
