"""The choices inside the homotopy: its forms against their own paths, Padés, ranges, and that every variant arrives."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from cases import near, run, spin_flow
from nlsolve_rules.refresh import EveryIteration, Never, RangeUnderOne
from nlsolve_solvers.homotopy import FORMS as FORM_CLASSES
from nlsolve_solvers.homotopy import RANGE_RULES, AsymptoticNumericalMethod
from nlsolve_solvers.homotopy.branch import Branch, BranchView
from nlsolve_solvers.homotopy.extrapolations import PADES, coordinates, extrapolate, series
from pydantic import ValidationError

import nlsolve
from nlsolve import Status
from nlsolve.plugin import Expansion, NonlinearProblem, Series
from nlsolve.series import Array
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing import check_solver
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

Method = AsymptoticNumericalMethod
FIXED, NEWTON = "fixed-point", "newton"
KINDS = ("series", *PADES)
FORMS = {cls.kind_name(): cls() for cls in FORM_CLASSES}
RULES = {cls.kind_name(): cls() for cls in RANGE_RULES}
VARIANTS = list(product(FORMS, KINDS, RULES, (False, True)))
SMALL = ToyProblem()
START = SMALL.solution + 0.5 * np.cos(np.arange(12.0))
STUDIES = Path(__file__).parents[3] / "studies"


def branch(problem: NonlinearProblem, start: Array, matrix: Any, order: int, form: str, kind: str = "series") -> Branch:
    """W_1 … W_p with a K* of one's own."""
    inverse = np.linalg.inv(matrix.toarray())
    made = Branch(problem, start, FORMS[form], kind)
    for _ in range(order):
        rhs = made.recurrence.right_hand_side()
        made.append(rhs, inverse @ rhs)
    return made


def a_max(rule: str, made: Branch, tolerance: float, used: bool = True) -> float:
    """What a range rule says of a branch."""
    return RULES[rule].limit(BranchView(made), tolerance, used).a_max


# The nearest singularity.


class SquareRoot(NonlinearProblem):
    """R(u) = u² − (1 + c): along G(W) = (1 − a) G(0) from u = 1, u(a) = √(1 + c a), singular at a = −1/c."""

    def __init__(self, c: float) -> None:
        self.c = c

    def residual(self, u: Any) -> Any:
        return u * u - (1.0 + self.c)

    def jacobian(self, u: Array) -> Any:
        return sp.csr_array(np.diag(2.0 * u))

    def expand(self, u: Array) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))


@pytest.mark.parametrize("c", [0.5, 1.0, 4.0, -0.8])
def test_the_last_terms_tell_the_nearest_singularity(c: float) -> None:
    problem, start = SquareRoot(c), np.ones(1)
    made = branch(problem, start, problem.jacobian(start), 40, NEWTON)
    assert made.singularity == pytest.approx(1.0 / abs(c), rel=0.05)
    assert np.isnan(branch(problem, start, problem.jacobian(start), 2, NEWTON).singularity)


def test_a_linear_problem_has_no_singularity() -> None:
    outcome, _ = run(LinearProblem(), Method(), RangeUnderOne(), np.zeros(3), DenseLU())
    assert outcome.rows[-1]["singularity"] == np.inf


class LinearProblem(SquareRoot):
    """R(u) = 2 u − 1, solved by the first term."""

    def __init__(self) -> None:
        super().__init__(0.0)

    def residual(self, u: Any) -> Any:
        return 2.0 * u - 1.0

    def jacobian(self, u: Array) -> Any:
        return sp.csr_array(2.0 * np.eye(len(u)))


# The defaults are the method there was before it had choices.


@pytest.mark.parametrize(
    ("fields", "small", "spin"),
    [
        ({}, (2, 40, 2, 38), (5, 100, 5, 95)),
        ({"order": 6, "tolerance": 1e-4}, (5, 36, 6, 30), (14, 84, 14, 70)),
    ],
)
def test_the_defaults_cost_what_they_always_did(fields: Any, small: Any, spin: Any) -> None:
    flow = spin_flow(0.3)
    kinds = ("factorization", "triangular_solve", "residual", "series_order")
    _, ledger = run(SMALL, Method(**fields), RangeUnderOne(), START, DenseLU())
    assert tuple(ledger.counts[kind] for kind in kinds) == small
    _, ledger = run(flow, Method(**fields), RangeUnderOne(), near(flow, 0.5))
    assert tuple(ledger.counts[kind] for kind in kinds) == spin


