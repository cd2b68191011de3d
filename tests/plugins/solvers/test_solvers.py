"""Newton, modified Newton and the homotopy: their theory, and that they agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import PLAIN, near, run, spin_flow
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import EveryIteration, EveryM, Never, PoorContraction, RangeUnderOne
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

from nlsolve import Status
from nlsolve.plugin import NonlinearSolver, RefreshRule, TangentHistory
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_linear_solver, check_refresh_rule, check_solver
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

RULES: tuple[RefreshRule, ...] = (EveryIteration(), EveryM(), EveryM(m=2), PoorContraction(), RangeUnderOne(), Never())
SOLVERS: tuple[NonlinearSolver, ...] = (
    Newton(),
    Newton(globalization={"kind": "none"}),
    ModifiedNewton(),
    AsymptoticNumericalMethod(),
    AsymptoticNumericalMethod(order=5, tolerance=1e-4),
    AsymptoticNumericalMethod(order=3, tolerance=0.5),
)
START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))


def name(component: Any) -> str:
    return " ".join(str(value) for value in component.model_dump().values())


@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize("rule", RULES, ids=name)
def test_every_method_conforms_with_every_refresh_rule(solver: NonlinearSolver, rule: RefreshRule) -> None:
    check_solver(solver, rule)


@pytest.mark.parametrize("rule", RULES, ids=name)
def test_refresh_rules_conform(rule: RefreshRule) -> None:
    check_refresh_rule(rule)


@pytest.mark.parametrize("ordering", ["auto", "mmd-ata", "colamd", "mmd-at-plus-a", "natural"])
@pytest.mark.parametrize("refinement", [0, 1])
def test_superlu_conforms(ordering: Any, refinement: int) -> None:
    check_linear_solver(SuperLU(ordering=ordering, refinement=refinement))


class Scribbler(Newton):
    """Works in the array it was given."""

    def steps(self, problem: Any, tangent: Any, start: np.ndarray) -> Any:
        for step in super().steps(problem, tangent, start):
            start[:] = step.state
            yield step


class Hurried(Newton):
    """Does not show its start."""

    def steps(self, problem: Any, tangent: Any, start: np.ndarray) -> Any:
        states = super().steps(problem, tangent, start)
        next(states)
        yield from states


def test_the_check_of_solvers_can_fail() -> None:
    with pytest.raises(AssertionError, match="changed the array"):
        check_solver(Scribbler())
    with pytest.raises(AssertionError, match="must be the start itself"):
        check_solver(Hurried())


def test_auto_keeps_the_sparsest_ordering_and_lends_it() -> None:
    matrix = spin_flow(0.5, spacing=0.5).jacobian(near(spin_flow(0.5, spacing=0.5), 0.7))
    fills = {o: SuperLU(ordering=o).factorize(matrix).fill for o in ("mmd-ata", "colamd", "mmd-at-plus-a")}
    first = SuperLU().factorize(matrix)
    assert first.ordering == min(fills, key=fills.__getitem__)
    assert first.attempts == 3
    assert SuperLU().factorize(matrix, first).attempts == 1


# Refresh rules.


def test_rules_say_what_their_names_say() -> None:
    assert EveryIteration().due(TangentHistory())
    assert [EveryM(m=3).due(TangentHistory(uses=uses)) for uses in (1, 2, 3, 4)] == [False, False, True, True]
    contractions = (None, 0.1, 0.5, 0.6, float("nan"))
    assert [PoorContraction(limit=0.5).due(TangentHistory(contraction=c)) for c in contractions] == [
        False,
        False,
        False,
        True,
        True,
    ]
    assert [RangeUnderOne().due(TangentHistory(range=a)) for a in (None, 0.99, 1.0, float("nan"))] == [
        False,
        True,
        False,
        True,
    ]
    assert not Never().due(TangentHistory(99, 1e9, 0.0))


@pytest.mark.parametrize(("m", "expected"), [(1, 6), (2, 3), (3, 2), (6, 1)])
def test_every_m_factorises_once_in_m_iterations(m: int, expected: int) -> None:
    stop = StoppingTest(tolerance=1e-300)
    _, ledger = run(
        ToyProblem(), Newton(globalization={"kind": "none"}), EveryM(m=m), START, DenseLU(), stop, iterations=6
    )
    assert ledger.counts["factorization"] == expected


def test_a_tangent_outlives_the_solve_it_was_made_in() -> None:
    problem, tangent = ToyProblem(), Tangent(DenseLU(), Never(), Ledger())
    assert tangent.refresh_if_due(lambda: problem.jacobian(START))
    assert not tangent.refresh_if_due(lambda: problem.jacobian(ToyProblem.solution))
    assert tangent.renewals == 1


def test_modified_newton_is_newton_but_for_its_rule() -> None:
    for rule in RULES:
        one, _ = run(ToyProblem(), Newton(), rule, START, DenseLU())
        other, _ = run(ToyProblem(), ModifiedNewton(), rule, START, DenseLU())
        np.testing.assert_array_equal(one.state, other.state)


# Newton: e_(i+1) ≤ C e_i².


def test_newton_converges_quadratically_and_the_chord_linearly() -> None:
    """Residuals of the power-law flow: the order log(r_(i+1)/r_i)/log(r_i/r_(i−1)) is 2 for Newton, 1 for the chord."""
    flow = spin_flow(0.5)
    start = near(flow, 0.55)

    def order(rule: RefreshRule) -> float:
        outcome, _ = run(flow, Newton(globalization={"kind": "none"}), rule, start)
        r = np.array([row["residual_norm"] for row in outcome.rows])
        r = np.log(r[(r > 1e-11) & (r < 1e-3)])
        return float((r[-1] - r[-2]) / (r[-2] - r[-3]))

    assert order(EveryIteration()) == pytest.approx(2.0, abs=0.35)
    assert order(Never()) == pytest.approx(1.0, abs=0.15)


def test_newton_solves_a_linear_problem_in_one_step() -> None:
    flow = spin_flow(1.0)
    outcome, _ = run(flow, Newton(), EveryIteration(), near(flow, 0.5))
    assert outcome.status is Status.CONVERGED
    assert len(outcome.rows) == 2


def test_backtracking_never_lets_the_residual_grow() -> None:
    flow = spin_flow(0.1324)
    outcome, _ = run(flow, Newton(), EveryIteration(), near(flow, 1.0))
    residuals = [row["residual_norm"] for row in outcome.rows]
    assert outcome.status is Status.CONVERGED
    assert (np.diff(residuals) < 0.0).all()


# The homotopy.


def coefficients(flow: Any, matrix: Any, start: np.ndarray, order: int) -> list[np.ndarray]:
    """W_1 … W_p by the recurrence written out with a dense inverse, from the method's defining equation."""
    inverse = np.linalg.inv(matrix.toarray())
    expansion = flow.expand(start)
    terms = [-inverse @ expansion.coefficient(0)]
    expansion.append(terms[0])
    for j in range(2, order + 1):
        terms.append(terms[-1] - inverse @ expansion.coefficient(j - 1))
        expansion.append(terms[-1])
    return terms


