"""When is a problem solved, and what may it cost? The stopping test, which is outside all methods, and the budget."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.contracts.nonlinear_solver import Step
from nlsolve.results.verdicts import VERIFIED
from nlsolve.series import Array


class StoppingTest(Component):
    """When is an increment solved?

    residual : ‖R(u)‖₂ / scale ≤ tolerance, R(u) evaluated by the driver and not timed. The fair test.
    difference : ‖u_i − u_{i−1}‖ / ‖u_i‖ ≤ tolerance in the named norm, the test of iterative "Algo2" in the 2015 paper.
    claim : the method reports a solution (a_max ≥ 1 for a series, with its own η), as for "Algo1" in the 2015 paper.
    """

    noun: ClassVar[str] = "stop"

    kind: Literal["residual", "difference", "claim"] = Field(
        "residual", description="what ends a solve: a small residual, a small step, or the claim of the method itself"
    )
    tolerance: float = Field(1e-8, gt=0, description="largest relative residual or relative difference accepted")
    norm: Literal["euclidean", "maximum", "components"] = Field(
        "euclidean", description="of a difference: over all nodes, its largest entry, or the larger of u's and v's norm"
    )

    @property
    def verified(self) -> float:
        """The relative residual up to which a state counts as a solution, whatever the method reports of it."""
        return self.tolerance if self.kind == "residual" else VERIFIED

    def met(self, step: Step, residual_norm: float, difference: float) -> bool:
        """Whether a step passes, with its relative residual and its relative difference from the step before."""
        if self.kind == "claim":
            return bool(step.claim)
        return (residual_norm if self.kind == "residual" else difference) <= self.tolerance

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
