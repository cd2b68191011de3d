"""A polyalgorithm: one method after the other on the same problem, until one of them solves it."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Step
from nlsolve_solvers.newton import Newton
from nlsolve_solvers.pseudo_transient import PseudoTransient

FALL = 0.9  # largest part of ‖R‖ that may be left after `patience` steps
FAR = 1e3  # largest growth of ‖R‖ that a leap may cause, or that Newton's steps may show before they are given up
HALVINGS = 30  # of a leap's step; a shorter one moves nothing


class Robust(NonlinearSolver):
    """Methods in the order of their cost, as in the default of NonlinearSolve.jl (Pal et al. 2024):

    1. Newton's steps with backtracking. They end at a root, or at a least point of ‖R‖ where J is nearly singular.
    2. From there a leap, one step without backtracking, which is long because J is nearly singular; then Newton's steps
       with backtracking again. At most `leaps` times.
    3. Pseudo-transient continuation from the start, until the driver stops it.

    Newton's steps are given up when the method fails, when ‖R‖ has grown a thousandfold, or when it has not fallen by a
    tenth in `patience` steps.
    """

    kind: Literal["robust"] = "robust"
    patience: int = Field(25, gt=0, description="steps in which ‖R‖ must fall by a tenth, or the next method is tried")
    leaps: int = Field(3, ge=0, description="times that a least point of ‖R‖ is left by a leap")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The states of all methods tried, one after the other."""
        yield Step(start)
        state = yield from self._descent(problem, tangent, start)
        for _ in range(self.leaps):
            landed = leap(problem, tangent, state)
            if landed is None:
                break
            yield Step(landed)
            state = yield from self._descent(problem, tangent, landed)
        yield from PseudoTransient().steps(problem, tangent, start)

    def _descent(
        self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray
    ) -> Generator[Step, None, np.ndarray]:
        """Newton's states after the start, as long as ‖R‖ falls; returns the one with the least ‖R‖."""
        state, least = start, list[float]()
        try:
            for step, residual in Newton().steps_and_residuals(problem, tangent, start):
                size = float(np.linalg.norm(residual))
                if not size <= FAR * min([size, *least[:1]]):
                    tangent.observe(contraction=FAR)  # this step is not yielded, so the driver cannot measure it
                    break
                if least:  # the start has been yielded already
                    yield step
                if size <= min([size, *least[-1:]]):
                    state = step.state
                least.append(min([size, *least[-1:]]))
                if len(least) > self.patience and not least[-1] <= FALL * least[-1 - self.patience]:
                    break
        except SolveError:
            return state  # the next method may still solve the problem
        return state


def leap(problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> np.ndarray | None:
    """u − t K*⁻¹ R(u) with the largest t = 1, ½, … for which ‖R‖ is finite and at most `FAR` times what it was.

    None if K* cannot be factorised, or if no t is found.
    """
    try:
        tangent.refresh_if_due(lambda: problem.jacobian(state))
        residual = problem.residual(state)
        direction = -tangent.solve(residual)
    except SolveError:
        return None
    highest = FAR * float(np.linalg.norm(residual))
    for halving in range(HALVINGS + 1):
        landed = state + 0.5**halving * direction
        if float(np.linalg.norm(problem.residual(landed))) <= highest:
            return landed
    return None
