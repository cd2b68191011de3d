"""(J + σ D) w = −R(u),  u ← u + w,  σ ← σ ‖R_new‖/‖R_old‖ : pseudo-transient continuation, in the end Newton."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, Step, norm


class PseudoTransient(NonlinearSolver):
    """Implicit Euler steps of D du/dt = −R(u), one Newton iteration each, with D = diag(J_ii): a time step of 1/σ in
    units of each unknown's own time, which runs backwards where J_ii < 0. It grows as the residual falls (switched
    evolution relaxation: Mulder & van Leer 1985; Kelley & Keyes 1998): far away the path to rest is followed, near it
    Newton's steps are taken, and no length is searched for.
    """

    kind: Literal["pseudo-transient"] = "pseudo-transient"
    shift: float = Field(1.0, gt=0, description="σ of the first step; 1/σ is its length in time")
    measure: Literal["euclidean", "equations"] = Field(
        "equations",
        description="how residuals are compared: by ‖R‖₂, or by each equation over the largest terms that it has had, "
        "which no unit changes (the same for a flow)",
    )

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        for step, _ in self.steps_and_residuals(problem, tangent, start):
            yield step

    def steps_and_residuals(
        self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray
    ) -> Iterator[tuple[Step, np.ndarray]]:
        """The iterates with R(u_0), R(u_1), …, for a method that needs both."""
        state, shift = start, self.shift
        residual = problem.residual(state)
        yield Step(state), residual
        while True:
            size = self._size(problem, residual)
            tangent.refresh_if_due(lambda: damped(problem.jacobian(state), shift))
            state = state - tangent.solve(residual)
            residual = problem.residual(state)
            shift *= self._size(problem, residual) / size if size else 0.0
            yield Step(state), residual

    def _size(self, problem: NonlinearProblem, residual: np.ndarray) -> float:
        return problem.size(residual) if self.measure == "equations" else norm(residual)


def damped(jacobian: Any, shift: float) -> Any:
    """J + σ D: each J_ii grows in its own direction, and cannot be cancelled."""
    return jacobian + sp.diags_array(shift * jacobian.diagonal())