# Forms: W_j against the derivatives of the path that the form's own equation defines.


def path(form: str, matrix: Array, a: complex) -> Array:
    """W(a) of the small problem by Newton's method on the homotopy itself, at a complex a."""
    tangent = SMALL.jacobian(START).toarray()
    first = SMALL.residual(START)
    w = np.zeros(12, dtype=complex)
    for _ in range(30):
        u = START + w
        g = SMALL.matrix @ u + np.sinh(u) - (SMALL.matrix @ SMALL.solution + np.sinh(SMALL.solution))
        slope = SMALL.matrix.toarray() + np.diag(np.cosh(u))
        if form == FIXED:
            h, h_slope = (1 - a) * matrix @ w + a * g, (1 - a) * matrix + a * slope
        else:
            h = g - (1 - a) * (first + (tangent - matrix) @ w)
            h_slope = slope - (1 - a) * (tangent - matrix)
        w = w - np.linalg.solve(h_slope, h)
    return w


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("shift", [0.0, 0.3], ids=["tangent", "old tangent"])
def test_terms_are_the_derivatives_of_the_path(form: str, shift: float) -> None:
    """Cauchy: W_j = (1/2πi) ∮ W(a) a^(−j−1) da, the mean of W(a) a^(−j) over a circle."""
    matrix = SMALL.jacobian(START + shift)
    terms = branch(SMALL, START, matrix, 8, form).terms
    a = 0.3 * np.exp(2j * np.pi * np.arange(64) / 64)
    values = np.array([path(form, matrix.toarray(), one) for one in a])
    for j, term in enumerate(terms, start=1):
        exact = np.mean(values * a[:, None] ** -j, axis=0)
        np.testing.assert_allclose(term, exact, atol=1e-9 * 0.3**-j * np.abs(values).max())


def test_both_forms_are_richardsons_iteration_on_a_linear_problem() -> None:
    flow = spin_flow(1.0)
    start, matrix = near(flow, 0.5), 1.3 * spin_flow(1.0).jacobian(near(flow, 0.5))
    one, other = (branch(flow, start, matrix, 6, form).increment(1.0) for form in FORMS)
    np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(one).max())


