"""The checks of globalizations, predictors, refresh rules and iteration operators."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.refresh import RefreshRule, TangentHistory
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.matrices import CheckedOperator
from nlsolve.solving.tangent import Tangent
from nlsolve.testing.promises import norm, require, same
from nlsolve.testing.toy_problem import DenseLU, ToyProblem


def check_globalization(globalization: Globalization) -> None:
    """Check the search for step lengths on a toy problem with a potential.

    The length is positive and comes with the residual of the state it leads to; no argument is changed; near the
    solution Newton's full step is taken; one solve remembers nothing of another. Raises AssertionError.
    """
    problem = ToyProblem()
    problem.is_gradient = True  # A is symmetric

    def first(far: float) -> float:
        state = ToyProblem.solution + far * np.cos(np.arange(12.0))
        residual = problem.residual(state)
        direction = -np.linalg.solve(problem.jacobian(state).toarray(), residual)
        given = [state.copy(), residual.copy(), direction.copy()]
        length, found = globalization.search(problem).length(problem, state, residual, direction)
        require(length > 0.0, f"a step length of {length}")
        expected = problem.residual(state + length * direction)
        same(found, expected, norm(expected), "the residual at the end of the step")
        unchanged = all(map(np.array_equal, given, (state, residual, direction)))
        require(unchanged, "the search changed the state, the residual or the direction it was given")
        return length

    require(first(0.01) == 1.0, "a full step of Newton near the solution was not taken")
    for far in (0.5, 5.0):
        require(first(far) == first(far), "the first length of a second solve is another: what is kept is of one solve")


def check_predictor(predictor: Predictor) -> None:
    """Check the guesses from 1, 2, … `depth` known increments.

    The guess of a steady flow is that flow, to 1e-12. A guess has the shape of the velocities, does not change them,
    and is the same each time. Raises AssertionError.
    """
    require(predictor.depth >= 1, f"a depth of {predictor.depth}: at least the last increment is looked at")
    steady = np.random.default_rng(0).standard_normal((7, 2))
    for known in range(1, predictor.depth + 1):
        past = [steady.copy() for _ in range(known)]
        guess = predictor.guess(past)
        require(guess.shape == steady.shape, f"a guess of shape {guess.shape} for velocities of {steady.shape}")
        same(guess, steady, 1.0, f"the guess of a steady flow from {known} increments", 1e-12)
        require(all(np.array_equal(v, steady) for v in past), "the predictor changed the velocities it looked at")
        require(np.array_equal(predictor.guess(past), guess), "guess changed its mind: it may look at the past only")


def check_refresh_rule(rule: RefreshRule) -> None:
    """Check that `due` answers True or False to any history, also one with None (not observed) or NaN, and the same
    each time. Raises AssertionError.
    """
    for seen in (None, 0.0, 0.5, 1.0, 1e9, np.nan):
        for history in (TangentHistory(1, seen), TangentHistory(1, None, seen), TangentHistory(99, seen, seen)):
            first, again = rule.due(history), rule.due(history)
            require(isinstance(first, (bool, np.bool_)), f"due({history}) is {first!r}, not True or False")
            require(first == again, f"due({history}) changed its mind: a rule may look at the history only")


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
