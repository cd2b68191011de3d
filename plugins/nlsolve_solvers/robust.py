"""One method after the other on the same problem, until one of them gets there: a polyalgorithm."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Step
from nlsolve_solvers.newton import Newton
from nlsolve_solvers.pseudo_transient import PseudoTransient

FALL = 0.9  # ‖R‖ must fall by this within `patience` steps
FAR = 1e3  # largest growth of ‖R‖ that a leap may cause, or that Newton's steps may show before they are given up
HALVINGS = 30  # of a leap: what needs more has no length


class Robust(NonlinearSolver):
    """Newton's steps with backtracking, which end at a root or where ‖R‖ is least and J nearly singular. From there one
    leap, a step without regard to descent, which such a J throws far out, and Newton's steps again; at most `leaps`
    times. Then, from the start, pseudo-transient continuation, until the driver has seen enough. As in the default of
    NonlinearSolve.jl (Pal et al. 2024) what is tried comes in the order of its cost.

    A method is left when it fails, when ‖R‖ has grown a thousandfold, or has not fallen by a tenth in `patience` steps.
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
        """Newton's states behind the start, as long as ‖R‖ falls; returns the best of them."""
        state, least = start, list[float]()
        try:
            for step, residual in Newton().steps_and_residuals(problem, tangent, start):
                size = float(np.linalg.norm(residual))
                if not size <= FAR * min([size, *least[:1]]):
                    tangent.observe(contraction=FAR)  # the driver is not shown this step and cannot measure it
                    break
                if least:  # the start has been shown
                    yield step
                if size <= min([size, *least[-1:]]):
                    state = step.state
                least.append(min([size, *least[-1:]]))
                if len(least) > self.patience and not least[-1] <= FALL * least[-1 - self.patience]:
                    break
        except SolveError:
            return state  # a method that fails is left, not the problem
        return state


def leap(problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> np.ndarray | None:
    """u − t K*⁻¹ R(u) with the largest t = 1, ½, … for which ‖R‖ is finite and at most `FAR` times what it was."""
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
