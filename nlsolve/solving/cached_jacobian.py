"""J(u), assembled only once while u stays the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


def cached_jacobian(problem: NonlinearProblem) -> Callable[[Array], Any]:
    """u -> J(u), sparse (U, U), which keeps the last J.

    For a method that both factorises J into K* and multiplies with it at the same u (U,).
    """
    last: tuple[Array, Any] | None = None

    def jacobian(u: Array) -> Any:
        nonlocal last
        if last is None or not np.array_equal(last[0], u):
            last = u.copy(), problem.jacobian(u)
        return last[1]

    return jacobian
