"""F(u) = 0 from start to record: one case of a system, solved under the driver and held against its known roots."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import SolveError, Status
from nlsolve.contracts.system import System
from nlsolve.flow.setup import Progress, Record
from nlsolve.results.columns import STEPS
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.summary import row_of
from nlsolve.solving.tangent import Tangent

NEAR = 0.01  # of the size of a root: a state is at the root nearer than this
POLISHING = 10  # Newton steps that must not lead further away than that from a root nobody has listed
DENSE = 300  # unknowns up to which these steps are least squares of least norm, which a singular Jacobian allows


@dataclass(frozen=True)
class AlgebraicSetup:
    """The components of one case of a system: no law, no discretizer, no way to a first state."""

    scene: System
    linear: LinearSolver
    solver: NonlinearSolver
    refresh: RefreshRule
    stop: StoppingTest = field(default_factory=StoppingTest)
    budget: Budget = field(default_factory=Budget)


@np.errstate(all="ignore")  # what is not finite becomes a status, a doubt or a NaN
def solve_system(
    setup: AlgebraicSetup,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
) -> Record:
    """Run one case; every ending, failure included, is in the record. `clock` is what its seconds are told by."""
    ledger = Ledger(clock)
    tangent = Tangent(setup.linear, setup.refresh, ledger)
    with ledger.entry("operators"):
        problem = FormulaProblem.of(setup.scene)
    start = setup.scene.start()
    outcome = solve(problem, setup.solver, tangent, start, setup.stop, setup.budget, ledger)
    outcome, judgement = judged(setup.scene, problem, outcome, setup.linear)
    if listen is not None:
        listen(Progress(1, 1, tangent.branches, ledger.counts["factorization"]))
    summary: dict[str, Any] = {
        **row_of(outcome, ledger, tangent),
        "increments": int(outcome.converged),
        "seconds_operators": ledger.seconds["operators"],
        "seconds_all": ledger.seconds["method"] + ledger.seconds["operators"],
        **judgement,
    }
    rows = [{"increment": 0, "accepted": False, **row} for row in outcome.rows]
    if outcome.converged:
        rows[-1]["accepted"] = True
    return Record(
        summary,
        pd.DataFrame(rows, columns=[name for name in STEPS if name != "case"]),
        problem=problem,
        state=outcome.state,
    )


def judged(
    system: System, problem: NonlinearProblem, outcome: Outcome, linear: LinearSolver
) -> tuple[Outcome, dict[str, Any]]:
    """The outcome held against the known roots of a system, and what `runs` is told of that."""
    error, doubt = root_error(system, outcome.state), ""
    if outcome.status is Status.CONVERGED and not error <= NEAR:
        outcome, doubt = verified(problem, outcome, linear, known=not np.isnan(error))
    return outcome, {"root_error": error, "root_singular": system.singular, "doubt": doubt}


def root_error(system: System, u: Array) -> float:
    """‖u − root‖/‖root‖ for the nearest known root, ‖u‖ for the root 0; NaN where none is known."""
    root = system.nearest_root(u)
    return np.nan if root is None else float(np.linalg.norm(u - root)) / _size(root)


def verified(problem: NonlinearProblem, outcome: Outcome, linear: LinearSolver, known: bool) -> tuple[Outcome, str]:
    """The outcome of a state at which the stopping test is met away from all known roots, and what is in doubt of it.

    Another root when Newton's steps stay; elsewhere F may be small without a zero, as it is far out on exp(−x).
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
    """‖u_10 − u‖/‖u‖ for ten Newton steps from u, off the clock; infinite when a step fails."""
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
