"""When is K* factorised anew? The contract of refresh rules, and the history of K* that they are given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from nlsolve.contracts.component import Component


@dataclass(frozen=True)
class TangentHistory:
    """What has been observed of one K* since it was factorised. A field is None until it has been observed.

    uses : iterations or series that K* has served.
    contraction : ‖R‖ after the last step over ‖R‖ before it, which the driver measures after every step. A method that
        needs several solves for a step reports the contraction per solve instead.
    range : a_max of the last series computed with K*.
    solves : right-hand sides solved with K*.
    digits : decimal digits by which the residual has fallen with K*, Σ lg(1/contraction) over its solves.
    rate : digits per solve, a mean in which recent solves weigh most.
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
    def due(self, history: TangentHistory) -> bool:
        """True when K* should be replaced by the tangent at the present state."""
