"""u ← u − K*⁻¹ R(u), mixed with the iterates before : modified Newton under Anderson acceleration."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalized, KeptTangent, Mixing, NonlinearProblem, NonlinearSolver, Step


class Anderson(NonlinearSolver):
    """f(u) = −K*⁻¹ R(u), and the next u from the last m + 1 pairs (u, f) (`mixing`). On a linear problem the iterates
    are as good as GMRES with K* as preconditioner (Walker & Ni 2011), at one solve each. When a K* that was kept is
    renewed f is another function, and the pairs before are forgotten; a K* renewed at each iteration is part of one f.
    """

    kind: Literal["anderson"] = "anderson"
    depth: int = Field(5, ge=0, description="m, differences of past iterates that are mixed; 0: none")
    damping: float = Field(1.0, gt=0, le=1, description="β, part of f that is added")
    globalization: Globalized = Field(  # type: ignore[assignment]
        {"kind": "none"}, description="how far along the mixed step, 1 being all of it"
    )
    default_refresh: ClassVar = {"kind": "poor-contraction"}
    uses_operator: ClassVar[bool] = True

    def matrix(self, problem: NonlinearProblem, state: np.ndarray) -> Any:
        """The matrix that is factorised into K*, (U, U)."""
        return problem.operator(state)

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        state, kept = start, False
        residual, search = problem.residual(state), self.globalization.search(problem)
        mixing = Mixing(self.depth, self.damping)
        yield Step(state)
        while True:
            renewed = tangent.refresh_if_due(lambda: self.matrix(problem, state))
            if renewed and kept:
                mixing.forget()
            kept = not renewed
            direction = mixing.next(state, -tangent.solve(residual)) - state
            length, residual = search.length(problem, state, residual, direction)
            state = state + length * direction
            yield Step(state, notes={"length": length})
