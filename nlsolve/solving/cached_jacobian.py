"""J(u), assembled once for all who ask at the same u."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.series import Array


class AssembledOnce(NonlinearProblem):
    """R(u) = 0 with the last Jacobian remembered: what K* is made of serves the products too."""

    def __init__(self, problem: NonlinearProblem) -> None:
        self._problem = problem
        self._last: tuple[Array, Any] | None = None

    def residual(self, u: Array) -> Array:
        return self._problem.residual(u)

    def jacobian(self, u: Array) -> Any:
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), self._problem.jacobian(u)
        return self._last[1]

    def expand(self, u: Array) -> Expansion:
        return self._problem.expand(u)
