"""F(u) = 0 from one start: the simulation of a system, and the check that its solve has ended at a root."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.scene import Simulation, Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array

NEAR = 0.01  # relative distance from a root within which a state is at the root
POLISHING = 10  # Newton steps from an unlisted root, which must not lead further away than that
DENSE = 300  # unknowns up to which these steps are least-norm least squares, which a singular Jacobian allows


class RootSearch(Simulation):
    """F(u) = 0 from one `start` (U,); the state that the solve ends at is compared with the nearest known root.

    linear : solves the linear systems of the check, see `verified`.
    nearest_root : u -> the nearest known root, (U,); None where none is known.
    singular : whether the Jacobian is singular at a known root.

    A state that meets the stopping test away from all known roots is an unlisted root or a doubt, see `verified`.
    """

    def __init__(
        self,
        problem: NonlinearProblem,
        start: Array,
        linear: LinearSolver,
        nearest_root: Callable[[Array], Array | None],
        singular: bool = False,
    ) -> None:
        self.problem, self.start, self.linear = problem, start, linear
        self.nearest_root, self.singular = nearest_root, singular
        self.doubt = ""
        self.sizes = {"unknowns": len(start)}

    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        """Yields the one problem; the status of its outcome tells another root from a known one."""
        outcome = yield Solve(self.problem, self.start)
        error = root_error(self.nearest_root(outcome.state), outcome.state)
        if outcome.status is Status.CONVERGED and not error <= NEAR:
            outcome, self.doubt = verified(self.problem, outcome, self.linear, known=not np.isnan(error))
        return outcome

    def sample(self) -> tuple[NonlinearProblem, Array]:
        """The problem and its start."""
        return self.problem, self.start

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """Distance from the nearest known root, whether J is singular at a root, and the doubt about the state."""
        return {
            "root_error": root_error(self.nearest_root(outcome.state), outcome.state),
            "root_singular": self.singular,
            "doubt": self.doubt,
        }


def root_error(root: Array | None, u: Array) -> float:
    """‖u − root‖/‖root‖ for u and root (U,), ‖u‖ for the root 0; NaN when no root is known."""
    return np.nan if root is None else float(np.linalg.norm(u - root)) / _size(root)


def verified(problem: NonlinearProblem, outcome: Outcome, linear: LinearSolver, known: bool) -> tuple[Outcome, str]:
    """The outcome of a solve that has met its stopping test away from all known roots, and a doubt about it, or "".

    The state is another root when Newton's steps from it stay near. When they leave it, F may be small without a zero,
    as exp(−x) is at large x.

    known : whether any root is known; only then the status becomes "other root".
    """
    moved = displacement(problem, outcome.state, linear)
    if moved <= NEAR:
        found = Status.OTHER_ROOT
        return (replace(outcome, status=found, detail=found.sentence) if known else outcome), ""
    return outcome, (
        f"no root is near: {POLISHING} Newton steps lead {100 * moved:.3g} % away from where ‖F‖ is "
        f"{outcome.residual_norm:.1e}; tighten stop.tolerance"
    )


def displacement(problem: NonlinearProblem, u: Array, linear: LinearSolver) -> float:
    """‖u_10 − u‖/‖u‖ for ten Newton steps from u (U,), which are not timed; infinite when a step fails."""
    state = u
    for _ in range(POLISHING):
        residual, jacobian = problem.residual(state), problem.jacobian(state)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian.data).all()):
            return np.inf
        if len(u) <= DENSE:
            step = np.linalg.lstsq(jacobian.toarray(), -residual, rcond=None)[0]
        else:
            try:
                step = linear.factorize(jacobian).solve(-residual)
            except SolveError:
                return np.inf
        state = state + step
        if np.linalg.norm(step) <= np.finfo(float).eps * np.linalg.norm(state):
            break
    moved = float(np.linalg.norm(state - u)) / _size(u)
    return moved if np.isfinite(moved) else np.inf


def _size(u: Array) -> float:
    return float(np.linalg.norm(u)) or 1.0
