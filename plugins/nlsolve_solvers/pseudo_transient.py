"""(J + σ D) w = −R(u),  u ← u + w,  σ ← σ ‖R_new‖/‖R_old‖ : pseudo-transient continuation, in the end Newton."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Expansion, KeptTangent, NonlinearProblem, NonlinearSolver, Step


class PseudoTransient(NonlinearSolver):
    """Implicit Euler steps of D du/dt = −R(u), one Newton iteration each, with D = diag(J_ii): a time step of 1/σ in
    units of each unknown's own time, which runs backwards where J_ii < 0. It grows as the residual falls (switched
    evolution relaxation: Mulder & van Leer 1985; Kelley & Keyes 1998): far away the path to rest is followed, near it
    Newton's steps are taken, and no length is searched for.
    """

    kind: Literal["pseudo-transient"] = "pseudo-transient"
    shift: float = Field(1.0, gt=0, description="σ of the first step; 1/σ is its length in time")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        state, shift = start, self.shift
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            tangent.refresh_if_due(Damped(problem, shift), state)
            state = state - tangent.solve(residual)
            residual = problem.residual(state)
            contraction = float(np.linalg.norm(residual)) / size if size else 0.0
            shift *= contraction
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"contraction": contraction})


class Damped(NonlinearProblem):
    """R(u) = 0 as the kept tangent shall see it: J + σ D."""

    def __init__(self, problem: NonlinearProblem, shift: float) -> None:
        self._problem, self._shift = problem, shift

    def residual(self, u: np.ndarray) -> np.ndarray:
        return self._problem.residual(u)

    def jacobian(self, u: np.ndarray) -> Any:
        return self._problem.jacobian(u).damped(self._shift)

    def expand(self, u: np.ndarray) -> Expansion:
        return self._problem.expand(u)
