"""K*: factorises whatever sparse matrix a method assembles, and knows the contraction of every step of every method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from cases import run
from nlsolve_rules.refresh import AverageCost, EveryIteration, Never, PoorContraction
from nlsolve_solvers import LevenbergMarquardt, Newton, NewtonKrylov
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod

from nlsolve import Status
from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, RefreshRule, Step, TangentHistory
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_solver
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))


# A stranger's matrices.


class Shifted(NonlinearSolver):
    """(J + σ I) w = −R(u), σ = ‖R(u)‖."""

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
        state, identity = start, sp.eye_array(len(start))
        while True:
            yield Step(state)
            residual = problem.residual(state)
            shift = float(np.linalg.norm(residual))
            tangent.refresh_if_due(lambda: problem.jacobian(state) + shift * identity)
            state = state - tangent.solve(residual)


class Normal(NonlinearSolver):
    """(JᵀJ + σ D) w = −Jᵀ R(u), D = diag(JᵀJ), σ = ‖R(u)‖."""

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            residual, jacobian = problem.residual(state), problem.jacobian(state)
            normal, shift = jacobian.T @ jacobian, float(np.linalg.norm(residual))
            tangent.refresh_if_due(lambda: normal + shift * sp.diags_array(normal.diagonal()))
            state = state - tangent.solve(jacobian.T @ residual)


class Chord(NonlinearSolver):
    """w = −A⁻¹ R(u) with A = diag(5), of which the problem knows nothing."""

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: 5.0 * sp.eye_array(len(state), format="csr"))
            state = state - tangent.solve(problem.residual(state))


@pytest.mark.parametrize("solver", [Shifted(), Normal(), Chord()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(), AverageCost(ratio=2.0)], ids=lambda r: r.kind)
def test_a_stranger_factorises_a_matrix_of_its_own(solver: NonlinearSolver, rule: RefreshRule) -> None:
    check_solver(solver, rule)


def test_the_work_of_a_stranger_is_counted() -> None:
    outcome, ledger = run(ToyProblem(), Normal(), EveryIteration(), START, DenseLU())
    k = len(outcome.rows) - 1
    kinds = ("jacobian", "factorization", "triangular_solve", "matrix_product")
    assert [ledger.counts[kind] for kind in kinds] == [k, k, k, k]


def test_refinement_counts_products_with_a_plain_matrix_too() -> None:
    ledger = Ledger()
    tangent = Tangent(DenseLU(refinement=2), None, ledger)
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    np.testing.assert_allclose(ToyProblem.matrix @ tangent.solve(START), START, rtol=1e-12)
    assert (ledger.counts["triangular_solve"], ledger.counts["matrix_product"]) == (3, 2)


def test_nothing_is_assembled_while_the_tangent_is_kept() -> None:
    tangent = Tangent(DenseLU(), Never(), Ledger())
    assert tangent.refresh_if_due(lambda: ToyProblem.matrix)
    assert not tangent.refresh_if_due(lambda: pytest.fail("assembled for nothing"))


# Contraction.


class Watching(RefreshRule):
    """Keeps K*, and what it was told."""

    seen: list[Any]

    def due(self, history: TangentHistory) -> bool:
        self.seen.append(history.contraction)
        return False


class Silent(NonlinearSolver):
    """Newton's loop as the contract prints it: nothing is said of the contraction."""

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))


@pytest.mark.parametrize("rule", [PoorContraction(limit=0.2), AverageCost(ratio=2.0)], ids=lambda rule: rule.kind)
def test_every_rule_works_with_a_method_that_says_nothing(rule: RefreshRule) -> None:
    far = START + 2.0
    check_solver(Silent(), rule)
    outcome, ledger = run(ToyProblem(), Silent(), rule, far, DenseLU())
    kept, kept_ledger = run(ToyProblem(), Silent(), Never(), far, DenseLU())
    assert outcome.status is kept.status is Status.CONVERGED
    assert 1 < ledger.counts["factorization"] < len(outcome.rows) - 1
    assert len(outcome.rows) < len(kept.rows)
    assert kept_ledger.counts["factorization"] == 1


def test_the_driver_measures_what_a_step_left_of_the_residual() -> None:
    problem, rule = ToyProblem(), Watching(seen=[])
    outcome, _ = run(problem, Silent(), rule, START, DenseLU())
    sizes = [row["residual_norm"] for row in outcome.rows]
    column = [row["contraction"] for row in outcome.rows]
    assert np.isnan(column[0])
    np.testing.assert_allclose(column[1:], np.divide(sizes[1:], sizes[:-1]), rtol=1e-14)
    assert rule.seen == [None, *column[1:-1]][1:]  # the rule is asked from the second iteration on


def test_the_last_step_of_a_solve_is_known_to_the_next() -> None:
    ledger, rule = Ledger(), Watching(seen=[])
    tangent = Tangent(DenseLU(), rule, ledger)
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    tangent.step_taken(None)
    tangent.step_taken(0.25)
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    assert rule.seen == [0.25]


def test_what_a_method_has_said_is_not_overridden() -> None:
    tangent = Tangent(DenseLU(), Never(), Ledger())
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    tangent.observe(contraction=0.125)
    tangent.step_taken(0.5)
    assert tangent.history.contraction == 0.125
    tangent.step_taken(0.5)  # of the next step it has said nothing
    assert tangent.history.contraction == 0.5


def test_a_new_tangent_is_judged_by_its_own_step() -> None:
    """What was said of the step that K* was renewed for does not count for the new K*."""
    tangent = Tangent(DenseLU(), EveryIteration(), Ledger())
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    tangent.observe(contraction=7.0)
    tangent.refresh_if_due(lambda: ToyProblem.matrix)
    assert tangent.history.contraction is None
    tangent.step_taken(0.5)
    assert tangent.history.contraction == 0.5


@pytest.mark.parametrize("solver", [NewtonKrylov(), AsymptoticNumericalMethod()], ids=lambda solver: solver.kind)
def test_a_methods_own_note_of_the_contraction_wins(solver: NonlinearSolver) -> None:
    """Per inner iteration, or per order, and not that of the whole step."""
    rule = Watching(seen=[])
    outcome, _ = run(ToyProblem(), solver, rule, START + 1.0, DenseLU())
    column = [row["contraction"] for row in outcome.rows[1:]]
    sizes = np.array([row["residual_norm"] for row in outcome.rows])
    assert column[0] != pytest.approx(sizes[1] / sizes[0], rel=0.1)
    assert rule.seen[0] == column[0]


@pytest.mark.parametrize("solver", [Newton(), LevenbergMarquardt()], ids=lambda solver: solver.kind)
def test_the_contraction_of_every_step_is_in_the_table(solver: NonlinearSolver) -> None:
    outcome, _ = run(ToyProblem(), solver, EveryIteration(), START, DenseLU())
    assert np.isfinite([row["contraction"] for row in outcome.rows[1:]]).all()
