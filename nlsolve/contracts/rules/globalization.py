"""u ← u + t w : how long the step along a direction w may be. The contract of globalisations.

search = globalization.search(problem)                                # once a solve
t, residual = search.length(problem, u, R(u), w, predicted_decrease)  # once a step; the residual is that of u + t w
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Protocol

from nlsolve.contracts.component import Component
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


class Search(Protocol):
    """Finds the step lengths of one solve; it may remember the earlier steps."""

    def length(
        self,
        problem: NonlinearProblem,
        state: Array,
        residual: Array,
        direction: Array,
        predicted_decrease: float = 1.0,
    ) -> tuple[float, Array]:
        """Step length t > 0 and R(state + t direction), (U,); `residual` is R(state), (U,).

        predicted_decrease : the part of ‖R‖ that a full step would take away if R were linear: 1 for Newton's
            direction, 1 − η for an inexact one with ‖R + J w‖ = η ‖R‖.
        """


class Globalization(Component, ABC):
    """Limits how far a method goes along the directions that it proposes."""

    noun: ClassVar[str] = "globalization"

    @abstractmethod
    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve. Raises SolveError (not applicable) when the problem lacks what the search needs."""
