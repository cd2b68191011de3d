"""The checks of globalizations, predictors and refresh rules."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.refresh import Evidence, RefreshRule
from nlsolve.testing.promises import norm, require, same
from nlsolve.testing.toy_problem import SmallProblem


def check_globalization(globalization: Globalization) -> None:
    """On a small problem with a potential: a positive length, the residual of the state it leads to, nothing changed in
    what was handed over; near the solution Newton's full step; no memory from one solve to the next.
    """
    problem = SmallProblem()
    problem.is_gradient = True  # A is symmetric

    def first(far: float) -> float:
        state = SmallProblem.solution + far * np.cos(np.arange(12.0))
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
    """A flow that stays as it is goes on as it is, to 1e-12, however few increments are known; a guess has the shape of
    the velocities, leaves them as they were, and is the same each time.
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
    """A plain answer to any evidence, the same each time, be it not yet observed (None) or not a number."""
    for seen in (None, 0.0, 0.5, 1.0, 1e9, np.nan):
        for evidence in (Evidence(1, seen), Evidence(1, None, seen), Evidence(99, seen, seen)):
            first, again = rule.due(evidence), rule.due(evidence)
            require(isinstance(first, (bool, np.bool_)), f"due({evidence}) is {first!r}, not True or False")
            require(first == again, f"due({evidence}) changed its mind: a rule may look at the evidence only")
