"""u ← u − t K*⁻¹ R(u) : Newton's method and modified Newton, which differ in the refresh rule of K* only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import KeptTangent, NonlinearProblem, NonlinearSolver, Step
from nlsolve_newton.line_search import LineSearch, search


class Newton(NonlinearSolver):
    """K* w = −R(u),  u ← u + t w,  the length t from a line search:

    residual :     ‖R‖ must fall at each step; t is halved.
    parabola :     the same; t by interpolation.
    non-monotone : ‖R‖ must fall below the largest of its last ten values; t is halved.
    energy :       for an R that is the gradient of a convex potential, which must fall.

    The refresh rule is told what the step left of the residual.
    """

    kind: Literal["newton"] = "newton"
    line_search: LineSearch = Field("residual", description="what a step length must reduce, and how it is found")
    halvings: int = Field(10, ge=0, description="lengths t that may be tried besides the full step; 0: full steps")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        line_search = search(self.line_search, self.halvings, problem)
        state = start
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            tangent.refresh_if_due(problem, state)
            direction = -tangent.solve(residual)
            length, residual = line_search.length(problem, state, residual, direction)
            state = state + length * direction
            contraction = float(np.linalg.norm(residual)) / size if size else 0.0
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"length": length, "contraction": contraction})


class ModifiedNewton(Newton):
    """Newton's iteration with a tangent kept across iterations and increments until it contracts poorly."""

    kind: Literal["modified-newton"] = "modified-newton"  # type: ignore[assignment]
    default_refresh: ClassVar = {"kind": "poor-contraction"}
