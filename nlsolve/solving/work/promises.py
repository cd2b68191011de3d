"""What a method yields, and the residual of a problem: real numbers, as many as there are unknowns."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.contracts.nonlinear_solver import NonlinearSolver, Step
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array

REAL = "f"
"""NumPy's letter for the types of states: integers would cut off every step, and complex numbers have no order."""

NUMBERS = "fiu"
"""The letters for the types of residuals."""


def checked_step(step: Any, start: Array, solver: NonlinearSolver) -> Step:
    """The step, whose state is a real array of the shape of `start`. Raises TypeError, which names the solver."""

    def broken(promise: str) -> TypeError:
        return TypeError(f"the solver {solver.called()!r} yielded a {promise}")

    if not isinstance(step, Step):
        raise broken(f"{type(step).__name__}, not a Step: yield Step(state)")
    state = step.state
    if not isinstance(state, np.ndarray):
        raise broken(f"state that is a {type(state).__name__}, not an array of shape {start.shape}")
    if state.shape != start.shape:
        raise broken(f"state of shape {state.shape}, not of the shape {start.shape} of its start")
    if state.dtype.kind != REAL:
        raise broken(f"state of {state.dtype} numbers: states are real, float64; convert it")
    return step


def checked_residual(residual: Any, start: Array, problem: NonlinearProblem) -> None:
    """Raises TypeError, which names the problem, unless R(u) is a real array of the shape of u, `start`."""
    name = f"the residual of {type(problem).__name__}"
    shape = getattr(residual, "shape", None)
    if shape != start.shape:
        raise TypeError(f"{name} is of shape {shape}, not of the shape {start.shape} of its state")
    if residual.dtype.kind not in NUMBERS:
        raise TypeError(f"{name} is of {residual.dtype} numbers, which should be real")
