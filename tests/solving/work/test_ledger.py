"""The ledger: exact counts of known runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from cases import near, run, spin_flow
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import EveryIteration, Never
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton

from nlsolve import Status
from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, Step
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))


def counts(ledger: Ledger) -> dict[str, int]:
    return {kind: count for kind, count in ledger.counts.items() if kind != "method" and count}


@pytest.mark.parametrize("index", [1.0, 0.5])
def test_k_newton_iterations_cost_k_factorisations_k_solves_and_k_plus_one_residuals(index: float) -> None:
    flow = spin_flow(index)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.7))
    assert outcome.status is Status.CONVERGED
    k = len(outcome.rows) - 1
    assert all(step["length"] == 1.0 for step in outcome.rows[1:])  # no backtracking
    assert counts(ledger) == {"residual": k + 1, "jacobian": k, "factorization": k, "triangular_solve": k}


def test_backtracking_is_paid_in_residuals() -> None:
    flow = spin_flow(0.1324)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 1.0))
    lengths = [step["length"] for step in outcome.rows[1:]]
    assert min(lengths) < 1.0
    assert ledger.counts["residual"] >= 1 + sum(1 - int(np.log2(length)) for length in lengths)
    assert ledger.counts["factorization"] == len(lengths)


def test_modified_newton_pays_one_factorisation() -> None:
    outcome, ledger = run(ToyProblem(), ModifiedNewton(), Never(), START, DenseLU())
    k = len(outcome.rows) - 1
    assert outcome.status is Status.CONVERGED
    assert counts(ledger) == {"residual": k + 1, "jacobian": 1, "factorization": 1, "triangular_solve": k}


def test_a_series_of_order_p_costs_one_residual_p_minus_one_orders_and_p_solves() -> None:
    """[G(W(a))]_p is not needed: K* W_p takes coefficients 0 … p − 1."""
    p = 12
    outcome, ledger = run(ToyProblem(), AsymptoticNumericalMethod(order=p), Never(), START, DenseLU())
    k = len(outcome.rows) - 1
    assert outcome.status is Status.CONVERGED
    expected = {
        "residual": k,
        "expansion": k,
        "series_order": k * (p - 1),
        "series_term": k * p * (p - 1) // 2,
        "jacobian": 1,
        "factorization": 1,
        "triangular_solve": k * p,
    }
    assert counts(ledger) == expected


def test_orders_that_are_skipped_over_are_counted_all_the_same() -> None:
    """Asking for R_5 straight away has R_1 … R_4 computed too."""
    ledger = Ledger()
    expansion = CountedProblem(ToyProblem(), ledger).expand(START)
    for _ in range(5):
        expansion.append(0.1 * START)
    expansion.coefficient(5)
    assert ledger.counts["series_order"] == 5
    assert ledger.counts["series_term"] == 1 + 2 + 3 + 4 + 5
    assert ledger.counts["residual"] == 1


def test_an_order_asked_for_twice_is_computed_and_counted_once() -> None:
    ledger = Ledger()
    expansion = CountedProblem(ToyProblem(), ledger).expand(START)
    expansion.append(START)
    for _ in range(3):
        expansion.coefficient(0)
        expansion.coefficient(1)
    assert counts(ledger) == {"residual": 1, "expansion": 1, "series_order": 1, "series_term": 1}


def test_refinement_is_counted() -> None:
    """Each step of refinement: one product with the matrix and one more pair of triangular solves."""
    flow = spin_flow(0.5)
    start = near(flow, 0.7)
    outcome, ledger = run(flow, Newton(), EveryIteration(), start, SuperLU(ordering="mmd-ata", refinement=2))
    k = len(outcome.rows) - 1
    assert ledger.counts["triangular_solve"] == 3 * k
    assert ledger.counts["matrix_product"] == 2 * k


def test_trials_of_orderings_are_counted() -> None:
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.7), SuperLU(ordering="auto"))
    k = len(outcome.rows) - 1
    assert ledger.counts["factorization"] == k + 2  # three orderings on the first matrix


def test_the_drivers_own_residuals_are_off_the_clock() -> None:
    class Idle(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            while True:
                yield Step(start)

    outcome, ledger = run(ToyProblem(), Idle(), None, START, iterations=5)
    assert len(outcome.rows) == 6
    assert outcome.residual_norm > 0.0
    assert counts(ledger) == {}


def test_a_method_cannot_falsify_the_residual_that_counts() -> None:
    """What is remembered for the driver is a copy: zeroing the array one was handed changes nothing."""

    class Liar(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            while True:
                problem.residual(start)[:] = 0.0
                yield Step(start)

    outcome, _ = run(ToyProblem(), Liar(), None, START, iterations=3)
    assert outcome.status is Status.BUDGET_SPENT
    assert outcome.residual_norm == pytest.approx(np.linalg.norm(ToyProblem().residual(START)))


def test_seconds_of_the_parts_fit_into_those_of_the_method() -> None:
    flow = spin_flow(0.3, spacing=0.5)
    _, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.5))
    parts = [ledger.seconds[kind] for kind in ("residual", "jacobian", "factorization", "triangular_solve")]
    assert min(parts) > 0.0
    assert sum(parts) <= ledger.seconds["method"]


def test_work_that_fails_is_entered_too() -> None:
    ledger = Ledger()

    with pytest.raises(ZeroDivisionError), ledger.entry("residual"):
        raise ZeroDivisionError
    assert ledger.counts["residual"] == 1
    assert np.isnan(ledger.each("jacobian"))


def test_stopping_by_difference_sees_every_state_as_it_was_yielded() -> None:
    """A method that updates one array in place has not converged because that array equals itself."""

    class InPlace(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            state = start.copy()
            while True:
                yield Step(state)
                tangent.refresh_if_due(lambda: problem.jacobian(state))
                state -= 0.5 * tangent.solve(problem.residual(state))

    outcome, _ = run(
        ToyProblem(), InPlace(), Never(), START, DenseLU(), StoppingTest(kind="difference", tolerance=1e-6)
    )
    assert outcome.status is Status.CONVERGED
    assert outcome.residual_norm < 1e-3
