"""R(u), K*⁻¹ b and J(u) v, as the callbacks of a library ask for them in the course of one run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nlsolve.plugin import KeptTangent, NonlinearProblem, SolveError, Status, Step, cached_jacobian, norm

LEAST_GAIN = 0.1  # each run goes on until this part of the residual it began with is left


class Served:
    """The callbacks of one run, and what has been found so far.

    goal : ‖R‖₂ at which the run may end: the one given, and a tenth of the first ‖R‖₂.
    direct : True if K* stands for the Jacobian of the library, as a factorised one does; False if that is J(u).
    contraction : per solve with K*, as the refresh rule was last told; None before the first solve.
    error : what a callback raised. An exception cannot pass through a library, so it is kept here.
    """

    def __init__(
        self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray, goal: float, direct: bool
    ) -> None:
        self._problem, self._tangent, self._direct = problem, tangent, direct
        self._jacobian = cached_jacobian(problem)
        self.goal = goal
        self.error: BaseException | None = None
        self._sizes: dict[bytes, float] = {}
        self.contraction: float | None = None
        self._at_tangent: np.ndarray | None = None  # where K* was last asked for
        self._solves = 0  # since then
        self._solved: tuple[np.ndarray, np.ndarray] | None = None
        self._state = start

    def guarded(self, callback: Callable[[], None]) -> int:
        """Call `callback`. Returns 0, or −1 with the exception kept in `error`, as a library in C expects it."""
        try:
            callback()
        except BaseException as error:
            self.error = error
            return -1
        return 0

    def residual(self, u: np.ndarray) -> np.ndarray:
        """R(u)."""
        residual = self._problem.residual(u)
        size = norm(residual)
        if not self._sizes:
            self.goal = min(self.goal, LEAST_GAIN * size)
        self._sizes[u.tobytes()] = size
        return residual

    def correction(self, u: np.ndarray) -> np.ndarray:
        """K*⁻¹ R(u), or 0 where ‖R(u)‖₂ ≤ goal and no solve is needed to stop."""
        residual = self.residual(u)
        return np.zeros_like(u) if self.solved(u) else self.solve(residual)

    def size(self, u: np.ndarray) -> float:
        """‖R(u)‖₂, evaluated only where the library has not asked for R."""
        known = self._sizes.get(u.tobytes())
        return norm(self.residual(u)) if known is None else known

    def solved(self, u: np.ndarray) -> bool:
        """‖R(u)‖₂ ≤ goal."""
        return self.size(u) <= self.goal

    def renew(self, u: np.ndarray) -> None:
        """The library asks for K* at u: the refresh rule is told the contraction since it last asked, and decides."""
        self.observe(u)
        self._state = self._at_tangent = u.copy()
        self._solves = 0
        self._tangent.refresh_if_due(lambda: self._jacobian.operator(u))

    def observe(self, u: np.ndarray) -> None:
        """Tell the refresh rule the contraction per solve with K*, from where K* was last asked for to u."""
        if self._at_tangent is not None and self._solves:
            before = self.size(self._at_tangent)
            self.contraction = (self.size(u) / before) ** (1.0 / self._solves) if before else 0.0
            self._tangent.observe(contraction=self.contraction)

    def linearize(self, u: np.ndarray) -> None:
        """From now on products are with J(u)."""
        self._state = u.copy()

    def solve(self, b: np.ndarray) -> np.ndarray:
        """K*⁻¹ b."""
        x = self._tangent.solve(b)
        self._solves += 1
        self._solved = x.copy(), b.copy()
        return x

    def product(self, v: np.ndarray) -> Any:
        """J(u) v; where K* stands for J and v is its last solution K*⁻¹ b, that is b."""
        if self._direct and self._solved is not None and np.array_equal(v, self._solved[0]):
            return self._solved[1]
        return self._jacobian(self._state) @ v

    def transposed_product(self, v: np.ndarray) -> Any:
        """J(u)ᵀ v."""
        return self._jacobian(self._state).T @ v


@dataclass(frozen=True)
class Ending:
    """Where a run ended.

    gave_up : why the library gave up, in its own word; empty if it reached the goal or used up its iterations.
    reported : the library's own counters, by the names of our columns.
    """

    state: np.ndarray
    gave_up: str
    reported: Mapping[str, float]


def runs(
    serve: Callable[[np.ndarray], Served],
    run: Callable[[Served, np.ndarray], Ending],
    start: np.ndarray,
    set_up_first: bool,
) -> Iterator[Step]:
    """The start, and the ends of the runs, each from the end of the one before.

    serve : gives the callbacks of a run from a state.
    set_up_first : whether the refresh rule is asked for K* before each run, for a library that does not ask for K*.

    A run that gives up where it began is followed by another one, before which the refresh rule may renew K*. Raises
    SolveError (stagnated) if that one gives up there too.
    """
    state, stuck = start, False
    yield Step(state)
    while True:
        served, before = serve(state), state
        if set_up_first:
            served.renew(state)
        ending = run(served, before)
        state = ending.state
        served.observe(state)
        again = bool(ending.gave_up) and not served.size(state) < served.size(before)
        if stuck and again:
            raise SolveError(Status.STAGNATED, ending.gave_up)
        stuck = again
        claim = False if ending.gave_up else None
        contraction = {} if served.contraction is None else {"contraction": served.contraction}
        yield Step(state, claim, {**contraction, **ending.reported})
