"""What is K* made of? The contract of iteration operators (Jamal, Braikat, Boutmir, Damil, Potier-Ferry 2002).

Whatever K* is, where the iterations end R = 0; K* decides how fast, and for how many increments. A refresh rule says
when K* is renewed, an iteration operator what it then is:

    assembly = operator.begin()              # once a march
    K* = assembly.matrix(problem, u)         # when the refresh rule asks for it
    assembly.solved(problem, u)              # after each problem that has been solved
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from nlsolve.contracts.component import Component
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


class Assembly(ABC):
    """Makes the matrices K* of one march; it may remember what the march has solved."""

    @property
    def renewable(self) -> bool:
        """False while `matrix` has nothing to give but the K* there is: a renewal is then spared."""
        return True

    @abstractmethod
    def matrix(self, problem: NonlinearProblem, u: Array) -> Any:
        """K*, sparse or dense (U, U), for iterations on `problem` from u (U,). May raise SolveError."""

    def solved(self, problem: NonlinearProblem, u: Array) -> None:  # noqa: B027 (an assembly may forget)
        """The march has solved `problem` by u (U,)."""


class _Afresh(Assembly):
    """An assembly that remembers nothing."""

    def __init__(self, operator: IterationOperator) -> None:
        self._operator = operator

    def matrix(self, problem: NonlinearProblem, u: Array) -> Any:
        return self._operator.matrix(problem, u)


class IterationOperator(Component, ABC):
    """What K* is made of, for every method that iterates with a kept matrix. On the way to the first state, which is no
    part of the march, K* is the tangent.

    class Scaled(IterationOperator):  # K* = 1.1 J(u)
        kind: Literal["scaled"] = "scaled"

        def matrix(self, problem, u):
            return 1.1 * problem.jacobian(u)
    """

    noun: ClassVar[str] = "operator"
    default_kind: ClassVar[str | None] = "tangent"
    is_tangent: ClassVar[bool] = False
    """True when K* is J(u), so that a method which needs J(u) besides does not assemble it twice."""

    @abstractmethod
    def matrix(self, problem: NonlinearProblem, u: Array) -> Any:
        """K*, sparse or dense (U, U), made of `problem` at u (U,) alone.

        Raises SolveError (not applicable) when the problem lacks what the operator is made of.
        """

    def begin(self) -> Assembly:
        """The assembly of one march; without memory unless the operator has one of its own."""
        return _Afresh(self)
