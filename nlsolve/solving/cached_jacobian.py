"""J(u), assembled only once while u stays the same."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


class CachedJacobian:
    """u -> J(u), sparse (U, U), which keeps the last J.

    For a method that both factorises J into K* and multiplies with it at the same u (U,).
    """

    def __init__(self, problem: NonlinearProblem) -> None:
        self._problem = problem
        self._last: tuple[Array, Any] | None = None

    def __call__(self, u: Array) -> Any:
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), self._problem.jacobian(u)
        return self._last[1]

    def operator(self, u: Array) -> Any:
        """What K* is made of at u, sparse (U, U): the J that is kept, unless the case has another operator."""
        return self(u) if self._problem.operator_is_jacobian else self._problem.operator(u)


def cached_jacobian(problem: NonlinearProblem) -> CachedJacobian:
    """J of a problem, kept while u stays the same."""
    return CachedJacobian(problem)
