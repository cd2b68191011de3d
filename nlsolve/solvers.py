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

from nlsolve.component import Component
from nlsolve.problems import NonlinearProblem
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
