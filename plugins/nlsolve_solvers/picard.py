"""u ← u − β A(u)⁻¹ R(u),  R(u) = A(u) u + c(u) : Picard's iteration, whose matrix holds the coefficients fixed."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import NonlinearProblem
from nlsolve_solvers.anderson import Anderson


class Picard(Anderson):
    """A(u_k) u_{k+1} = −c(u_k), written as a correction u_{k+1} = u_k − A(u_k)⁻¹ R(u_k): the same iterates, and the one
    form of the two that still ends at R = 0 when the refresh rule keeps A of an earlier state. β < 1 relaxes, β > 1
    goes further; `depth` mixes as in `anderson`. For a power law of index n the error contracts by 1 − n per iteration.
    """

    kind: Literal["picard"] = "picard"  # type: ignore[assignment]
    depth: int = Field(0, ge=0, description="m, differences of past iterates that are mixed; 0: none")
    damping: float = Field(1.0, gt=0, lt=2, description="β, relaxation of the correction")
    default_refresh: ClassVar = {"kind": "every-iteration"}
    uses_operator: ClassVar[bool] = False

    def matrix(self, problem: NonlinearProblem, state: np.ndarray) -> Any:
        """A(u)."""
        return problem.secant(state)
