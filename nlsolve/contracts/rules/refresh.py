"""When is K* factorised anew? The contract of refresh rules, and what they may look at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from nlsolve.contracts.component import Component


@dataclass(frozen=True)
class Evidence:
    """What a refresh rule may look at. Fields are None until they have been observed on this tangent.

    uses : iterations or series this tangent has served since it was factorised.
    contraction : ‖R‖ after the last step over ‖R‖ before it, by the solve where a step takes several.
    range : a_max of the last series computed with this tangent.
    solves : right-hand sides solved with this tangent.
    digits : decimal digits by which the residual has fallen with it, Σ lg(1/contraction) over its solves.
    rate : digits by solve, the recent ones: contractions differ between the first and the last steps of an increment.
    """

    uses: int = 0
    contraction: float | None = None
    range: float | None = None
    solves: int = 0
    digits: float = 0.0
    rate: float | None = None


class RefreshRule(Component, ABC):
    """When is K* factorised anew? Asked once per iteration or series, in every method alike."""

    noun: ClassVar[str] = "refresh"

    @abstractmethod
    def due(self, evidence: Evidence) -> bool:
        """True when the tangent should be replaced by the one at the present state."""
