"""The ledger: exact counts of known runs, and no way around it."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from cases import PLAIN, near, run, spin_flow
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import EveryIteration, Never
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton

from nlsolve import Status
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import (
    Component,
    Expansion,
    Factors,
    KeptTangent,
    LinearSolver,
    NonlinearProblem,
    NonlinearSolver,
    Series,
    Step,
)
from nlsolve.solving.ledger import Audited, Ledger, SealedMatrix, factorize_counted
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.testing.toy_problem import DenseLU, SmallProblem

START = SmallProblem.solution + 0.5 * np.cos(np.arange(12.0))


# No way around.


def is_behind(thing: Any) -> bool:
    """What a method must not get hold of: uncounted work, or the books themselves."""
    uncounted = (Flow, SmallProblem, Factors, LinearSolver, Tangent, Audited, Series)
    return isinstance(thing, (*uncounted, Ledger)) or type(thing) is Expansion or sp.issparse(thing)


def forbidden(root: Any) -> list[str]:
    """Paths from `root` to such things, over attributes that are not dunder and the owners of bound methods."""
    queue, seen, found = (
        [("view", root)],
        list[Any](),
        list[str](),
    )  # `seen` keeps objects alive: an id is not used twice
    known = set[int]()
    while queue:
        path, thing = queue.pop()
        if id(thing) in known or isinstance(thing, (str, int, float, type, types.ModuleType, np.ndarray)):
            continue
        known.add(id(thing))
        seen.append(thing)
        if is_behind(thing) and thing is not root:
            found.append(f"{path}: {type(thing).__name__}")
        if isinstance(thing, Component) or (is_behind(thing) and thing is not root):
            continue
        names = [name for name in dir(thing) if not (name.startswith("__") and name.endswith("__"))]
        for name in [*names, "__self__"]:
            try:
                queue.append((f"{path}.{name}", getattr(thing, name)))
            except (AttributeError, AssertionError):  # a slot not filled, or a property that has no value here
                continue
    return found


def views() -> dict[str, Any]:
    problem, ledger = spin_flow(0.5), Ledger()
    tangent = Tangent(PLAIN, None, ledger)
    audited = Audited(problem, ledger)
    u = near(problem, 0.5)
    tangent.view.refresh_if_due(audited.view, u)
    tangent.view.solve(audited.view.residual(u))
    expansion = audited.view.expand(u)
    expansion.append(u)
    expansion.coefficient(1)
    return {
        "problem": audited.view,
        "tangent": tangent.view,
        "jacobian": audited.view.jacobian(u),
        "expansion": expansion,
    }


def test_the_walk_finds_what_lies_open() -> None:
    """The check below can fail: the same walk from behind the views reaches everything."""
    problem, ledger = spin_flow(0.5), Ledger()
    tangent, audited = Tangent(PLAIN, None, ledger), Audited(problem, ledger)
    tangent.refresh_if_due(audited.view, near(problem, 0.5))
    assert any("Flow" in path for path in forbidden(audited))
    assert {path.split(": ")[1] for path in forbidden(tangent)} >= {"SuperLU", "SuperLUFactors", "Ledger"}
    assert any("csr_array" in path for path in forbidden(problem))
    expansion = problem.expand(near(problem, 0.5))
    assert any("Series" in path for path in forbidden(expansion))
    assert any("Expansion" in path for path in forbidden(expansion.append))  # a bound method gives its owner away


@pytest.mark.parametrize("name", ["problem", "tangent", "jacobian", "expansion"])
def test_no_attribute_of_a_view_leads_behind_the_ledger(name: str) -> None:
    """What a method is handed holds verbs only: no raw problem, matrix, factors, expansion or book can be reached, so
    whatever work a method gets done is entered.
    """
    assert forbidden(views()[name]) == []


def test_a_sealed_jacobian_gives_away_its_shape_and_counted_products_only() -> None:
    problem, ledger = SmallProblem(), Ledger()
    sealed: Any = Audited(problem, ledger).view.jacobian(START)
    assert sealed.shape == (12, 12)
    np.testing.assert_allclose(sealed @ START, problem.jacobian(START) @ START)
    assert ledger.counts["matrix_product"] == 1
    for name in ("toarray", "data", "indices", "diagonal", "T"):
        assert not hasattr(sealed, name)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.solve(sealed, START)
    assert not sp.issparse(sealed)


def test_only_a_sealed_matrix_is_factorised() -> None:
    matrix: Any = SmallProblem().jacobian(START)
    with pytest.raises(TypeError, match="so that the work is counted"):
        factorize_counted(PLAIN, matrix, None, Ledger())
    with pytest.raises(KeyError):
        factorize_counted(PLAIN, SealedMatrix((12, 12)), None, Ledger())


def test_a_method_cannot_bring_a_problem_of_its_own_to_the_tangent() -> None:
    """K* of a matrix nobody counted is refused."""

    class Smuggler(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            yield Step(start)
            tangent.refresh_if_due(SmallProblem(), start)

    with pytest.raises(TypeError, match="handed out by the problem"):
        run(SmallProblem(), Smuggler(), None, START)


# Exact counts.


def counts(ledger: Ledger) -> dict[str, int]:
    return {kind: count for kind, count in ledger.counts.items() if kind != "method" and count}


@pytest.mark.parametrize("index", [1.0, 0.5])
def test_k_newton_iterations_cost_k_factorisations_k_solves_and_k_plus_one_residuals(index: float) -> None:
    flow = spin_flow(index)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.7))
    assert outcome.status is Status.CONVERGED
    k = len(outcome.steps) - 1
    assert all(step["length"] == 1.0 for step in outcome.steps[1:])  # no backtracking
    assert counts(ledger) == {"residual": k + 1, "jacobian": k, "factorization": k, "triangular_solve": k}


def test_backtracking_is_paid_in_residuals() -> None:
    flow = spin_flow(0.1324)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 1.0))
    lengths = [step["length"] for step in outcome.steps[1:]]
    assert min(lengths) < 1.0
    assert ledger.counts["residual"] >= 1 + sum(1 - int(np.log2(length)) for length in lengths)
    assert ledger.counts["factorization"] == len(lengths)


def test_modified_newton_pays_one_factorisation() -> None:
    outcome, ledger = run(SmallProblem(), ModifiedNewton(), Never(), START, DenseLU())
    k = len(outcome.steps) - 1
    assert outcome.status is Status.CONVERGED
    assert counts(ledger) == {"residual": k + 1, "jacobian": 1, "factorization": 1, "triangular_solve": k}


def test_a_series_of_order_p_costs_one_residual_p_minus_one_orders_and_p_solves() -> None:
    """[G(W(a))]_p is not needed: K* W_p takes coefficients 0 … p − 1."""
    p = 12
    outcome, ledger = run(SmallProblem(), AsymptoticNumericalMethod(order=p), Never(), START, DenseLU())
    k = len(outcome.steps) - 1
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
    expansion = Audited(SmallProblem(), ledger).view.expand(START)
    for _ in range(5):
        expansion.append(0.1 * START)
    expansion.coefficient(5)
    assert ledger.counts["series_order"] == 5
    assert ledger.counts["series_term"] == 1 + 2 + 3 + 4 + 5
    assert ledger.counts["residual"] == 1


def test_an_order_asked_for_twice_is_computed_and_counted_once() -> None:
    ledger = Ledger()
    expansion = Audited(SmallProblem(), ledger).view.expand(START)
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
    k = len(outcome.steps) - 1
    assert ledger.counts["triangular_solve"] == 3 * k
    assert ledger.counts["matrix_product"] == 2 * k


def test_trials_of_orderings_are_counted() -> None:
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, Newton(), EveryIteration(), near(flow, 0.7), SuperLU(ordering="auto"))
    k = len(outcome.steps) - 1
    assert ledger.counts["factorization"] == k + 2  # three orderings on the first matrix


def test_the_drivers_own_residuals_are_off_the_clock() -> None:
    class Idle(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            while True:
                yield Step(start)

    outcome, ledger = run(SmallProblem(), Idle(), None, START, iterations=5)
    assert len(outcome.steps) == 6
    assert outcome.residual_norm > 0.0
    assert counts(ledger) == {}


def test_a_method_cannot_falsify_the_residual_that_counts() -> None:
    """What is remembered for the driver is a copy: zeroing the array one was handed changes nothing."""

    class Liar(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Any) -> Iterator[Step]:
            while True:
                problem.residual(start)[:] = 0.0
                yield Step(start)

    outcome, _ = run(SmallProblem(), Liar(), None, START, iterations=3)
    assert outcome.status is Status.BUDGET_SPENT
    assert outcome.residual_norm == pytest.approx(np.linalg.norm(SmallProblem().residual(START)))


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
                tangent.refresh_if_due(problem, state)
                state -= 0.5 * tangent.solve(problem.residual(state))

    outcome, _ = run(
        SmallProblem(), InPlace(), Never(), START, DenseLU(), StoppingTest(kind="difference", tolerance=1e-6)
    )
    assert outcome.status is Status.CONVERGED
    assert outcome.residual_norm < 1e-3