def test_the_series_satisfies_the_homotopy_at_every_order() -> None:
    """[(1 − a) K* W + a G(W)]_j = 0, with W(a) read off the method: its first state is W at a = 1."""
    flow = spin_flow(0.5)
    start, p = near(flow, 0.52), 8
    terms = coefficients(flow, flow.jacobian(near(flow, 0.6)), start, p)
    expansion = flow.expand(start)
    for term in terms:
        expansion.append(term)
    matrix = flow.jacobian(near(flow, 0.6))
    size = np.linalg.norm(flow.residual(start))
    for j in range(1, p + 1):
        before = matrix @ terms[j - 2] if j > 1 else 0.0 * start
        left = matrix @ terms[j - 1] - before + expansion.coefficient(j - 1)
        assert np.linalg.norm(left) <= 1e-8 * size


def test_the_second_term_vanishes_when_the_tangent_is_the_one_at_the_start() -> None:
    """K* W_2 = K* W_1 − [G]_1 = (K* − J) W_1; so a range from order 2 alone would be infinite."""
    flow = spin_flow(0.3)
    start = near(flow, 0.5)
    tangent, other = (coefficients(flow, flow.jacobian(u), start, 3) for u in (start, near(flow, 0.6)))
    assert np.linalg.norm(tangent[1]) <= 1e-10 * np.linalg.norm(tangent[0])
    assert np.linalg.norm(other[1]) > 1e-2 * np.linalg.norm(other[0])
    assert np.linalg.norm(tangent[2]) > 1e-3 * np.linalg.norm(tangent[0])


def test_the_method_yields_the_sum_of_the_recurrence() -> None:
    flow = spin_flow(0.5)
    start, solver = near(flow, 0.52), AsymptoticNumericalMethod(order=6)
    outcome, _ = run(flow, solver, Never(), start, iterations=1)
    terms = coefficients(flow, flow.jacobian(start), start, 6)
    reach = min((1e-6 * np.linalg.norm(terms[0]) / np.linalg.norm(terms[j - 1])) ** (1 / (j - 1)) for j in (5, 6))
    a = min(1.0, reach)
    assert outcome.rows[1]["range"] == pytest.approx(reach, rel=1e-6)
    expected = start + sum(a ** (j + 1) * term for j, term in enumerate(terms))
    np.testing.assert_allclose(outcome.state, expected, atol=1e-9 * np.abs(expected).max())


