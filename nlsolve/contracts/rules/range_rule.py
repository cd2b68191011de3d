"""a_max : how far along its path a ↦ W(a), 0 ≤ a ≤ 1, a truncated series can be trusted. The contract of range rules.

found = rule.limit(branch, tolerance, used=True)      # found.a_max ≥ 1: the end of the path is within the range
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from nlsolve.contracts.component import Component
from nlsolve.series import Array


class SeriesBranch(Protocol):
    """W(a) ≈ a W_1 + … + a^p W_p around one state, with r_j = K* W_j: what a range rule may look at, to read only.

    The state u + W(a) leads from u at a = 0 to a root of G(W) = R(u + W) at a = 1. What costs a residual or one more
    coefficient of it is a method, and is counted; what is known already is a property. Nothing costs a solve.
    """

    @property
    def order(self) -> int:
        """p, the number of terms so far."""

    @property
    def sizes(self) -> Sequence[float]:
        """‖W_1‖ … ‖W_p‖."""

    @property
    def terms(self) -> Sequence[Array]:
        """W_1 … W_p, each (U,)."""

    @property
    def columns(self) -> Array:
        """W_1 … W_p as columns (p, p): coordinates in an orthonormal basis of their span, whatever the size U."""

    @property
    def residual(self) -> float:
        """‖G(0)‖ = ‖r_1‖."""

    @property
    def contraction(self) -> float:
        """(‖r_p‖/‖r_1‖)^(1/(p−1)): what an order leaves of the residual, in the mean."""

    @property
    def singularity(self) -> float:
        """(‖W_{p−2}‖/‖W_p‖)^(1/2): how far from a = 0 the nearest singularity of W lies; NaN for p < 3."""

    def approximant(self, order: int | None = None) -> Callable[[float], Array]:
        """a ↦ W(a) of the first `order` terms, of all when none is given, in the coordinates of `columns`, (p,).

        It is the series or the Padé approximant that the method uses.
        """

    def next_coefficient(self) -> Array:
        """r_{p+1}, (U,): the first coefficient that W_1 … W_p leave in the homotopy. An order of the residual."""

    def defect(self, a: float) -> float:
        """‖what W(a) leaves in the homotopy at a‖; at a = 1 that is ‖G(W(1))‖. One residual."""


@dataclass(frozen=True)
class Range:
    """What a range rule has found.

    a_max : the range, positive or infinite.
    quantity, threshold : by what the rule has decided; a_max ≥ 1 where quantity ≤ threshold. `steps` holds them as
        `range_quantity` and `range_threshold`. NaN where a rule does not tell.
    """

    a_max: float
    quantity: float = float("nan")
    threshold: float = float("nan")


class RangeRule(Component, ABC):
    """Limits how far along its path a series is used."""

    noun: ClassVar[str] = "range"

    @abstractmethod
    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """a_max of a branch of at least two terms, W_1 ≠ 0. It grows with `tolerance`, η.

        used : whether a range below 1 will be used. Where it will not be (a series that is still growing), a rule may
            answer with anything below 1 and save residuals.
        NaN or a negative a_max ends the solve as "range exhausted", in a sentence with the name of the rule.
        """