def test_the_newton_form_meets_the_second_order_at_once() -> None:
    """With K* = J: W_2 = −J⁻¹ Q_2, which in the fixed-point form is W_3, behind a W_2 = 0."""
    matrix = SMALL.jacobian(START)
    fixed, newton = (branch(SMALL, START, matrix, 3, form) for form in (FIXED, NEWTON))
    assert fixed.sizes[1] <= 1e-12 * fixed.sizes[0]
    np.testing.assert_allclose(newton.terms[1], fixed.terms[2], rtol=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_a_path_is_followed_to_the_order_of_its_series(form: str) -> None:
    """What W(a) leaves in the homotopy is O(a^(p+1)): halving a divides it by 2^(p+1); at a = 1 it is G(W) itself."""
    made = branch(SMALL, START, SMALL.jacobian(START + 0.2), 4, form)
    assert np.log2(made.defect(0.1) / made.defect(0.05)) == pytest.approx(5.0, abs=0.3)
    assert made.defect(1.0) == np.linalg.norm(SMALL.residual(START + made.increment(1.0)))


# Extrapolations.


def residues(poles: list[complex]) -> Array:
    """c_s, a row a pole; of a conjugate pair conjugate."""
    real, imaginary = np.random.default_rng(1).normal(size=(2, len(poles), 40))
    pair = np.arange(len(poles)) - (np.imag(poles) < 0.0)  # the row of the pole above the axis
    return real[pair] + 1j * np.sign(np.imag(poles))[:, None] * imaginary[pair]


def rational(poles: list[complex], order: int) -> list[Array]:
    """W_j = Σ_s c_s z_s^(1−j) of W(a) = Σ_s c_s a/(1 − a/z_s)."""
    return [np.real(np.asarray(poles) ** (1.0 - j) @ residues(poles)) for j in range(1, order + 1)]


@pytest.mark.parametrize("kind", PADES)
@pytest.mark.parametrize("poles", [[-0.5], [-0.5, 1.7], [0.4 + 0.6j, 0.4 - 0.6j], [-0.3, 2.0, -1.1]])
def test_padés_of_rational_functions_are_exact(kind: str, poles: list[complex]) -> None:
    """Where the series diverges: each path has a pole within |a| < 1. Poles beyond those there are do not appear."""
    made = extrapolate(kind, coordinates(terms := rational(poles, 2 * len(poles) + 2)))
    exact = np.real(1.0 / (1.0 - 1.0 / np.asarray(poles)) @ residues(poles))
    np.testing.assert_allclose(made.weights(1.0) @ np.array(terms), exact, atol=1e-7)
    np.testing.assert_allclose(np.sort_complex(made.poles()), np.sort_complex(poles), atol=1e-6)


@pytest.mark.parametrize("kind", PADES)
def test_a_padé_agrees_with_the_series_to_its_order(kind: str) -> None:
    terms = np.random.default_rng(2).normal(size=(40, 5)) * 0.5 ** np.arange(5)
    made = PADES[kind](terms)

    def gap(a: float) -> float:
        return float(np.linalg.norm(terms @ (made.weights(a) - series(5).weights(a))))

    assert np.log2(gap(0.02) / gap(0.01)) == pytest.approx(6.0, abs=0.2)


@pytest.mark.parametrize("kind", PADES)
@pytest.mark.parametrize("pole", [0.5, 1.0, 1.05])
def test_a_pole_on_the_path_leaves_the_series(kind: str, pole: float) -> None:
    made = extrapolate(kind, coordinates(rational([pole], 6)))
    np.testing.assert_array_equal(made.weights(0.5), 0.5 ** np.arange(1.0, 7.0))
    assert len(extrapolate(kind, coordinates(rational([1.2], 6))).denominator) > 1


@pytest.mark.parametrize("kind", PADES)
def test_a_vanishing_second_term_is_not_divided_by(kind: str) -> None:
    """W_2 = noise, as with a fresh K*: the approximant is that of W_2 = 0, though noise has a direction of its own."""
    terms = branch(SMALL, START, SMALL.jacobian(START), 7, FIXED).terms
    clean = [terms[0], np.zeros(12), *terms[2:]]
    noise = [terms[0], 1e-14 * np.random.default_rng(3).normal(size=12), *terms[2:]]
    one, other = (extrapolate(kind, coordinates(list(t))).weights(1.0) for t in (clean, noise))
    np.testing.assert_allclose(one, other, atol=1e-4)
    assert np.abs(other).max() < 3.0


@pytest.mark.parametrize("kind", PADES)
@pytest.mark.parametrize("growth", [1e50, 1e-100])
def test_a_fit_survives_terms_of_any_size(kind: str, growth: float) -> None:
    assert np.isfinite(PADES[kind](np.diag(growth ** np.arange(4.0))).poles()).all()


def test_no_terms_make_the_series() -> None:
    assert len(extrapolate("pade", np.zeros((3, 3))).denominator) == 1


# Ranges.


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", FORMS)
def test_the_true_residual_is_kept_to_the_end_of_its_range(form: str, kind: str) -> None:
    made = branch(SMALL, START - 1.5, SMALL.jacobian(START - 1.0), 5, form, kind)
    a = a_max("true-residual", made, 1e-5)
    assert 0.0 < a < 1.0
    assert made.defect(a) <= 1e-5 * made.residual
    assert made.defect(1.0) > 1e-5 * made.residual
    assert a_max("true-residual", made, 1e9) > 1.0


def test_a_residual_that_is_not_finite_shortens_the_range() -> None:
    made = branch(SMALL, START, SMALL.jacobian(START), 3, FIXED)
    made.terms = [1e4 * term for term in made.terms]
    with np.errstate(all="ignore"):
        assert not np.isfinite(made.defect(1.0))
        assert 0.0 < a_max("true-residual", made, 1e-6) < 0.1


@pytest.mark.parametrize("form", FORMS)
def test_the_coefficient_left_over_is_the_residual_of_a_linear_problem(form: str) -> None:
    flow = spin_flow(1.0)
    made = branch(flow, near(flow, 0.5), 1.3 * flow.jacobian(near(flow, 0.5)), 5, form)
    left = a_max("residual-coefficient", made, 1.0) ** -6 * made.residual
    assert left == pytest.approx(made.defect(1.0), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_approximants_of_two_orders_differ_by_the_tolerance_where_the_range_ends(kind: str) -> None:
    made = branch(SMALL, START - 1.5, SMALL.jacobian(START - 1.0), 6, FIXED, kind)
    a = a_max("pade-pair", made, 1e-4)
    assert 0.0 < a < 1.0
    now, before = made.extrapolation().weights(a), made.extrapolation(5).weights(a)
    terms = np.stack(made.terms, axis=1)
    gap = np.linalg.norm(terms @ now - terms[:, :5] @ before)
    assert gap == pytest.approx(1e-4 * np.linalg.norm(terms @ now), rel=1e-5)
    assert a_max("pade-pair", made, 1e9) > 1.0


def test_the_nearest_pole_bounds_the_range() -> None:
    made = Branch(SMALL, START, FORMS[FIXED], "series")
    made.terms = rational([0.4 + 0.6j, 0.4 - 0.6j, 1.5], 8)
    assert a_max("nearest-pole", made, 1e-4) == pytest.approx(1e-4 ** (1 / 8) * abs(0.4 + 0.6j), rel=1e-6)


# The method.


def variant(form: Any, kind: Any, rule: Any, adaptive: bool, **fields: Any) -> Method:
    return Method(form=form, extrapolation=kind, range=rule, adaptive=adaptive, **fields)


@pytest.mark.parametrize("choice", VARIANTS, ids=str)
def test_every_variant_conforms(choice: Any) -> None:
    check_solver(variant(*choice, order=6, tolerance=1e-4, corrections=int(choice[3])), RangeUnderOne())


@pytest.mark.parametrize("choice", VARIANTS[::3], ids=str)
def test_variants_agree_on_the_steady_spin(choice: Any) -> None:
    flow = spin_flow(0.3)
    start, stop = near(flow, 0.32), StoppingTest(tolerance=1e-11)
    outcome, _ = run(flow, variant(*choice, order=8), RangeUnderOne(), start, stop=stop)
    other, _ = run(flow, Method(), RangeUnderOne(), start, stop=stop)
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert np.linalg.norm(outcome.state - other.state) <= 1e-8 * np.linalg.norm(other.state)


def test_an_adaptive_series_stops_at_its_range_and_not_before_the_third_order() -> None:
    flow = spin_flow(0.5)
    stop = StoppingTest(kind="claim")
    counts = []
    for tolerance in (1e-1, 1e-4, 1e-8):
        solver = Method(adaptive=True, tolerance=tolerance, range="residual-coefficient")
        outcome, ledger = run(flow, solver, EveryIteration(), near(flow, 0.5001), stop=stop)
        counts.append(ledger.counts["triangular_solve"])
        assert outcome.rows[-1]["range"] >= 1.0
    assert counts[0] == 3
    assert counts == sorted(counts)
    assert counts[-1] < 20


def test_corrections_are_newton_steps_with_the_kept_tangent() -> None:
    flow = spin_flow(0.5)
    start = near(flow, 0.502)
    plain, _ = run(flow, Method(order=3, tolerance=1e9), Never(), start, iterations=1)
    corrected, ledger = run(flow, Method(order=3, tolerance=1e9, corrections=2), Never(), start, iterations=3)
    states = [row["residual_norm"] for row in corrected.rows]
    assert states[1] == plain.residual_norm
    assert states[3] < states[2] < states[1]
    assert ledger.counts["triangular_solve"] == 3 + 2
    by_hand = plain.state
    inverse = np.linalg.inv(flow.jacobian(start).toarray())
    for _ in range(2):
        by_hand = by_hand - inverse @ flow.residual(by_hand)
    np.testing.assert_allclose(corrected.state, by_hand, atol=1e-9 * np.abs(by_hand).max())


def test_a_series_that_advances_by_nothing_says_so() -> None:
    outcome, _ = run(spin_flow(0.3), Method(order=3, tolerance=1e-30), Never(), near(spin_flow(0.3), 0.5))
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert "for a series of order 3" in outcome.detail


def test_an_order_of_the_newton_form_costs_two_of_the_residual() -> None:
    """Q_{j+1} and [G]_j for each r_{j+1}, and one evaluation of the residual for the whole series."""
    flow = spin_flow(0.5)
    for form, orders in ((FIXED, 7), (NEWTON, 14)):
        solver = Method(form=form, order=8, tolerance=1e9)
        _, ledger = run(flow, solver, Never(), near(flow, 0.5001), stop=StoppingTest(kind="claim"))
        counts = tuple(ledger.counts[kind] for kind in ("triangular_solve", "residual", "series_order"))
        assert counts == (8, 1, orders)


# What limits a range.


def limits(solver: Method, start: Array, rule: Any = None, problem: NonlinearProblem = SMALL) -> list[str]:
    """`limited_by` of the branches that were used."""
    outcome, _ = run(problem, solver, rule or EveryIteration(), start, DenseLU(), stop=StoppingTest(tolerance=1e-9))
    assert outcome.status is Status.CONVERGED, outcome.detail
    return [row["limited_by"] for row in outcome.rows[1:] if "limited_by" in row]


@pytest.mark.parametrize("rule", RULES)
def test_a_branch_names_the_rule_that_limited_it_or_the_end_of_its_path(rule: Any) -> None:
    solver = Method(order=5, tolerance=1e-5, range=rule)
    outcome, _ = run(SMALL, solver, EveryIteration(), START - 1.5, DenseLU(), stop=StoppingTest(tolerance=1e-9))
    named = {(row["limited_by"], row["range"] >= 1.0) for row in outcome.rows[1:]}
    assert named == {(rule, False), ("end of path", True)}


def test_an_adaptive_branch_names_the_highest_order_or_the_cost() -> None:
    adaptive = Method(order=5, tolerance=1e-6, adaptive=True, range="residual-coefficient")
    assert set(limits(adaptive, START - 1.5)) == {"order", "end of path"}
    assert set(limits(adaptive.with_(order=60, branch_cost=0.0), START - 2.5)) == {"cost", "end of path"}


def test_a_branch_whose_padé_has_a_pole_on_its_path_says_so() -> None:
    made = Branch(SMALL, START, FORMS[FIXED], "pade")
    for one in rational([0.5], 6):
        made.terms.append(one)
    assert made.has_pole()
    made.terms = rational([1.5], 6)
    made._columns = None
    assert not made.has_pole()


@pytest.mark.parametrize("cost", [0.0, 5.0, 40.0])
def test_orders_are_added_until_a_unit_of_path_is_cheapest(cost: float) -> None:
    """a(p) = ρ η^(1/(p−1)) of a geometric series, ρ < 1: the p with the least (c + p)/a(p), to three orders."""
    p = np.arange(3, 200)
    a = 0.5 * 1e-6 ** (1.0 / (p - 1.0))
    best = int(p[np.argmin((cost + p) / a)])
    solver = Method(adaptive=True, branch_cost=cost)
    stopped = next(int(j) for j in p if solver._is_dear(list(a[: j - 2]), int(j)))
    assert abs(stopped - best) <= 3


def test_an_expensive_tangent_makes_long_series_and_few_branches() -> None:
    flow = spin_flow(0.3)
    counts = []
    for cost in (0.0, 1000.0):
        solver = Method(order=60, adaptive=True, range="residual-coefficient", branch_cost=cost)
        outcome, ledger = run(flow, solver, RangeUnderOne(), near(flow, 0.5), stop=StoppingTest(tolerance=1e-9))
        assert outcome.status is Status.CONVERGED
        counts.append((ledger.counts["factorization"], ledger.counts["triangular_solve"]))
    (many, short), (few, long) = counts
    assert many > few
    assert short / many < long / few


def test_the_contraction_told_to_the_rule_is_that_of_a_linear_problem() -> None:
    """Richardson's iteration with K* = J/0.7 leaves 0.3 of the residual by order, whatever p and the form."""
    flow = spin_flow(1.0)
    start = near(flow, 0.5)
    matrix = flow.jacobian(start) / 0.7
    for form, order in product(FORMS, (4, 8)):
        assert branch(flow, start, matrix, order, form).contraction == pytest.approx(0.3, rel=1e-6)


# η from the residual wanted.


@pytest.mark.parametrize("wanted", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("form", FORMS)
def test_a_path_ends_at_the_residual_wanted(form: Any, wanted: float) -> None:
    """Whatever the residual at its beginning: by the true residual at once, and not far below."""
    flow = spin_flow(0.5)
    for index in (0.51, 0.5001):
        solver = Method(form=form, order=60, adaptive=True, range="true-residual", residual=wanted)
        outcome, _ = run(flow, solver, RangeUnderOne(), near(flow, index), stop=StoppingTest(kind="claim"))
        scale = flow.scale(near(flow, index))
        assert outcome.rows[-1]["limited_by"] == "end of path"
        left = float(np.linalg.norm(flow.residual(outcome.state))) / scale
        assert left <= wanted
        assert left > 1e-3 * wanted or outcome.rows[-1]["triangular_solves"] % 3 == 0  # three orders at least


def test_a_wanted_residual_takes_the_place_of_the_tolerance() -> None:
    solver = Method(tolerance=1e-30, residual=1e-6)
    made = branch(SMALL, START, SMALL.jacobian(START), 1, FIXED)
    assert solver._tolerance(made, 1e-6) == pytest.approx(1e-6 / np.linalg.norm(SMALL.residual(START)))
    assert solver._tolerance(made, 1e6) == 0.1
    assert solver._tolerance(made, None) == 1e-30


@pytest.mark.parametrize("increments", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_a_march_of_the_papers_scene_by_the_variants_ends_in_one_field(increments: int, tmp_path: Path) -> None:
    """An adaptive series needs no more tangents than the paper's and at most three quarters of the solves of p = 20."""
    text = (STUDIES / "homotopy.toml").read_text().replace("= 2e-4", f"= {increments}e-4")
    head, tail = text.split("[[sweep]]")
    chosen = """[[sweep]]
grid = { solver = [
    { kind = "anm" },
    { kind = "anm", tolerance = 5e-7, adaptive = true, range = "true-residual", extrapolation = "gram-schmidt-pade" },
    { kind = "anm", tolerance = 5e-7, adaptive = true, range = "residual-coefficient", form = "newton", order = 12 },
] }
"""
    study = tmp_path / "march.toml"
    study.write_text(head + chosen + "[quick]" + tail.split("[quick]")[1])
    runs = nlsolve.run(study, tmp_path / "out", quick=True).runs
    assert set(runs["status"]) == {"converged"}
    assert runs["velocity_error"].max() - runs["velocity_error"].min() < 1e-6
    paper, padé, newton = (row for _, row in runs.iterrows())
    for other in (padé, newton):
        assert other["tangents"] <= paper["tangents"]
        assert other["triangular_solves"] <= 0.75 * paper["triangular_solves"]


@pytest.mark.parametrize(
    "fields",
    [
        {"form": "riks"},
        {"extrapolation": "euler"},
        {"range": "arc"},
        {"corrections": -1},
        {"adaptive": "perhaps"},
        {"residual": 0.0},
        {"branch_cost": -1.0},
    ],
    ids=str,
)
def test_nonsense_is_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        Method(**fields)
