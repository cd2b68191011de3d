"""Methods yield states; everything else (counting, timing, stopping) is done around them. The contract of methods.

while True:
    yield Step(state)
    tangent.refresh_if_due(lambda: problem.jacobian(state))
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
    """One state a method has reached.

    state : (U,) array.
    claim : True, the method itself holds this state to be the solution (a series whose range reached the end of its
        path, a library that reports success); False, it says that it failed here; None, it says nothing.
    notes : what the method wants recorded in the `steps` table, e.g. {"range": 1.7, "limited_by": "ratio"}. A name that
        is no column of `nlsolve.results.columns.STEPS` is recorded as a column "note.<name>".
    """

    state: Array
    claim: bool | None = None
    notes: Mapping[str, float | str] = field(default_factory=dict)


class KeptTangent(ABC):
    """K*, a factorised matrix that a method works with until the refresh rule asks for a new one."""

    @abstractmethod
    def refresh_if_due(self, assemble: Callable[[], Any]) -> bool:
        """Factorise the matrix that `assemble` returns when there is no K* yet or the refresh rule says so.

        assemble : called only then; a Jacobian of the problem, anything computed from it, or any sparse matrix.
        Returns True when K* was renewed. Raises SolveError when the matrix cannot be factorised.
        """

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """K*⁻¹ rhs. Raises SolveError when the right-hand side or the answer is not finite."""

    @abstractmethod
    def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
        """Tell the refresh rule more about the last step than the driver can see.

        contraction : ‖R_new‖/‖R_old‖ per solve, of a method that takes several solves in a step, or of a step that was
            refused. Without it the refresh rule is told ‖R_new‖/‖R_old‖ of the step as the driver measures it.
        range : a_max of a series.
        """


class NonlinearSolver(Component, ABC):
    """A strategy for R(u) = 0. It holds no counter, clock, print or stopping tolerance but its own mathematics."""

    noun: ClassVar[str] = "solver"
    default_refresh: ClassVar[Mapping[str, Any]] = {"kind": "every-iteration"}
    """The refresh rule used when a study names none."""
    claims: ClassVar[bool] = False
    """True when the method's steps can carry `claim`, so that `stop = { kind = "claim" }` makes sense."""

    @abstractmethod
    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
        """States from `start` on, the start itself first, without end: the driver stops asking.

        problem : its residuals, Jacobians, products and series are counted and timed as they are asked for. A Jacobian
            can be read and combined like any sparse matrix; what the method computes from it shows in `seconds_own`.
        """
