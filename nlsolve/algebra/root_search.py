"""F(u) = 0 from one start: the simulation of a system, and the check that its solve has ended at a root."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.algebra.by_equation import ALLOWED, NEAR, SLOWEST, SUPERLINEAR, ByEquation, Correction
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.scene import Simulation, Solve, state_rows
from nlsolve.contracts.status import Status
from nlsolve.series import Array

POLISHING = 10  # Newton steps from an unlisted root, which must not lead further away than `NEAR`
VANISHED = 1e-12  # entry of a root, over the size that the unknown began with, that is zero but for rounding
SETTLED = 1e-6  # relative residual and Newton correction of a state beyond doubt


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
        self.root_error = np.nan
        self.sizes = {"unknowns": len(start)}
        self.reached = np.zeros(0)

    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        """Yields the one problem; the status of its outcome tells another root from a known one."""
        outcome = yield Solve(self.problem, self.start)
        self.reached = outcome.state
        root = self.nearest_root(outcome.state)
        if root is None and outcome.newton_correction <= SETTLED:
            return outcome
        judge = ByEquation(self.problem, self.start, self.problem.residual(self.start), self.linear)
        self.root_error = root_error(root, outcome.state, judge.begun)
        if outcome.status is Status.CONVERGED and not self.root_error <= NEAR:
            outcome, self.doubt = verified(self.problem, outcome, judge, self.start, root)
        return outcome

    def sample(self) -> tuple[NonlinearProblem, Array]:
        """The problem and its start."""
        return self.problem, self.start

    def fields(self) -> pd.DataFrame:
        """The state that the solve ended at, whatever its ending."""
        return state_rows(self.reached)

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """Distance from the nearest known root, whether J is singular at a root, and the doubt about the state."""
        return {"root_error": self.root_error, "root_singular": self.singular, "doubt": self.doubt}


def root_error(root: Array | None, u: Array, begun: Array) -> float:
    """max_j |u_j − root_j| / |root_j| for u and root (U,); where root_j is zero, over the size `begun` (U,) that the
    unknown began with, and where that is zero too, over the largest entry of the root, or of u. NaN when no root is
    known.
    """
    if root is None:
        return np.nan
    sizes = np.where(np.abs(root) > VANISHED * begun, np.abs(root), begun)
    largest = float(np.abs(root).max(initial=0.0)) or float(np.abs(u).max(initial=0.0))
    return farthest(u - root, np.where(sizes > 0.0, sizes, largest))


def farthest(change: Array, sizes: Array) -> float:
    """max_j |change_j| / size_j, (U,) both; infinite where an unknown without a size changes."""
    moved = np.abs(change)
    parts = np.divide(moved, sizes, out=np.where(moved > 0.0, np.inf, 0.0), where=sizes > 0.0)
    return float(np.nan_to_num(parts, nan=np.inf).max(initial=0.0))


def verified(
    problem: NonlinearProblem, outcome: Outcome, judge: ByEquation, start: Array, root: Array | None
) -> tuple[Outcome, str]:
    """The outcome of a solve that has met its stopping test away from all known roots, and a doubt about it, or "".

    The state is another root when its residual and its Newton correction are small, or when Newton's steps from it stay
    near. When they leave it, F may be small without a zero, as exp(−x) is at large x.

    Near is what is small beside each unknown. Where Newton's steps shrink by θ, towards a root of multiplicity
    m = 1/(1 − θ) at a distance of m times the first step, that distance may also be small beside the way from the
    start, or as small as the part of F that is left, to the power 1/m, lets expect of that way.

    root : the nearest known root, None when none is known. The status becomes "other root" where one is known, and is
        not the one that Newton's steps shrink towards.
    """
    u = outcome.state
    residual = problem.residual(u)
    settled = outcome.newton_correction <= SETTLED or judge.settled(u, residual, outcome.residual_norm, SETTLED)
    if settled and root is None:
        return outcome, ""
    steps = newton_steps(problem, u, judge)
    travelled = farthest(u - start, steps.sizes)
    left = judge.size(residual) / (judge.size(problem.residual(start)) or 1.0)
    expected = ALLOWED * travelled * left ** (1.0 / steps.multiplicity)
    shrink = steps.contraction <= SLOWEST and (steps.displacement <= NEAR * travelled or steps.distance <= expected)
    if settled or steps.displacement <= NEAR or shrink:
        found = Status.OTHER_ROOT
        is_known = root is None or (shrink and farthest(u - root, steps.sizes) <= 2.0 * steps.distance)
        return (outcome if is_known else replace(outcome, status=found, detail=found.sentence)), ""
    return outcome, (
        f"no root is near: {POLISHING} Newton steps lead {100 * steps.displacement:.3g} % away from where ‖F‖ is "
        f"{outcome.residual_absolute:.1e}; tighten stop.tolerance"
    )


@dataclass(frozen=True)
class NewtonSteps:
    """Ten Newton steps from u, unknown by unknown: max_j |u_10 − u|_j/d_j (infinite when a step fails), the first
    step, by how much one is shorter than the one before, in the mean, and the sizes d of the unknowns at u, (U,).
    """

    displacement: float
    first: float
    contraction: float
    sizes: Array

    @property
    def multiplicity(self) -> float:
        """m of the root that steps shrink towards."""
        return 1.0 if not SUPERLINEAR < self.contraction < np.inf else 1.0 / (1.0 - min(self.contraction, SLOWEST))

    @property
    def distance(self) -> float:
        """Of that root, in steps of Newton."""
        return self.multiplicity * self.first


def newton_steps(problem: NonlinearProblem, u: Array, judge: ByEquation) -> NewtonSteps:
    """Ten Newton steps from u (U,), which are not timed; fewer where F = 0 or a step is lost in rounding."""
    state, lengths = u, list[float]()
    sizes = np.abs(u)
    for _ in range(POLISHING):
        residual = problem.residual(state)
        if not residual.any():
            lengths.append(0.0)
            break
        step: Correction | None = judge.step(state, residual)
        if step is None:
            return NewtonSteps(np.inf, np.inf, np.inf, sizes)
        sizes = sizes if lengths else step.sizes
        state = state + step.sizes * step.scaled
        lengths.append(farthest(step.sizes * step.scaled, sizes))
        if lengths[-1] <= np.finfo(float).eps:
            break
    moved = farthest(state - u, sizes)
    if not np.isfinite(moved):
        return NewtonSteps(np.inf, np.inf, np.inf, sizes)
    first, last, count = lengths[0], lengths[-1], len(lengths) - 1
    return NewtonSteps(moved, first, (last / first) ** (1.0 / count) if first and count else 0.0, sizes)
