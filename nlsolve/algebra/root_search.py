"""F(u) = 0 from one start: the simulation of a system, and the check that its solve has ended at a root."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.scene import Simulation, Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array

NEAR = 0.01  # relative distance from a root within which a state is at the root
ALLOWED = 3.0  # distance from a root of multiplicity m, over ‖F‖^(1/m), that a small ‖F‖ does not belie
SUPERLINEAR, SLOWEST = 0.4, 0.95  # mean contraction of Newton's steps below which m = 1, and above which none is near
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
            root = self.nearest_root(outcome.state)
            away = None if root is None else float(np.linalg.norm(outcome.state - root))
            travelled = float(np.linalg.norm(outcome.state - self.start))
            outcome, self.doubt = verified(self.problem, outcome, self.linear, away, travelled)
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


def verified(
    problem: NonlinearProblem, outcome: Outcome, linear: LinearSolver, away: float | None, travelled: float
) -> tuple[Outcome, str]:
    """The outcome of a solve that has met its stopping test away from all known roots, and a doubt about it, or "".

    The state is another root when Newton's steps from it stay near. When they leave it, F may be small without a zero,
    as exp(−x) is at large x.

    Near is what is small beside u. At a root at the origin nothing is: where Newton's steps shrink by θ, towards a root
    of multiplicity m = 1/(1 − θ) at a distance of m times the first step, that distance may also be small beside the
    way from the start, or as small as ‖F‖^(1/m) lets expect.

    away : distance from the nearest known root, None when none is known. The status becomes "other root" where one is
        known, and is not the one that Newton's steps shrink towards.
    travelled : ‖u − start‖.
    """
    steps = newton_steps(problem, outcome.state, linear)
    moved = steps.displacement / _size(outcome.state)
    expected = ALLOWED * outcome.residual_absolute ** (1.0 / steps.multiplicity)
    shrink = steps.contraction <= SLOWEST and (steps.displacement <= NEAR * travelled or steps.distance <= expected)
    if moved <= NEAR or shrink:
        found = Status.OTHER_ROOT
        is_known = away is None or (shrink and away <= 2.0 * steps.distance)
        return (outcome if is_known else replace(outcome, status=found, detail=found.sentence)), ""
    return outcome, (
        f"no root is near: {POLISHING} Newton steps lead {100 * moved:.3g} % away from where ‖F‖ is "
        f"{outcome.residual_norm:.1e}; tighten stop.tolerance"
    )


@dataclass(frozen=True)
class NewtonSteps:
    """Ten Newton steps from a state: ‖u_10 − u‖ (infinite when a step fails), the length of the first, and by how much
    one is shorter than the one before, in the mean.
    """

    displacement: float
    first: float
    contraction: float

    @property
    def multiplicity(self) -> float:
        """m of the root that steps shrink towards."""
        return 1.0 if self.contraction <= SUPERLINEAR else 1.0 / (1.0 - min(self.contraction, SLOWEST))

    @property
    def distance(self) -> float:
        """Of that root, in steps of Newton."""
        return self.multiplicity * self.first


LOST = NewtonSteps(np.inf, np.inf, np.inf)


def displacement(problem: NonlinearProblem, u: Array, linear: LinearSolver) -> float:
    """‖u_10 − u‖/‖u‖ for ten Newton steps from u (U,); infinite when a step fails."""
    moved = newton_steps(problem, u, linear).displacement
    return moved / _size(u) if np.isfinite(moved) else moved


def newton_steps(problem: NonlinearProblem, u: Array, linear: LinearSolver) -> NewtonSteps:
    """Ten Newton steps from u (U,), which are not timed; fewer where F = 0 or a step is lost in rounding."""
    state, lengths = u, list[float]()
    for _ in range(POLISHING):
        residual = problem.residual(state)
        if not residual.any():
            lengths.append(0.0)
            break
        try:
            step = _newton_step(problem, state, residual, linear)
        except SolveError:
            return LOST
        if step is None:
            return LOST
        state = state + step
        lengths.append(float(np.linalg.norm(step)))
        if lengths[-1] <= np.finfo(float).eps * np.linalg.norm(state):
            break
    moved = float(np.linalg.norm(state - u))
    if not np.isfinite(moved):
        return LOST
    first, last, count = lengths[0], lengths[-1], len(lengths) - 1
    return NewtonSteps(moved, first, (last / first) ** (1.0 / count) if first and count else 0.0)


def _newton_step(problem: NonlinearProblem, u: Array, residual: Array, linear: LinearSolver) -> Array | None:
    """−J⁻¹ F at u (U,), of least norm for few unknowns; None where F or J is not finite."""
    jacobian = problem.jacobian(u)
    if not (np.isfinite(residual).all() and np.isfinite(jacobian.data).all()):
        return None
    if len(u) <= DENSE:
        return np.linalg.lstsq(jacobian.toarray(), -residual, rcond=None)[0]
    return linear.factorize(jacobian).solve(-residual)


def _size(u: Array) -> float:
    return float(np.linalg.norm(u)) or 1.0
