"""Methods yield states; everything else (counting, timing, stopping) is done around them. Contracts of strategies.

while True:
    yield Step(state)
    tangent.refresh_if_due(problem, state)
    state = state - tangent.solve(problem.residual(state))
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

from nlsolve.contracts.component import Component
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


@dataclass(frozen=True)
class Step:
    """One state a method has reached.

    state : (U,) array.
    claim : True, the method itself holds this state to be the solution (a series whose range reached the end of its
        path, a library that reports success); False, it says that it failed here; None, it says nothing.
    notes : what the method wants recorded in the `steps` table, e.g. {"range": 1.7, "limited_by": "ratio"}.
    """

    state: Array
    claim: bool | None = None
    notes: Mapping[str, float | str] = field(default_factory=dict)


class KeptTangent(Protocol):
    """K* as a method sees it: factors kept until the refresh rule asks for new ones."""

    def refresh_if_due(self, problem: NonlinearProblem, state: Array) -> bool:
        """Factorise J(state) when there is no tangent yet or the rule says so; True when that happened."""

    def solve(self, rhs: Array) -> Array:
        """K*⁻¹ rhs."""

    def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
        """Report what the refresh rule should know about the last step."""


class NonlinearSolver(Component, ABC):
    """A strategy for R(u) = 0. It holds no counter, clock, print or stopping tolerance but its own mathematics."""

    noun: ClassVar[str] = "solver"
    default_refresh: ClassVar[Mapping[str, Any]] = {"kind": "every-iteration"}
    """The refresh rule used when a study names none."""
    claims: ClassVar[bool] = False
    """True when the method's steps can carry `claim`, so that `stop = { kind = "claim" }` makes sense."""

    @abstractmethod
    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
        """States from `start` on, the start itself first, without end: the driver stops asking."""
