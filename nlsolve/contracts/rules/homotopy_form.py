"""H(a, W) = 0 : from a problem that W = 0 solves at a = 0, K* its tangent, to G(W) = R(u + W) = 0 at a = 1.

The contract of homotopy forms, each of which is a recurrence for the right-hand sides of K* W_j = r_j:

for j in 1 … p:
    rhs = recurrence.right_hand_side()
    recurrence.append(tangent.solve(rhs))
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Protocol

from nlsolve.contracts.component import Component
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


class Recurrence(Protocol):
    """The r_j of one form around one state; r_{j+1} may be asked for, again too, once W_1 … W_j have been appended."""

    def right_hand_side(self) -> Array:
        """r_j for the next W_j, (U,): minus the first coefficient that is left in the homotopy when W_j is left out;
        r_1 = −G(0).
        """

    def append(self, w_j: Array) -> None:
        """Push W_j, (U,)."""

    def miss(self, a: float, g: Array, weights: Array, rhs: Sequence[Array]) -> Array:
        """H(a, W), (U,), for g = G(W) and W = Σ_j w_j W_j, so that K* W = Σ_j w_j r_j; not asked for at a = 1, where it
        is g. weights : w_1, w_2, …; rhs : r_1 … r_p.
        """


class HomotopyForm(Component, ABC):
    """Which path leads from K* to the problem."""

    noun: ClassVar[str] = "form"

    @abstractmethod
    def recurrence(self, problem: NonlinearProblem, state: Array) -> Recurrence:
        """The recurrence around a state u (U,). Raises SolveError when the problem lacks what the form needs."""
