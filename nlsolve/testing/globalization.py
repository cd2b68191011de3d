"""How long a step? The check of globalizations."""

from __future__ import annotations

import numpy as np

from nlsolve.globalization import Globalization
from nlsolve.small import SmallProblem
from nlsolve.testing.promises import norm, require, same


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
