"""Problems on which methods fail: they should say so by a status, and claim nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array

NEAR = 1e-4
"""Largest |u − u*| of a state that counts as the root u*."""


@dataclass(frozen=True)
class OddProblem:
    """One such problem. root : u* [–], where it has one."""

    name: str
    meaning: str
    formula: Callable[[Any], Any]
    start: Array
    root: float | None = None

    def problem(self) -> NonlinearProblem:
        """F(u) = 0, with Jacobian and series."""
        return FormulaProblem(self.formula, len(self.start))

    def is_root(self, state: Array) -> bool:
        """Whether a state (U,) is the root."""
        return self.root is not None and bool((np.abs(state - self.root) <= NEAR).all())


ODD = (
    OddProblem(
        "singular",
        "equations that contradict one another, with a singular Jacobian, end in a status",
        lambda u: np.stack([u[0] + u[1] - 1.0, 2.0 * u[0] + 2.0 * u[1] - 3.0]),
        np.array([0.3, 0.2]),
    ),
    OddProblem(
        "not a number",
        "a residual that is not a number where a step leads, √u + 1 at u < 0, ends in a status",
        lambda u: np.sqrt(u) + 1.0,
        np.array([1.0, 2.0]),
    ),
    OddProblem(
        "overflow",
        "a residual that overflows where a step leads, exp u − 1 from u = −20, ends in a status or at its root",
        lambda u: np.exp(u) - 1.0,
        np.array([-20.0, -19.0]),
        0.0,
    ),
)
