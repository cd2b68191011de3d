"""u ← u − t K*⁻¹ R(u) : Newton's method and modified Newton, which differ in the refresh rule of K* only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalized, KeptTangent, NonlinearProblem, NonlinearSolver, Step


class Newton(NonlinearSolver):
    """K* w = −R(u),  u ← u + t w,  the length t from a globalisation."""

    kind: Literal["newton"] = "newton"
    globalization: Globalized = Field(  # type: ignore[assignment]
        {"kind": "backtracking"}, description="how the step length t is found"
    )
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        for step, _ in self.steps_and_residuals(problem, tangent, start):
            yield step

    def steps_and_residuals(
        self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray
    ) -> Iterator[tuple[Step, np.ndarray]]:
        """The iterates with R(u_0), R(u_1), …, for a method that needs both."""
        search = self.globalization.search(problem)
        state, residual = start, problem.residual(start)
        yield Step(state), residual
        while True:
            tangent.refresh_if_due(lambda: problem.operator(state))
            direction = -tangent.solve(residual)
            length, residual = search.length(problem, state, residual, direction)
            state = state + length * direction
            yield Step(state, notes={"length": length}), residual
