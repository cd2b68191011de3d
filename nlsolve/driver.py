"""The one loop: every method is stopped by the same outside test, and every ending becomes a status."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.component import Component
from nlsolve.ledger import Audited, Ledger
from nlsolve.problems import NonlinearProblem
from nlsolve.series import Array
from nlsolve.solvers import NonlinearSolver, Step
from nlsolve.status import SolveError, Status
from nlsolve.tangent import Tangent

GROWTH_OF_DIVERGENCE = 1e6  # residual over the larger of its first value and its scale
VERIFIED = 1e-6  # relative residual below which a state counts as solved where the stopping test does not say
PATIENCE = 40  # steps without a new smallest residual before a method is said to stagnate


class StoppingTest(Component):
    """When is an increment solved?

    residual : ‖R(u)‖₂ / scale ≤ tolerance, the residual asked for by the driver, off the clock. The fair test.
    difference : ‖u_i − u_{i−1}‖ / ‖u_i‖ ≤ tolerance in the named norm, the test of iterative "Algo2" in the 2015 paper.
    claim : the method says so itself (a_max ≥ 1 for a series, with its own η), as for "Algo1" in the 2015 paper.
    """

    noun: ClassVar[str] = "stop"

    kind: Literal["residual", "difference", "claim"] = "residual"
    tolerance: float = Field(1e-8, gt=0, description="largest relative residual or relative difference accepted")
    norm: Literal["euclidean", "maximum", "components"] = Field(
        "euclidean", description="of a difference: over all nodes, its largest entry, or the larger of u's and v's norm"
    )

    @property
    def verified(self) -> float:
        """The relative residual up to which a state is held to be a solution, whatever the method says of it."""
        return self.tolerance if self.kind == "residual" else VERIFIED

    def met(self, step: Step, residual_norm: float, difference: float) -> bool:
        """Is this step a solution?"""
        if self.kind == "claim":
            return bool(step.claim)
        return (residual_norm if self.kind == "residual" else difference) <= self.tolerance

    def difference(self, state: Array, before: Array) -> float:
        """‖u_i − u_{i−1}‖ / ‖u_i‖ in the test's norm; for "components" the larger of the two ratios."""
        if self.norm == "components":
            pairs = [(state[i::2], before[i::2]) for i in (0, 1)]
            return max(_relative(u - w, u, 2) for u, w in pairs)
        return _relative(state - before, state, np.inf if self.norm == "maximum" else 2)


def _relative(change: Array, value: Array, order: float) -> float:
    size = float(np.linalg.norm(value, order))
    moved = float(np.linalg.norm(change, order))
    return moved / size if size else (np.inf if moved else 0.0)


class Budget(Component):
    """What one increment may cost before it counts as failed."""

    noun: ClassVar[str] = "budget"

    iterations: int = Field(200, gt=0, description="iterations or series per increment")
    pressures: int = Field(
        60, gt=0, description="iterations of the pressure per increment, where a scene asks for them"
    )


@dataclass(frozen=True)
class Outcome:
    """How one solve ended: its status, the last state, the residual that counts, and a row a step.

    claimed_wrongly, denied_wrongly : the method said converged of a state that is no solution, failed of one that is.
    blame : of a solve that failed, where the last residual is largest (`NonlinearProblem.blame`).
    """

    status: Status
    detail: str
    state: Array
    residual_norm: float
    steps: tuple[dict[str, Any], ...]
    claimed_wrongly: bool = False
    denied_wrongly: bool = False
    blame: Mapping[str, float] = field(default_factory=dict)


@np.errstate(all="ignore")  # what is not finite becomes a status, not a warning
def solve(
    problem: NonlinearProblem,
    solver: NonlinearSolver,
    tangent: Tangent,
    start: Array,
    stop: StoppingTest,
    budget: Budget,
    ledger: Ledger,
) -> Outcome:
    """Take steps of `solver` on `problem` from `start` until the stopping test, the budget or a failure ends it."""
    audited = Audited(problem, ledger)
    scale = audited.scale(start)
    before, rows = start, list[dict[str, Any]]()
    residual_norm = np.inf
    claimed = denied = False

    def ended(status: Status, detail: str = "") -> Outcome:
        blame: Mapping[str, float] = {}
        if status is not Status.CONVERGED and np.isfinite(before).all():
            blame = problem.blame(before, audited.residual(before))
        sentence = detail or status.sentence
        return Outcome(status, sentence, before, float(residual_norm), tuple(rows), claimed, denied, blame)

    if not np.isfinite(scale):
        return ended(
            Status.NON_FINITE, "the forces at the first state are not finite: the law gave no finite viscosity"
        )
    iterator = iter(solver.steps(audited.view, tangent.view, start))
    first = best = np.inf
    since_best = 0
    for number in range(budget.iterations + 1):
        try:
            with ledger.entry("method"):
                step = next(iterator, None)
        except SolveError as error:
            denied |= residual_norm <= stop.verified
            return ended(error.status, error.detail)
        if step is None:
            return ended(Status.STAGNATED, "the method stopped by itself before the stopping test was met")
        residual_norm = float(np.linalg.norm(audited.residual(step.state))) / scale
        difference = stop.difference(step.state, before) if number else np.nan
        before = step.state.copy()  # a method may go on working in its array
        rows.append(
            {
                "step": number,
                "branch": tangent.branches,
                "triangular_solves": ledger.counts["triangular_solve"],
                "residual_norm": residual_norm,
                "difference": difference,
                "seconds": ledger.seconds["method"],
                **step.notes,
            }
        )
        solved = residual_norm <= stop.verified
        claimed |= step.claim is True and not solved
        denied |= step.claim is False and solved
        if not np.isfinite(residual_norm):
            return ended(Status.OUT_OF_DOMAIN if np.isfinite(step.state).all() else Status.NON_FINITE)
        if stop.met(step, residual_norm, difference):
            claimed |= not solved  # the test of differences speaks for the method
            return ended(Status.CONVERGED)
        if number == 0:
            first = residual_norm
        if residual_norm > GROWTH_OF_DIVERGENCE * max(1.0, first):
            return ended(Status.DIVERGED)
        since_best = 0 if residual_norm < best else since_best + 1
        best = min(best, residual_norm)
        if since_best >= PATIENCE:
            return ended(Status.STAGNATED)
    return ended(Status.BUDGET_SPENT)
