"""When is K* factorised anew? Rules shared by every method."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from pydantic import Field

from nlsolve import Component, Evidence, RefreshRule, hookimpl


class EveryIteration(RefreshRule):
    """At each iteration: Newton's rule."""

    kind: Literal["every-iteration"] = "every-iteration"

    def due(self, evidence: Evidence) -> bool:
        """Always."""
        return True


class EveryM(RefreshRule):
    """After every m iterations or series, counted across increments (Shamanskii 1967)."""

    kind: Literal["every-m"] = "every-m"
    m: int = Field(5, gt=0, description="iterations or series a tangent serves")

    def due(self, evidence: Evidence) -> bool:
        """uses ≥ m."""
        return evidence.uses >= self.m


class PoorContraction(RefreshRule):
    """When the last step left more than `limit` of the residual."""

    kind: Literal["poor-contraction"] = "poor-contraction"
    limit: float = Field(0.5, gt=0, description="largest ‖R_new‖/‖R_old‖ with which a tangent is kept")

    def due(self, evidence: Evidence) -> bool:
        """contraction > limit."""
        return evidence.contraction is not None and not evidence.contraction <= self.limit


class RangeUnderOne(RefreshRule):
    """When the range of the last series ended before its path did, as in the 2015 paper."""

    kind: Literal["range-under-one"] = "range-under-one"

    def due(self, evidence: Evidence) -> bool:
        """a_max < 1."""
        return evidence.range is not None and not evidence.range >= 1.0


class Never(RefreshRule):
    """The first tangent serves to the end."""

    kind: Literal["never"] = "never"

    def due(self, evidence: Evidence) -> bool:
        """Not once."""
        return False


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [EveryIteration, EveryM, PoorContraction, RangeUnderOne, Never]
