"""The checks of globalizations, predictors and refresh rules."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.refresh import RefreshRule, TangentHistory
from nlsolve.testing.promises import norm, require, same
from nlsolve.testing.toy_problem import ToyProblem


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
