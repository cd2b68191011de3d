"""The check of iteration operators."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array
from nlsolve.solving.iteration_operator import CheckedOperator
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.tangent import Tangent
from nlsolve.testing.promises import require, same
from nlsolve.testing.toy_problem import DenseLU, ToyProblem


def check_operator(
    operator: IterationOperator, problem: NonlinearProblem | None = None, start: Array | None = None
) -> None:
    """Check the K* of an operator on a toy problem, or on the problem given with a state (U,) of it.

    Each K* is a square matrix of the problem's size, finite and invertible, before and after a problem has been solved;
    no state is changed; two marches are alike, so nothing of one is remembered in another. Raises AssertionError.
    """
    posed = ToyProblem() if problem is None else problem
    u = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0)) if start is None else start
    later, given = 1.01 * u, u.copy()

    def march() -> list[Array]:
        """The K* at u, and the one at another state once u has been solved for, or the first when there is no other."""
        made, found = CheckedOperator(operator), list[Array]()
        kept = Tangent(DenseLU(), None, Ledger(), operator=made)

        def assemble(state: Array) -> Array:
            found.append(made.matrix(posed, state).toarray())
            return found[-1]

        for state in (u, later):
            try:
                kept.refresh_if_due(lambda: assemble(state))
                kept.solve(posed.residual(state))
            except SolveError as error:
                raise AssertionError(f"no K* to iterate with: {error}") from error
            made.solved(posed, state)
        return found

    first, again = march(), march()
    require(np.array_equal(u, given) and np.array_equal(later, 1.01 * given), "the operator changed a state")
    require(len(first) == len(again), "a second march renewed K* at other times than the first")
    for mine, other in zip(first, again, strict=True):
        same(mine, other, float(np.abs(mine).max()), "the K* of a second march")
    if operator.is_tangent:
        same(first[0], posed.jacobian(u).toarray(), float(np.abs(first[0]).max()), "K*, said to be the tangent,")