def test_order_two_says_that_it_has_no_range() -> None:
    """With p = 2 and a fresh K* the only last term is W_2 = 0: its range would be noise, and nothing to claim on."""
    flow = spin_flow(0.3)
    stop = StoppingTest(kind="claim")
    outcome, _ = run(flow, AsymptoticNumericalMethod(order=2), EveryIteration(), near(flow, 0.5), stop=stop)
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert "use order 3 or more" in outcome.detail


@pytest.mark.parametrize("p", [1, 2, 5, 9])
def test_on_a_linear_problem_the_series_is_richardsons_iteration(p: int) -> None:
    """W(1) after p terms equals p steps u ← u − K*⁻¹ R(u): so modified Newton is the homotopy's fair rival."""
    flow = spin_flow(1.0)
    start, matrix = near(flow, 0.5), 1.3 * spin_flow(1.0).jacobian(near(flow, 0.5))
    inverse = np.linalg.inv(matrix.toarray())
    state = start.copy()
    for _ in range(p):
        state = state - inverse @ flow.residual(state)
    series = start + sum(coefficients(flow, matrix, start, p))
    np.testing.assert_allclose(series, state, atol=1e-10 * np.abs(state).max())


def test_on_a_linear_problem_homotopy_and_modified_newton_leave_the_same_residual() -> None:
    """The installed methods themselves, both with the tangent of another law's flow kept from an earlier solve."""
    flow, other = spin_flow(1.0), spin_flow(0.9)
    start = near(flow, 0.5)
    left = []
    for solver, steps in (
        (AsymptoticNumericalMethod(order=6, tolerance=1e9), 1),
        (Newton(globalization={"kind": "none"}), 6),
    ):
        ledger = Ledger()
        tangent = Tangent(PLAIN, Never(), ledger)
        tangent.refresh_if_due(lambda: other.jacobian(start))
        states = solver.steps(CountedProblem(flow, ledger), tangent, start)
        left.append([next(states).state for _ in range(steps + 1)][-1])
    np.testing.assert_allclose(left[0], left[1], atol=1e-9 * np.abs(left[1]).max())


def test_a_range_under_one_renews_the_tangent_under_the_papers_rule_and_not_otherwise() -> None:
    flow = spin_flow(0.3)
    start = near(flow, 0.5)
    outcome, ledger = run(flow, AsymptoticNumericalMethod(), RangeUnderOne(), start)
    assert outcome.status is Status.CONVERGED
    assert outcome.rows[1]["range"] < 1.0
    assert outcome.rows[1]["length"] == outcome.rows[1]["range"]
    assert ledger.counts["factorization"] > 1
    kept, _ = run(flow, AsymptoticNumericalMethod(), Never(), near(flow, 0.31))
    assert kept.status is Status.CONVERGED
    assert {row["tangents"] for row in kept.rows[1:]} == {1}


@pytest.mark.parametrize("index", [0.5, 0.3])
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(), RangeUnderOne()], ids=name)
def test_methods_agree_on_a_power_law_flow(index: float, rule: RefreshRule) -> None:
    """One solution of one discrete problem, to 1e-8 relative, whatever the way there."""
    flow = spin_flow(index)
    start = near(flow, index + 0.02)
    states = []
    for solver in (Newton(), ModifiedNewton(), AsymptoticNumericalMethod()):
        outcome, _ = run(flow, solver, rule, start, stop=StoppingTest(tolerance=1e-11))
        assert outcome.status is Status.CONVERGED, (solver.kind, outcome.detail)
        states.append(outcome.state)
    for state in states[1:]:
        assert np.linalg.norm(state - states[0]) <= 1e-8 * np.linalg.norm(states[0])


@pytest.mark.parametrize(
    ("solver", "fields"),
    [
        (AsymptoticNumericalMethod, {"order": 1}),
        (AsymptoticNumericalMethod, {"tolerance": 0.0}),
        (AsymptoticNumericalMethod, {"tolerance": -1e-6}),
        (AsymptoticNumericalMethod, {"tolerance": float("nan")}),
        (Newton, {"globalization": {"kind": "backtracking", "trials": 0}}),
        (EveryM, {"m": 0}),
        (PoorContraction, {"limit": 0.0}),
        (SuperLU, {"ordering": "random"}),
        (SuperLU, {"refinement": -1}),
    ],
)
def test_nonsense_is_refused(solver: type[Any], fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        solver(**fields)
