"""When is K* factorised anew? Rules shared by every method."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import RefreshRule, TangentHistory


class EveryIteration(RefreshRule):
    """At each iteration: Newton's rule."""

    kind: Literal["every-iteration"] = "every-iteration"

    def due(self, history: TangentHistory) -> bool:
        """True."""
        return True


class EveryM(RefreshRule):
    """After every m iterations or series, counted across increments (Shamanskii 1967)."""

    kind: Literal["every-m"] = "every-m"
    m: int = Field(5, gt=0, description="iterations or series a tangent serves")

    def due(self, history: TangentHistory) -> bool:
        """uses ≥ m."""
        return history.uses >= self.m


class PoorContraction(RefreshRule):
    """When the last step left more than `limit` of the residual."""

    kind: Literal["poor-contraction"] = "poor-contraction"
    limit: float = Field(0.5, gt=0, description="largest ‖R_new‖/‖R_old‖ with which a tangent is kept")

    def due(self, history: TangentHistory) -> bool:
        """contraction > limit."""
        return history.contraction is not None and not history.contraction <= self.limit


class CostOptimal(RefreshRule):
    """When the iterations left with this K* cost more than a factorisation and those left with a new one:

        d/lg(1/θ) > ratio + d/lg(1/θ_new)          θ: the contraction of the last step

    in units of one iteration, for d decimal digits of residual to be gained yet.
    """

    kind: Literal["cost-optimal"] = "cost-optimal"
    ratio: float = Field(40.0, ge=0, description="cost of a new tangent over that of an iteration: factor_solve_ratio")
    digits: float = Field(20.0, gt=0, description="d, by a tangent: digits an increment gains, times increments ahead")
    fresh: float = Field(0.1, gt=0, lt=1, description="θ_new, contraction expected of a new tangent")

    def due(self, history: TangentHistory) -> bool:
        """Iterations left at θ > ratio + iterations left at θ_new; always when θ ≥ 1."""
        if history.contraction is None or history.contraction == 0.0:
            return False
        if not history.contraction < 1.0:
            return True
        left, left_new = (self.digits / -np.log10(theta) for theta in (history.contraction, self.fresh))
        return bool(left > self.ratio + left_new)


class AverageCost(RefreshRule):
    """When a digit of the residual costs more now than the digits this tangent has given cost on average:

        1/rate > (ratio + solves)/digits          rate: digits by solve, recently

    in units of one iteration. While K* ages its average cost falls, for its factorisation is shared by more digits, and
    then rises; it is least where the two sides meet, which is when to replace what wears out (Preinreich 1940). Unlike
    `cost-optimal` it needs neither the length of the march nor the contraction of a new tangent.
    """

    kind: Literal["average-cost"] = "average-cost"
    ratio: float = Field(40.0, ge=0, description="cost of a new tangent over that of an iteration: factor_solve_ratio")

    def due(self, history: TangentHistory) -> bool:
        """Cost of a digit now > average cost of the digits so far; always when the last step gained nothing."""
        if history.contraction is None or history.rate is None:
            return False
        if not history.contraction < 1.0:
            return True
        return not history.digits <= history.rate * (self.ratio + history.solves)


class RangeUnderOne(RefreshRule):
    """When the range of the last series ended before its path did, as in the 2015 paper."""

    kind: Literal["range-under-one"] = "range-under-one"

    def due(self, history: TangentHistory) -> bool:
        """a_max < 1."""
        return history.range is not None and not history.range >= 1.0


class Never(RefreshRule):
    """The first tangent serves to the end."""

    kind: Literal["never"] = "never"

    def due(self, history: TangentHistory) -> bool:
        """False."""
        return False
