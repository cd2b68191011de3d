"""u ← u − t K*⁻¹ R(u) : Newton's method and modified Newton, which differ in the refresh rule of K* only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalized, KeptTangent, NonlinearProblem, NonlinearSolver, Step


class Newton(NonlinearSolver):
    """K* w = −R(u),  u ← u + t w,  the length t from a globalisation.

    The refresh rule is told what the step left of the residual.
    """

    kind: Literal["newton"] = "newton"
    globalization: Globalized = Field(  # type: ignore[assignment]
        {"kind": "backtracking"}, description="how the step length t is found"
    )

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        search = self.globalization.search(problem)
        state = start
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            tangent.refresh_if_due(problem, state)
            direction = -tangent.solve(residual)
            length, residual = search.length(problem, state, residual, direction)
            state = state + length * direction
            contraction = float(np.linalg.norm(residual)) / size if size else 0.0
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"length": length, "contraction": contraction})
