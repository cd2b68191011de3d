"""B_{k+1} = B_k + (y − B_k s) sᵀ/(sᵀs),  u ← u − B_k⁻¹ R(u) : Broyden's good method, begun with B_0 = K*."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Globalized, KeptTangent, NonlinearProblem, NonlinearSolver, Step, unit

LONGEST = 0.9  # 1 − (sᵀs + sᵀv)/sᵀs: beyond it the next full step would be more than ten times z


class Broyden(NonlinearSolver):
    """Steps s = t w with w = −B_k⁻¹ R(u_k) give y − B_k s = R(u_{k+1}) − (1 − t) R(u_k), and by Sherman and Morrison

        z = −B_k⁻¹ R(u_{k+1}),   v = (1/t − 1) s − z,   c = −v/(sᵀs + sᵀv),   next w = z + c sᵀz,

    where B_k⁻¹ is K*⁻¹ followed by z ← z + c_j s_jᵀz for the pairs (s_j, c_j) before (Broyden 1965; Kelley 1995, 7.3
    and 8.3). One solve a step, and one residual where it is full. The updates begin anew with a new K*, after `memory`
    steps, and when (sᵀs + sᵀv)/sᵀs comes near zero (Deuflhard, Freund & Walter 1990).
    """

    kind: Literal["broyden"] = "broyden"
    memory: int = Field(20, gt=0, description="steps kept before the updates begin anew")
    globalization: Globalized = Field(  # type: ignore[assignment]
        {"kind": "none"}, description="how the step length t is found"
    )
    default_refresh: ClassVar = {"kind": "poor-contraction"}
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        state, updates = start, Updates()
        residual, search = problem.residual(state), self.globalization.search(problem)
        yield Step(state)
        while True:
            if tangent.refresh_if_due(lambda: problem.operator(state)) or updates.count == self.memory:
                updates = Updates()
            plain = -tangent.solve(residual)
            direction = updates.next(plain)
            if direction is None:
                updates, direction = Updates(), plain
            length, residual = search.length(problem, state, residual, direction)
            updates.took(length * direction, length)
            state = state + length * direction
            yield Step(state, notes={"length": length})


class Updates:
    """The pairs (s_j, c_j) so far, and the last step s = t w, for which there is no c yet."""

    def __init__(self) -> None:
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []
        self._last: tuple[np.ndarray, float] | None = None

    @property
    def count(self) -> int:
        """Updates in B."""
        return len(self._pairs)

    def took(self, step: np.ndarray, length: float) -> None:
        """The step s = t w was taken."""
        self._last = step, length

    def next(self, z: np.ndarray) -> np.ndarray | None:
        """The next w from −K*⁻¹ R(u_{k+1}); None when the updates would lengthen it too much."""
        for s, c in self._pairs:
            z = z + c * (s @ z)
        if self._last is None:
            return z
        step, length = self._last
        v = (1.0 / length - 1.0) * step - z
        s = step / unit(step)  # a power of two, which keeps squares finite and rounds nothing
        v = v / unit(step)
        square = float(s @ s)
        left = square + float(s @ v)
        if not left > (1.0 - LONGEST) * square:
            return None
        self._pairs.append((s, -v / left))
        return z - v * (s @ z) / left
