"""Methods yield states; everything else (counting, timing, stopping) is done around them. The contract of methods.

while True:
    yield Step(state)
    tangent.refresh_if_due(lambda: problem.operator(state))
    state = state - tangent.solve(problem.residual(state))
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from nlsolve.contracts.component import Component
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


@dataclass(frozen=True)
class Step:
    """One state that a method has reached.

    state : (U,) array.
    claim : True when the method reports this state as the solution (a series whose range reached the end of its path,
        a library that reports success); False when it reports that it failed here; None when it reports neither.
    notes : values for the step's row of `steps`, such as {"range": 1.7, "limited_by": "ratio"}. A name that is no
        column of `nlsolve.results.columns.STEPS` is recorded as a column "note.<name>".
    """

    state: Array
    claim: bool | None = None
    notes: Mapping[str, float | str] = field(default_factory=dict)


class KeptTangent(ABC):
    """The tangent K*: a factorised matrix that a method solves with until the refresh rule asks for a new one."""

    @abstractmethod
    def refresh_if_due(self, assemble: Callable[[], Any]) -> bool:
        """Factorise the matrix that `assemble` returns when there is no K* yet or the refresh rule asks for one.

        assemble : called only then. Returns the iteration operator that the case has chosen (`problem.operator`), or a
            matrix of the method's own, sparse (U, U).
        Returns True when K* was renewed; False also when the rule asks and the operator has no other K*. Raises
        SolveError when the matrix cannot be factorised.
        """

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """K*⁻¹ rhs, shape (U,).

        Raises SolveError when the right-hand side or the answer is not finite, TypeError when there is no K* yet.
        """

    @abstractmethod
    def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
        """Tell the refresh rule what the driver cannot measure of the last step.

        contraction : ‖R_new‖/‖R_old‖ per solve, from a method that needs several solves for a step or that has refused
            a step. When a method reports none, the refresh rule gets ‖R_new‖/‖R_old‖ as the driver measures it.
        range : a_max of the step's series.
        """


class NonlinearSolver(Component, ABC):
    """A strategy for R(u) = 0. It holds its own mathematics, and no counter, clock, print or stopping tolerance."""

    noun: ClassVar[str] = "solver"
    default_refresh: ClassVar[Mapping[str, Any]] = {"kind": "every-iteration"}
    """The refresh rule used when a study names none."""
    claims: ClassVar[bool] = False
    """True when the method's steps can carry `claim`, so that `stop = { kind = "claim" }` makes sense."""

    uses_operator: ClassVar[bool] = False
    """True when K* is `problem.operator(u)` in every step, so that a case may choose its iteration operator; False when
    the method factorises a matrix of its own.
    """

    @abstractmethod
    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
        """Yields states without end, `start` (U,) itself first; the driver decides when to stop.

        A method that returns by itself ends as "stagnated", one that raises SolveError with the status of that error.

        problem : counts and times its residuals, Jacobians, products and series when the method asks for them. A
            Jacobian can be read and combined like any sparse matrix; what the method computes from it shows in
            `seconds_own`.
        tangent : K*, through which the method factorises and solves linear systems.
        """
