"""When is a problem solved, and what may it cost? The stopping test, which is outside all methods, and the budget."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.contracts.nonlinear_solver import Step
from nlsolve.contracts.problem import norm
from nlsolve.results.verdicts import ABSOLUTE, BY_RESIDUAL, VERIFIED
from nlsolve.series import Array


class StoppingTest(Component):
    """When is an increment solved?

    residual : the relative residual is at most the tolerance, evaluated by the driver and not timed. The fair test. For
        a flow it is ‖R(u)‖₂ over the size of the forces that cancel in it; for any other problem it is |F_i| over the
        size of what cancels in equation i, largest over all equations, and the Newton correction, which must be as
        small beside each unknown (`nlsolve.algebra.by_equation`): neither depends on units.
    absolute : ‖R(u)‖ ≤ tolerance in the named norm and in the problem's own unit, as published counts have it.
    difference : ‖u_i − u_{i−1}‖ / ‖u_i‖ ≤ tolerance in the named norm, the test of iterative "Algo2" in the 2015 paper.
    claim : the method reports a solution (a_max ≥ 1 for a series, with its own η), as for "Algo1" in the 2015 paper.
    """

    noun: ClassVar[str] = "stop"

    kind: Literal["residual", "absolute", "difference", "claim"] = Field(
        "residual",
        description="what ends a solve: a small residual, beside what cancels in it or absolute, a small step, or the "
        "claim of the method itself",
    )
    tolerance: float = Field(
        1e-8,
        gt=0,
        description="largest relative residual (of systems: and Newton correction over each unknown), ‖R‖, or relative "
        "difference accepted",
    )
    norm: Literal["euclidean", "maximum", "components"] = Field(
        "euclidean",
        description="of a difference or an absolute residual: over all nodes, its largest entry, or the larger of u's "
        "and v's norm",
    )

    @property
    def verified(self) -> float:
        """The relative residual up to which a state counts as a solution, whatever the method reports of it."""
        return self.tolerance if self.kind == "residual" else VERIFIED

    @property
    def is_of_residuals(self) -> bool:
        """Whether the test asks for the residual alone, so that what passes it is solved."""
        return self.kind in (BY_RESIDUAL, ABSOLUTE)

    def met(self, step: Step, solved: Callable[[], bool], difference: float) -> bool:
        """Whether a step passes, with its relative difference from the step before.

        solved : whether its residual is small enough, to `verified` or absolutely.
        """
        if self.kind == "claim":
            return bool(step.claim)
        return solved() if self.is_of_residuals else difference <= self.tolerance

    def size(self, residual: Array) -> float:
        """‖R‖ in the test's norm, R (U,)."""
        if self.norm == "components":
            return max(norm(residual[i::2]) for i in (0, 1))
        return float(np.abs(residual).max(initial=0.0)) if self.norm == "maximum" else norm(residual)

    def difference(self, state: Array, before: Array) -> float:
        """‖u_i − u_{i−1}‖ / ‖u_i‖ in the test's norm, u_i = `state` and u_{i−1} = `before` (U,);
        for "components" the larger of the two ratios.
        """
        if self.norm == "components":
            pairs = [(state[i::2], before[i::2]) for i in (0, 1)]
            return max(_relative(u - w, u, 2) for u, w in pairs)
        return _relative(state - before, state, np.inf if self.norm == "maximum" else 2)


def _relative(change: Array, value: Array, order: float) -> float:
    size = float(np.linalg.norm(value, order))
    moved = float(np.linalg.norm(change, order))
    return moved / size if size else (np.inf if moved else 0.0)


class Budget(Component):
    """What one increment may cost before it counts as failed."""

    noun: ClassVar[str] = "budget"

    iterations: int = Field(200, gt=0, description="iterations or series per increment")
