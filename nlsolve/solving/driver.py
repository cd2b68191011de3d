"""The one loop around every method: a test outside the method stops it, and every ending becomes a status."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from operator import lt
from typing import Any

import numpy as np

from nlsolve.algebra.by_equation import ByEquation
from nlsolve.algebra.measure import ByScale, Measure, Sizes
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.status import CaseStopped, SolveError, Status
from nlsolve.results.columns import step_columns
from nlsolve.series import Array
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.solving.work.promises import checked_residual, checked_step

GROWTH_OF_DIVERGENCE = 1e6  # residual over the larger of its first value and its scale
PATIENCE = 40  # steps without a new smallest residual, by any of its sizes, after which a method has stagnated


@np.errstate(all="ignore")  # what is not finite becomes a status, not a warning
def solve(
    problem: NonlinearProblem,
    solver: NonlinearSolver,
    tangent: Tangent,
    start: Array,
    stop: StoppingTest,
    budget: Budget,
    ledger: Ledger,
    keep: Callable[[Array], None] | None = None,
) -> Outcome:
    """Take steps of `solver` on `problem` from `start` (U,) until the stopping test, the budget or a failure ends them.

    After every step the driver measures ‖R_new‖/‖R_old‖ for the table of steps and for the refresh rule of `tangent`.
    A SolveError of the method becomes the status of the outcome, as does the limit at which the case is stopped; any
    other error is raised, as is a TypeError for what is no state or no residual (`nlsolve.solving.work.promises`).

    keep : is called with the state of each row of steps, its own copy.
    """
    counted = CountedProblem(problem, ledger, tangent.operator)
    begun, renewals, withheld = ledger.copy(), tangent.renewals, tangent.withheld
    measure = _measure_of(problem, start, counted.first_residual(start), tangent.linear)
    counted.judged_by(measure, start)
    before = start
    rows: list[dict[str, Any]] = []
    sizes = Sizes(np.inf, np.inf, np.inf, np.inf)
    claimed = denied = False
    idle = 0

    def ended(status: Status, detail: str = "") -> Outcome:
        blame: Mapping[str, float] = {}
        if status is not Status.CONVERGED and np.isfinite(before).all():
            blame = problem.blame(before, counted.uncounted_residual(before))
        if status is not Status.CONVERGED and tangent.operator is not None and tangent.withheld > withheld:
            name = tangent.operator.name
            detail = f"{detail or status.sentence}; the refresh rule asked for a new K*, and {name} has no other"
        spent = ledger.since(begun)
        return Outcome(
            status,
            detail or status.sentence,
            before,
            float(sizes.relative),
            tuple(rows),
            claimed,
            denied,
            blame,
            {"tangents": tangent.renewals - renewals, **spent.counted()},
            spent.timed(),
            rows[-1]["residual_absolute"] if rows else np.inf,
            measure.correction,
            idle,
        )

    def is_solved(state: Array, residual: Array) -> bool:
        if stop.kind == "absolute":
            return stop.size(residual) <= stop.tolerance
        return measure.settled(state, residual, float(sizes.relative), stop.verified)

    if not isfinite(measure.scale):
        why = problem.undefined(start) or "the law gave no finite viscosity"
        return ended(Status.NON_FINITE, f"the forces at the first state are not finite: {why}")
    if tangent.operator is not None and not solver.uses_operator:
        return ended(
            Status.NOT_APPLICABLE,
            f"{type(solver).__name__} factorises a matrix of its own, in which {tangent.operator.name} has no say: "
            "leave `operator` at its default, or choose a method that keeps any K*, such as modified-newton",
        )
    iterator = iter(solver.steps(counted, tangent, start))
    first, best = np.inf, [np.inf] * 3
    since_best = 0
    for number in range(budget.iterations + 1):
        worked = ledger.counts.total() - ledger.counts["method"]
        try:
            with ledger.entry("method"):
                step = next(iterator, None)
        except SolveError as error:
            lost = error.status is Status.SINGULAR_TANGENT
            residual = counted.uncounted_residual(before)
            if not stop.is_of_residuals and (sizes.size == 0.0 or (lost and measure.vanishes(before, residual))):
                return ended(Status.CONVERGED, "R = 0, and the method has no further step to compare or to claim")
            denied |= bool(rows) and is_solved(before, residual)
            return ended(error.status, error.detail)
        except np.linalg.LinAlgError as error:  # of the dense algebra that a method has of its own
            return ended(Status.NON_FINITE, f"the method's own linear algebra failed on its numbers: {error}")
        except CaseStopped as limit:
            return ended(limit.status, limit.detail)
        if step is None:
            return ended(Status.STAGNATED, "the method stopped by itself before the stopping test was met")
        state = checked_step(step, start, solver).state
        residual = counted.uncounted_residual(state)
        if not number:
            checked_residual(residual, start, problem)
        elif ledger.counts.total() - ledger.counts["method"] == worked and not np.array_equal(state, before):
            idle += 1
        size_before, sizes = sizes.size, measure.sizes(state, residual)
        contraction = (sizes.size / size_before if size_before else 0.0) if number else None
        tangent.step_taken(contraction)
        difference = stop.difference(step.state, before) if number else np.nan
        before = step.state.copy()  # a method may overwrite its array later
        if keep is not None:
            keep(before)
        measured = {
            "step": number,
            "tangents": tangent.renewals,
            "triangular_solves": ledger.counts["triangular_solve"],
            "residual_norm": sizes.relative,
            "residual_absolute": sizes.absolute,
            "difference": difference,
            "seconds": ledger.seconds["method"],
        }
        told = np.nan if contraction is None else contraction
        rows.append({**measured, "contraction": told, **step_columns(step.notes), **measured})
        solved = step.claim is not None and is_solved(before, residual)
        claimed |= step.claim is True and not solved
        denied |= step.claim is False and solved
        if not isfinite(sizes.relative):
            if not np.isfinite(step.state).all():
                return ended(Status.NON_FINITE)
            return ended(Status.OUT_OF_DOMAIN, problem.undefined(step.state))
        if stop.met(step, partial(is_solved, before, residual), difference):
            if not stop.is_of_residuals:  # accepts a state without its residual
                claimed |= not is_solved(before, residual)
            if stop.kind == "absolute":
                measure.settled(step.state, residual, sizes.relative, np.inf)  # for the correction that is reported
            return ended(Status.CONVERGED)
        progress = sizes.size / measure.scale
        if number == 0:
            first = progress
        if progress > GROWTH_OF_DIVERGENCE * max(1.0, first):
            return ended(Status.DIVERGED)
        now = progress, sizes.weighted, sizes.relative
        since_best = 0 if any(map(lt, now, best)) else since_best + 1
        best = list(map(min, best, now))
        if since_best >= PATIENCE:
            return ended(Status.STAGNATED)
    return ended(Status.BUDGET_SPENT)


def _measure_of(problem: NonlinearProblem, start: Array, residual: Array, linear: LinearSolver) -> Measure:
    """The measure of a solve from `start` (U,), where R = `residual` (U,).

    linear : solves the linear systems of corrections, off the clock.
    """
    return ByScale(problem, problem.scale(start)) if problem.has_scale else ByEquation(problem, start, residual, linear)
