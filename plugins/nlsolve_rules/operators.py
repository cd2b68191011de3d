"""What is K* made of? Iteration operators for every method that keeps a K*."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field

from nlsolve.plugin import AnyDiscretizer, Assembly, IterationOperator, NonlinearProblem


class TangentHere(IterationOperator):
    """J(u): a new K* is the tangent where the method is."""

    kind: Literal["tangent"] = "tangent"
    is_tangent: ClassVar[bool] = True

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J(u)."""
        return problem.jacobian(u)


class Secant(IterationOperator):
    """A(u) of R(u) = A(u) u + c(u): Picard's matrix, coefficients held."""

    kind: Literal["secant"] = "secant"

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """A(u)."""
        return problem.secant(u)


class Once(Assembly):
    """The first matrix that its operator makes is all there is."""

    def __init__(self, operator: IterationOperator) -> None:
        self._operator = operator
        self._made = False

    @property
    def renewable(self) -> bool:
        """False from the first matrix on."""
        return not self._made

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """The operator's matrix."""
        self._made = True
        return self._operator.matrix(problem, u)


class FirstTangent(IterationOperator):
    """J(u_0) with u_0 where the march began: assembled and factorised once, whatever the refresh rule asks."""

    kind: Literal["first-tangent"] = "first-tangent"

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J(u)."""
        return problem.jacobian(u)

    def begin(self) -> Once:
        """See `IterationOperator`."""
        return Once(self)


class LastSolved(Assembly):
    """J of the problem solved last at its solution; J(u) before there is one. New after each solve, not within one."""

    def __init__(self) -> None:
        self._last: tuple[NonlinearProblem, np.ndarray] | None = None
        self._made = False

    @property
    def renewable(self) -> bool:
        """False once the tangent at the last solution has been made, and always True before there is a solution."""
        return self._last is None or not self._made

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J at the last solution."""
        self._made = self._last is not None
        there, state = self._last or (problem, u)
        return there.jacobian(state)

    def solved(self, problem: NonlinearProblem, u: np.ndarray) -> None:
        """Keep the problem and its solution."""
        self._last, self._made = (problem, u.copy()), False


class PreviousTangent(IterationOperator):
    """J at the end of the previous increment, of its own equations; at the start of a march J(u)."""

    kind: Literal["previous-tangent"] = "previous-tangent"

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J(u)."""
        return problem.jacobian(u)

    def begin(self) -> LastSolved:
        """See `IterationOperator`."""
        return LastSolved()


class Newtonian(IterationOperator):
    """The operator of a flow whose viscosity is μ(ε̄²) at one strain rate everywhere; only moving nodes change it."""

    kind: Literal["newtonian"] = "newtonian"
    rate: float | None = Field(
        None, gt=0, description="ε̄ [1/s] at which the viscosity is taken; the scene's reference rate when left out"
    )

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J(u) with constant viscosity."""
        return problem.newtonian(u, self.rate)


class Diagonal(IterationOperator):
    """s diag(J(u)): Jacobi's matrix. With s = 1 it contracts where J is diagonally dominant."""

    kind: Literal["diagonal"] = "diagonal"
    scale: float = Field(1.0, gt=0, description="s")

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """s diag(J)."""
        return sp.diags_array(self.scale * problem.jacobian(u).diagonal(), format="csr")


class Mass(IterationOperator):
    """s I, made once: u ← u − R(u)/s is Richardson's iteration, an explicit step in time of length 1/s."""

    kind: Literal["mass"] = "mass"
    scale: float = Field(1.0, gt=0, description="s; contracts above half the largest eigenvalue of a definite J")

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """s I."""
        return sp.diags_array(np.full(len(u), self.scale), format="csr")

    def begin(self) -> Once:
        """See `IterationOperator`."""
        return Once(self)


class OtherDiscretization(IterationOperator):
    """J(u) of the same equations and nodes by another discretizer, its rows brought to the units of R."""

    kind: Literal["other-discretization"] = "other-discretization"
    discretizer: AnyDiscretizer = Field(  # type: ignore[assignment]
        {"kind": "delaunay"}, description="the discretizer that K* is assembled with"
    )

    def matrix(self, problem: NonlinearProblem, u: np.ndarray) -> Any:
        """J(u) by that discretizer."""
        return problem.jacobian_by(self.discretizer, u)
