"""B_{k+1} = B_k + (y − B_k s) sᵀ/(sᵀs),  u ← u − B_k⁻¹ R(u) : Broyden's good method, begun with B_0 = K*."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import KeptTangent, NonlinearProblem, NonlinearSolver, Step

LONGEST = 0.9  # sᵀz/sᵀs: beyond it the next step would be more than ten times what K* alone proposes


class Broyden(NonlinearSolver):
    """With full steps y − B_k s = R(u_{k+1}), so the steps alone hold all updates (Broyden 1965; Kelley 1995, 7.3):

        z = −K*⁻¹ R(u_{k+1}),   z ← z + s_{j+1} (s_jᵀz)/(s_jᵀs_j), j = 0 … k − 1,   s_{k+1} = z/(1 − s_kᵀz/s_kᵀs_k).

    One solve and one residual a step. The updates begin anew with a new K*, after `memory` steps, and when
    1 − s_kᵀz/s_kᵀs_k comes near zero (Deuflhard, Freund & Walter 1990).
    """

    kind: Literal["broyden"] = "broyden"
    memory: int = Field(20, gt=0, description="steps kept before the updates begin anew")
    default_refresh: ClassVar = {"kind": "poor-contraction"}

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        state, kept = start, list[np.ndarray]()
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = float(np.linalg.norm(residual))
            if tangent.refresh_if_due(problem, state) or len(kept) > self.memory:
                kept = []
            plain = -tangent.solve(residual)
            step = self._updated(plain, kept)
            if step is None:
                kept, step = [], plain
            kept.append(step)
            state = state + step
            residual = problem.residual(state)
            contraction = float(np.linalg.norm(residual)) / size if size else 0.0
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"contraction": contraction})

    @staticmethod
    def _updated(z: np.ndarray, kept: list[np.ndarray]) -> np.ndarray | None:
        """s_{k+1} from z = −K*⁻¹ R(u_{k+1}) and s_0 … s_k; None when the updates would lengthen it too much."""
        if not kept:
            return z
        for s, following in pairwise(kept):
            z = z + following * (s @ z) / (s @ s)
        s = kept[-1]
        overlap = float(s @ z) / float(s @ s)
        return z / (1.0 - overlap) if overlap < LONGEST else None
