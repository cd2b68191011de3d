"""One method after the other on the same problem, until one of them gets there: a polyalgorithm."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Expansion, KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Step
from nlsolve_solvers.newton import Newton
from nlsolve_solvers.pseudo_transient import PseudoTransient

FALL = 0.9  # ‖R‖ must fall by this within `patience` steps
FAR = 1e3  # ‖R‖ behind a leap over that before it, and the growth that a descent is not forgiven
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
        seen = Seen(problem)
        yield Step(start)
        state = yield from self._descent(seen, tangent, start)
        for _ in range(self.leaps):
            landed = leap(seen, tangent, state)
            if landed is None:
                break
            yield Step(landed)
            state = yield from self._descent(seen, tangent, landed)
        yield from PseudoTransient().steps(seen, tangent, start)

    def _descent(self, problem: Seen, tangent: KeptTangent, start: np.ndarray) -> Generator[Step, None, np.ndarray]:
        """Newton's states behind the start, as long as ‖R‖ falls; returns the best of them."""
        state, least = start, list[float]()
        try:
            for step in Newton().steps(problem, tangent, start):
                size = problem.size(step.state)
                if not size <= FAR * min([size, *least[:1]]):
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


def leap(problem: Seen, tangent: KeptTangent, state: np.ndarray) -> np.ndarray | None:
    """u − t K*⁻¹ R(u) with the largest t = 1, ½, … for which ‖R‖ is finite and at most `FAR` times what it was."""
    try:
        tangent.refresh_if_due(problem, state)
        direction = -tangent.solve(problem.residual(state))
    except SolveError:
        return None
    highest = FAR * problem.size(state)
    for halving in range(HALVINGS + 1):
        landed = state + 0.5**halving * direction
        if problem.size(landed) <= highest:
            return landed
    return None


class Seen(NonlinearProblem):
    """R(u) = 0, with the norm of the last residual remembered."""

    def __init__(self, problem: NonlinearProblem) -> None:
        self._problem = problem
        self._last: tuple[np.ndarray, float] | None = None
        self.is_gradient = problem.is_gradient

    def size(self, u: np.ndarray) -> float:
        """‖R(u)‖, evaluated again only where the last residual was another state's."""
        if self._last is None or not np.array_equal(self._last[0], u):
            self.residual(u)
        assert self._last is not None
        return self._last[1]

    def residual(self, u: np.ndarray) -> np.ndarray:
        residual = self._problem.residual(u)
        self._last = u.copy(), float(np.linalg.norm(residual))
        return residual

    def jacobian(self, u: np.ndarray) -> Any:
        return self._problem.jacobian(u)

    def expand(self, u: np.ndarray) -> Expansion:
        return self._problem.expand(u)
