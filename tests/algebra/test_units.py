"""No verdict depends on a unit: F by a number, unknowns by a number, each equation and each unknown by its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_systems import Bratu, PLaplacian, Published

import nlsolve
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status
from nlsolve.plugin import as_column

Formula = Callable[[Any], Any]

FULL = {"kind": "none"}
EQUATIONS: tuple[dict[str, Any], ...] = (
    {"kind": "robust"},
    {"kind": "newton", "globalization": FULL},
    {"kind": "newton"},
    {"kind": "newton", "globalization": {"kind": "non-monotone"}},
    {"kind": "newton", "globalization": {"kind": "cubic"}},
    {"kind": "modified-newton"},
    {"kind": "pseudo-transient"},
    {"kind": "broyden"},
    {"kind": "anderson"},
    {"kind": "anm"},
)
"""Methods that no unit of an equation changes."""

UNKNOWNS = EQUATIONS[:7]
"""Those of them that no unit of an unknown changes either."""

ANY_UNIT: tuple[dict[str, Any], ...] = (
    *EQUATIONS,
    {"kind": "newton", "globalization": {"kind": "backtracking", "measure": "euclidean"}},
    {"kind": "newton-krylov"},
    {"kind": "levenberg-marquardt"},
    {"kind": "trust-region"},
    {"kind": "pseudo-transient", "measure": "euclidean"},
    {"kind": "anm", "form": "newton", "extrapolation": "pade", "range": "true-residual", "tolerance": 1e-3},
)
"""Methods that one unit for all of F does not change."""


def named(solver: dict[str, Any]) -> str:
    return "-".join(str(value["kind"] if isinstance(value, dict) else value) for value in solver.values())


def rescaled(formula: Formula, rows: np.ndarray, columns: np.ndarray) -> Formula:
    """v ↦ r ∘ F(v/c): the same equations in other units, u = v/c."""
    return lambda v: as_column(rows, v) * formula(as_column(1.0 / columns, v) * v)


def same(outcome: Outcome, other: Outcome, columns: np.ndarray) -> None:
    """The same verdict, counts and states to rounding, where the solve ends at a root; on the way to nowhere rounding
    grows.
    """
    if not other.converged:
        return
    assert outcome.status is other.status, (outcome.message, other.message)
    assert outcome.counts == other.counts
    np.testing.assert_allclose(outcome.state / columns, other.state, rtol=1e-6, atol=1e-9)
    assert outcome.converged == (outcome.newton_correction <= 1e-6)


PROBLEMS = ("powell-badly-scaled", "helical-valley", "watson", "chebyquad", "dennis-schnabel", "wood", "broyden-banded")


@pytest.mark.parametrize("solver", ANY_UNIT, ids=named)
@pytest.mark.parametrize("problem", ["helical-valley", "dennis-schnabel"])
def test_f_in_any_unit_is_solved_by_the_same_steps(problem: str, solver: dict[str, Any]) -> None:
    system = Published(problem=problem)
    one = np.ones(len(system.start()))
    plain = nlsolve.solve(system.formula, system.start(), solver)
    for factor in (2.0**-40, 2.0**40):
        formula = rescaled(system.formula, factor * one, one)
        same(nlsolve.solve(formula, system.start(), solver), plain, one)


@settings(max_examples=12, deadline=None)
@given(st.sampled_from(PROBLEMS), st.sampled_from(EQUATIONS), st.integers(0, 2**32 - 1))
def test_each_equation_in_its_own_unit_is_solved_by_the_same_steps(
    problem: str, solver: dict[str, Any], seed: int
) -> None:
    system = Published(problem=problem)
    one = np.ones(len(system.start()))
    rows = 2.0 ** np.random.default_rng(seed).integers(-30, 31, len(one))
    plain = nlsolve.solve(system.formula, system.start(), solver)
    same(nlsolve.solve(rescaled(system.formula, rows, one), system.start(), solver), plain, one)


@settings(max_examples=12, deadline=None)
@given(st.sampled_from(PROBLEMS), st.sampled_from(UNKNOWNS), st.integers(0, 2**32 - 1))
def test_so_is_each_unknown_in_its_own_unit(problem: str, solver: dict[str, Any], seed: int) -> None:
    system = Published(problem=problem)
    random = np.random.default_rng(seed)
    rows, columns = (2.0 ** random.integers(-30, 31, len(system.start())) for _ in range(2))
    plain = nlsolve.solve(system.formula, system.start(), solver)
    formula = rescaled(system.formula, rows, columns)
    same(nlsolve.solve(formula, columns * system.start(), solver), plain, columns)


@pytest.mark.parametrize("solver", ANY_UNIT, ids=named)
@pytest.mark.parametrize("size", [1e-170, 1e-12, 1e9, 1e160, 1e300])
def test_up_to_the_largest_float(size: float, solver: dict[str, Any]) -> None:
    plain = nlsolve.solve(lambda u: u**2 - 2.0, [1.0], solver)
    outcome = nlsolve.solve(lambda u: size * (u**2 - 2.0), [1.0], solver)
    assert (outcome.status, outcome.iterations) == (Status.CONVERGED, plain.iterations)
    np.testing.assert_allclose(outcome.state, np.sqrt(2.0), rtol=1e-7)


@pytest.mark.parametrize("solver", ANY_UNIT, ids=named)
@pytest.mark.parametrize("unit", [1e-170, 1e-30, 1e30, 1e160])
def test_in_any_unit_of_the_unknown(unit: float, solver: dict[str, Any]) -> None:
    outcome = nlsolve.solve(lambda u: (u / unit) ** 2 - 2.0, [unit], solver)
    assert outcome.converged, outcome.message
    np.testing.assert_allclose(outcome.state, np.sqrt(2.0) * unit, rtol=1e-7)


def pressure_and_gap(u: Any) -> Any:
    """1e6 Pa and 1 mm, each equation in its own unit."""
    pressure, gap = u
    return np.stack([pressure / 1e6 - 1.0, 1e-6 * (gap / 1e-3 - 1.0) * (1.0 + gap / 1e-3)])


@pytest.mark.parametrize("solver", ANY_UNIT, ids=named)
def test_a_pressure_and_a_gap_in_one_system(solver: dict[str, Any]) -> None:
    outcome = nlsolve.solve(pressure_and_gap, [0.5e6, 3e-3], solver)
    assert outcome.converged, outcome.message
    np.testing.assert_allclose(outcome.state, [1e6, 1e-3], rtol=1e-6)


def test_the_untouched_start_is_not_solved_because_f_is_small() -> None:
    outcome = nlsolve.solve(lambda u: 1e-12 * (u**2 - 2.0), [1.0], budget={"iterations": 1})
    assert not outcome.converged
    assert outcome.residual_absolute < 1e-11


@pytest.mark.parametrize("system", [Bratu, PLaplacian])
@pytest.mark.parametrize("solver", ["newton", "robust"])
def test_a_refined_grid_takes_the_same_factorisations(system: Any, solver: str) -> None:
    further = {"regularization": 1e-2} if system is PLaplacian else {}
    outcomes = [nlsolve.solve(system(nodes=nodes, **further), solver=solver) for nodes in (100, 1000, 10_000)]
    assert all(outcome.converged for outcome in outcomes)
    found = [outcome.counts["factorizations"] for outcome in outcomes]
    assert found[1] == found[2]
    assert max(found) - min(found) <= 2, "100 points are a coarser problem"


def test_a_small_residual_on_a_fine_grid_is_not_enough() -> None:
    """At 10,000 points |J| |u| is 4/h² times u: the relative residual at u = 0 is at once below 1e-7."""
    outcome = nlsolve.solve(Bratu(nodes=10_000), stop={"tolerance": 1e-6})
    assert outcome.converged
    assert outcome.iterations > 0
    assert outcome.newton_correction <= 1e-6


def test_typical_sizes_say_what_counts_as_zero() -> None:
    """y → 0 by halves; what is small beside 1 is zero once the caller has said so."""

    def formula(u: Any) -> Any:
        x, y = u
        return np.stack([x - 1.0, y**2])

    plain = nlsolve.solve(formula, [2.0, 1.0], "newton")
    told = nlsolve.solve(formula, [2.0, 1.0], "newton", typical_sizes=[1.0, 1e3])
    assert plain.converged
    assert told.converged
    assert told.iterations < plain.iterations


@pytest.mark.parametrize(
    ("sizes", "sentence"),
    [([1.0], "typical_sizes"), ([1.0, -1.0], "none of them negative"), ([1.0, np.inf], "finite")],
)
def test_wrong_typical_sizes_are_refused(sizes: list[float], sentence: str) -> None:
    with pytest.raises(nlsolve.InputError, match=sentence):
        nlsolve.solve(pressure_and_gap, [1.0, 1.0], typical_sizes=sizes)
    with pytest.raises(nlsolve.InputError, match="has its own"):
        nlsolve.solve(Bratu(nodes=3), typical_sizes=sizes)


def test_without_a_jacobian_differences_judge() -> None:
    def formula(u: Any) -> Any:
        return np.array([1e-9 * (float(u[0]) ** 2 - 2.0), 1e9 * (float(u[1]) - float(u[0]))])

    solver = {"kind": "scipy-root", "method": "hybr", "precondition": False}
    outcome = nlsolve.solve(formula, [1.0, 1.0], solver)
    assert outcome.converged, outcome.message
    assert outcome.newton_correction <= 1e-8


def test_a_published_bound_is_met_in_its_own_norm() -> None:
    stop = {"kind": "absolute", "tolerance": 1e-6, "norm": "maximum"}
    outcome = nlsolve.solve(Published(problem="wood"), stop=stop)
    assert outcome.converged
    last = np.abs(Published(problem="wood").formula(outcome.state)).max()
    assert last <= 1e-6
    far = nlsolve.solve(lambda u: 1e9 * (u**2 - 2.0), [1.0], "newton", stop={"kind": "absolute", "tolerance": 1e-12})
    assert far.status is Status.STAGNATED
