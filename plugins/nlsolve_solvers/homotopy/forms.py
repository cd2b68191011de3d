"""K* W_j = r_j, j = 1, 2, … : the right-hand sides of the series W(a), one recurrence for each form of the homotopy.

Each form deforms a problem solved by W = 0 into G(W) = 0 as a goes from 0 to 1, with K* its tangent at a = 0, so
one K* serves all orders however old it is. With J the tangent of G at W = 0, which need not be K*:

    fixed-point   (1 − a) K* W + a G(W) = 0                      (Timesli et al. 2015)
    newton        G(W) = (1 − a) (G(0) + (J − K*) W)             with K* = J the Newton homotopy G(W) = (1 − a) G(0)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Literal

import numpy as np

from nlsolve.plugin import HomotopyForm, NonlinearProblem, Recurrence


class Expanded(ABC):
    """The `Recurrence` of a form whose r_{j+1} differ from r_j by what the Taylor series of G tells."""

    def __init__(self, problem: NonlinearProblem, state: np.ndarray) -> None:
        self._expansion = problem.expand(state)
        self._rhs = -self._expansion.coefficient(0)
        self._start = self._rhs
        self._terms: list[np.ndarray] = []
        self._known = 1

    def right_hand_side(self) -> np.ndarray:
        """r_j for the next W_j: minus the first coefficient that is left in the homotopy when W_j is left out."""
        if self._known <= len(self._terms):
            self._rhs = self._rhs - self._change(len(self._terms))
            self._known += 1
        return self._rhs

    def append(self, w_j: np.ndarray) -> None:
        """Push W_j."""
        self._terms.append(w_j)
        self._expansion.append(w_j)

    @abstractmethod
    def _change(self, j: int) -> np.ndarray:
        """r_j − r_{j+1}."""

    @abstractmethod
    def miss(self, a: float, g: np.ndarray, weights: np.ndarray, rhs: Sequence[np.ndarray]) -> np.ndarray:
        """What g = G(W) leaves in the homotopy at a, where W = Σ_j w_j W_j and so K* W = Σ_j w_j r_j; g at a = 1."""


def weighted(weights: np.ndarray, vectors: Sequence[np.ndarray]) -> np.ndarray:
    """Σ_j w_j x_j, over the weights there are."""
    total = np.zeros_like(vectors[0])
    for weight, vector in zip(weights, vectors, strict=False):
        total += weight * vector
    return total


class FixedPointRecurrence(Expanded):
    """r_1 = −G(0),  r_{j+1} = r_j − [G]_j, with [.]_j the Taylor coefficient in a."""

    def _change(self, j: int) -> np.ndarray:
        return self._expansion.coefficient(j)

    def miss(self, a: float, g: np.ndarray, weights: np.ndarray, rhs: Sequence[np.ndarray]) -> np.ndarray:
        """(1 − a) K* W + a G(W)."""
        return (1.0 - a) * weighted(weights, rhs) + a * g


class NewtonRecurrence(Expanded):
    """r_1 = −G(0),  r_{j+1} = r_j − J W_j − Q_{j+1}, where [G]_j = J W_j + Q_j and Q_j needs W_1 … W_{j−1} only.

    By order j of the form K* W_j = −Q_j − (J − K*) W_{j−1}; for K* = J that is J W_j = −Q_j. What the fixed-point form
    meets one order late (its W_2 is zero, its W_3 is −K*⁻¹ Q_2) is met here at once, for two orders of the residual
    instead of one: Q_{j+1}, and [G]_j to tell J W_j.
    """

    def __init__(self, problem: NonlinearProblem, state: np.ndarray) -> None:
        super().__init__(problem, state)
        self._q_j = np.zeros_like(state)
        self._pulls: list[np.ndarray] = []  # J W_1, J W_2, …

    def _change(self, j: int) -> np.ndarray:
        self._pulls.append(self._expansion.coefficient(j) - self._q_j)
        q_next = self._q_j = self._expansion.remainder(j + 1)
        return self._pulls[-1] + q_next

    def miss(self, a: float, g: np.ndarray, weights: np.ndarray, rhs: Sequence[np.ndarray]) -> np.ndarray:
        """G(W) − (1 − a) (G(0) + (J − K*) W)."""
        self.right_hand_side()  # brings J W_p
        return g - (1.0 - a) * (weighted(weights, self._pulls) - weighted(weights, rhs) - self._start)


class FixedPoint(HomotopyForm):
    """(1 − a) K* W + a G(W) = 0 (Timesli et al. 2015)."""

    kind: Literal["fixed-point"] = "fixed-point"

    def recurrence(self, problem: NonlinearProblem, state: np.ndarray) -> Recurrence:
        """One order of the residual for each r_j."""
        return FixedPointRecurrence(problem, state)


class NewtonForm(HomotopyForm):
    """G(W) = (1 − a) (G(0) + (J − K*) W), with K* = J the Newton homotopy G(W) = (1 − a) G(0)."""

    kind: Literal["newton"] = "newton"

    def recurrence(self, problem: NonlinearProblem, state: np.ndarray) -> Recurrence:
        """Two orders of the residual for each r_j."""
        return NewtonRecurrence(problem, state)


FORMS: tuple[type[HomotopyForm], ...] = (FixedPoint, NewtonForm)
