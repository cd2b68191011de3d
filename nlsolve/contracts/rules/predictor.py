"""v_{k+1} ≈ a guess from v_k, v_{k−1}, … : where an increment begins. The contract of predictors.

A guess costs no residual and no solve. Its quality shows in the residual of step 0 of the increment (`steps`). The
stopping test does not depend on it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from nlsolve.contracts.component import Component
from nlsolve.series import Array


class Predictor(Component, ABC):
    """Makes the first guess of an increment from the earlier increments, all of the same Δt."""

    noun: ClassVar[str] = "predictor"
    default_kind: ClassVar[str | None] = "previous"

    @property
    @abstractmethod
    def depth(self) -> int:
        """The largest number of earlier velocities that `guess` uses, at least 1."""

    @abstractmethod
    def guess(self, past: Sequence[Array]) -> Array:
        """v_{k+1}, (N, 2) [mm/s], from v_k, v_{k−1}, … at the same nodes, latest first; at least one, at most `depth`.

        Values at boundary nodes are not used: they are prescribed.
        """
