"""v_{k+1} ≈ a guess from v_k, v_{k−1}, … : where an increment begins. The contract of predictors.

A guess costs no residual and no solve; what it is worth shows in the residual of step 0 of the increment (`steps`). The
method that goes on from it is judged as from any other start.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from nlsolve.contracts.component import Component
from nlsolve.series import Array


class Predictor(Component, ABC):
    """The first guess of an increment from the increments before, all of one Δt."""

    noun: ClassVar[str] = "predictor"
    default_kind: ClassVar[str | None] = "previous"

    @property
    @abstractmethod
    def depth(self) -> int:
        """The most increments it looks back on, at least 1."""

    @abstractmethod
    def guess(self, past: Sequence[Array]) -> Array:
        """v_{k+1}, (N, 2), from v_k, v_{k−1}, … at the same nodes, latest first; at least one, at most `depth`.

        Values at boundary nodes are not used: they are prescribed.
        """
