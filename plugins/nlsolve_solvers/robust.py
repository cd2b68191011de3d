"""A polyalgorithm: one method after the other on the same problem, until one of them solves it."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step, norm
from nlsolve_solvers.levenberg_marquardt import lengths_of_columns
from nlsolve_solvers.newton import Newton
from nlsolve_solvers.pseudo_transient import PseudoTransient

FALL = 0.9  # largest part of ‖R‖ that may be left after `patience` steps
FAR = 1e3  # largest growth of ‖R‖ that a leap may cause, or that Newton's steps may show before they are given up
HALVINGS = 30  # of a leap's step; a shorter one moves nothing
SINGULAR = 1e13  # ‖|J| |J⁻¹ R|‖/‖R‖ from which J counts as singular to working precision
MOVES = (0.01, 0.1, 1.0)  # sizes of a random move away from such a state, over those of the unknowns
SHORT = 10  # steps in which ‖R‖ must fall by a tenth once a tangent has been singular
LEAST_NORM = 1e-8  # μ of a step of least norm: columns of J that are so much smaller than D take no part in it


class Robust(NonlinearSolver):
    """Methods in the order of their cost, as in the default of NonlinearSolve.jl (Pal et al. 2024):

    1. Newton's steps with backtracking. They end at a root, or at a least point of ‖R‖ where J is nearly singular.
    2. From there a leap, one step without backtracking, which is long because J is nearly singular; then Newton's steps
       with backtracking again. At most `leaps` times.
    3. Pseudo-transient continuation from the start, until the driver stops it, or its matrix is singular.

    Newton's steps are given up when the method fails, when ‖R‖ has grown a thousandfold, or when it has not fallen by a
    tenth in `patience` steps.

    Where a tangent was singular, or nearly so at the start, pseudo-transient continuation is given up like Newton's
    steps, and what follows works with any J, one without a diagonal or with columns of zeros too:

    4. Steps of least norm, w = −(JᵀJ + μ D)⁻¹ Jᵀ R with a small μ, as long as ‖R‖ falls. They end at a root, or where
       the gradient of ‖R‖ vanishes.
    5. A random move from there, and Newton's steps with backtracking again; at most three times, each ten times as far.
    """

    kind: Literal["robust"] = "robust"
    patience: int = Field(25, gt=0, description="steps in which ‖R‖ must fall by a tenth, or the next method is tried")
    leaps: int = Field(3, ge=0, description="times that a least point of ‖R‖ is left by a leap")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The states of all methods tried, one after the other. Raises SolveError, as the last of them did."""
        yield Step(start)
        reached = yield from self._descent(Newton(), problem, tangent, start, self.patience)
        stuck = reached.stuck
        for _ in range(self.leaps):
            try:
                landed, growth = leap(problem, tangent, reached.state)
            except SolveError as error:
                stuck |= error.status is Status.SINGULAR_TANGENT
                break
            stuck |= reached.state is start and (landed is None or growth > SINGULAR)
            if landed is None:
                break
            yield Step(landed)
            reached = yield from self._descent(Newton(), problem, tangent, landed, self.patience)
        failure = yield from self._relaxation(problem, tangent, start, stuck)
        yield from self._escape(problem, tangent, reached.state)
        tried = "tried: steps of least norm and random moves, from which ‖R‖ does not fall to zero either"
        if failure is None:
            raise SolveError(Status.STAGNATED, f"the tangent was singular; {tried}")
        raise SolveError(failure.status, f"{failure.detail}; {tried}")

    def _descent(
        self,
        method: Newton | PseudoTransient,
        problem: NonlinearProblem,
        tangent: KeptTangent,
        start: np.ndarray,
        patience: int,
    ) -> Generator[Step, None, Reached]:
        """The states of a method after the start, as long as ‖R‖ falls; returns the one with the least ‖R‖."""
        state, least, failure = start, list[float](), None
        try:
            for step, residual in method.steps_and_residuals(problem, tangent, start):
                size = problem.size(residual)
                if not size <= FAR * min([size, *least[:1]]):
                    tangent.observe(contraction=FAR)  # this step is not yielded, so the driver cannot measure it
                    break
                if least:  # the start has been yielded already
                    yield step
                if size <= min([size, *least[-1:]]):
                    state = step.state
                least.append(min([size, *least[-1:]]))
                if len(least) > patience and not least[-1] <= FALL * least[-1 - patience]:
                    break
        except SolveError as error:  # the next method may still solve the problem
            failure = error
        return Reached(state, len(least), failure)

    def _relaxation(
        self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray, stuck: bool
    ) -> Generator[Step, None, SolveError | None]:
        """Pseudo-transient continuation; returns how it failed, if that leaves something to try."""
        if stuck:
            yield Step(start)
            return (yield from self._descent(PseudoTransient(), problem, tangent, start, SHORT)).failure
        try:
            yield from PseudoTransient().steps(problem, tangent, start)
        except SolveError as error:
            if error.status is not Status.SINGULAR_TANGENT:
                raise
            return error
        return None

    def _escape(self, problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> Iterator[Step]:
        """The states of steps 4 and 5 above."""
        for attempt, size in enumerate(MOVES):
            state = yield from least_norm_descent(problem, tangent, state)
            state = moved(problem, state, size, attempt)
            yield Step(state)
            state = (yield from self._descent(Newton(), problem, tangent, state, SHORT)).state


@dataclass(frozen=True)
class Reached:
    """The state with the least ‖R‖ of a method that was given up, the number of its states, and its error if that was
    the reason.
    """

    state: np.ndarray
    states: int
    failure: SolveError | None

    @property
    def stuck(self) -> bool:
        """Whether there was no step for want of a regular tangent, or, at the start, of a finite one."""
        status = None if self.failure is None else self.failure.status
        return status is Status.SINGULAR_TANGENT or (status is Status.NON_FINITE and self.states == 1)


def leap(problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> tuple[np.ndarray | None, float]:
    """u − t K*⁻¹ R(u) with the largest t = 1, ½, … for which ‖R‖ is finite and at most `FAR` times what it was; None
    if no t is found. Beside it ‖|J| |J⁻¹ R|‖/‖R‖, which is at most the condition of J when its rows are made of one
    size (Skeel 1979); 0 where K* is an older tangent.

    Raises SolveError if K* cannot be factorised.
    """
    assembled: list[Any] = []

    def assemble() -> Any:
        assembled.append(problem.jacobian(state))
        return assembled[-1]

    tangent.refresh_if_due(assemble)
    residual = problem.residual(state)
    direction, size = -tangent.solve(residual), problem.size(residual)
    terms = abs(assembled[-1].tocsr()) @ np.abs(direction) if assembled else np.zeros_like(residual)
    growth = problem.size(terms) / size if size else 0.0
    return shortened(problem, state, direction, FAR * size), growth


def shortened(problem: NonlinearProblem, state: np.ndarray, direction: np.ndarray, highest: float) -> np.ndarray | None:
    """u + t w with the largest t = 1, ½, … for which ‖R‖ is at most `highest`; None if no t is found."""
    for halving in range(HALVINGS + 1):
        landed = state + 0.5**halving * direction
        if problem.size(problem.residual(landed)) <= highest:
            return landed
    return None


def least_norm_descent(
    problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray
) -> Generator[Step, None, np.ndarray]:
    """Steps w = −(JᵀJ + μ D)⁻¹ Jᵀ R, halved until ‖R‖ falls by a tenth; returns where that is so no more.

    D = diag(‖J e_j‖²), and for a column of zeros the largest of them, so that the matrix is regular unless J = 0.
    """
    state = start
    try:
        while True:
            residual = problem.residual(state)
            weights = sp.diags_array(problem.weighted(np.ones_like(residual)))
            jacobian = sp.csr_array(weights @ problem.jacobian(state).tocsr())
            columns = lengths_of_columns(jacobian)
            gradient = jacobian.T @ (weights @ residual)
            size = problem.size(residual)
            along = np.divide(gradient, columns, out=np.zeros_like(gradient), where=columns > 0.0)
            if not norm(along) > LEAST_NORM * size:
                return state
            damping = LEAST_NORM * np.where(columns > 0.0, columns, columns.max()) ** 2
            normal = jacobian.T @ jacobian + sp.diags_array(damping)
            tangent.refresh_if_due(lambda normal=normal: normal)  # type: ignore[misc]
            landed = shortened(problem, state, -tangent.solve(gradient), FALL * size)
            if landed is None:
                return state
            state = landed
            yield Step(state)
    except SolveError:
        return state  # a random move may still help


def moved(problem: NonlinearProblem, state: np.ndarray, size: float, seed: int) -> np.ndarray:
    """u ± ε |u| g or u ± ε |u| |g| with g normal and 1, or the largest of |u|, for an unknown that is zero; the one of
    the four with the least ‖R‖.
    """
    g = np.random.default_rng(seed).standard_normal(len(state))
    scale = np.where(state != 0.0, np.abs(state), np.abs(state).max() or 1.0)
    trials = [state + size * scale * direction for direction in (g, -g, np.abs(g), -np.abs(g))]
    sizes = [problem.size(problem.residual(trial)) for trial in trials]
    return trials[int(np.nan_to_num(sizes, nan=np.inf).argmin())]
