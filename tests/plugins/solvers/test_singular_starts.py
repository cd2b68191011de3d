"""Starts where J is singular: `robust` gets away, the other methods say what happened and what to choose instead."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nlsolve
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status

FACTORISING = (
    {"kind": "newton"},
    {"kind": "newton", "globalization": {"kind": "none"}},
    {"kind": "newton", "globalization": {"kind": "cubic"}},
    {"kind": "modified-newton"},
    {"kind": "newton-krylov"},
    {"kind": "trust-region"},
    {"kind": "broyden"},
    {"kind": "anderson"},
    {"kind": "anm"},
    {"kind": "anm", "form": "newton", "extrapolation": "pade", "range": "true-residual", "order": 10},
)


def parabola(u: Any) -> Any:
    return u**2 - 2.0 * u


def squeezed(u: Any) -> Any:
    x, y = u
    return np.stack([(x - 1.0) ** 2, x + y])


def ring(u: Any) -> Any:
    x, y = u
    return np.stack([x**2 + y**2 - 2.0, x - y])


def pair(u: Any) -> Any:
    x, y = u
    return np.stack([x**2 - 4.0, np.exp(y) - 2.0])


def repeated(u: Any) -> Any:
    """J = [[1, 1], [1, 1]] at (0, 0), a full diagonal."""
    x, y = u
    return np.stack([x + y + x * y - 3.0, x + y + x**2 - 3.0])


def squares(u: Any) -> Any:
    """J = 0 at the origin."""
    return u**2 - np.arange(1.0, 41.0)


def swapped(u: Any) -> Any:
    """A diagonal of zeros everywhere; J is singular where y = 0."""
    x, y = u
    return np.stack([y**2 - 1.0, x - 3.0])


Formula = Callable[[Any], Any]
STARTS: dict[str, tuple[Formula, list[float], list[list[float]], str]] = {
    "parabola": (parabola, [1.0], [[0.0], [2.0]], "J = 0, so that R does not change with any unknown to first order"),
    "squeezed": (squeezed, [1.0, 1.0], [[1.0, -1.0]], "R[0] does not change with any unknown to first order"),
    "ring": (ring, [0.0, 0.0], [[1.0, 1.0], [-1.0, -1.0]], "R[0] does not change with any unknown to first order"),
    "pair": (pair, [0.0, 0.0], [[s, np.log(2.0)] for s in (2.0, -2.0)], "R does not change with u[0] to first order"),
    "repeated": (repeated, [0.0, 0.0], [[1.0, 1.0], [0.0, 3.0]], "the rank of J is 1 of 2"),
    "swapped": (swapped, [0.0, 0.0], [[3.0, 1.0], [3.0, -1.0]], "R does not change with u[1] to first order"),
    "squares": (squares, [0.0] * 40, [], "J = 0, so that R does not change with any unknown"),
}


def solved(formula: Formula, start: list[float], solver: Any, linear: str = "superlu") -> Outcome:
    return nlsolve.solve(formula, np.array(start), solver=solver, linear=linear)


@pytest.mark.parametrize("linear", ["superlu", "lapack"])
@pytest.mark.parametrize("name", STARTS)
def test_the_robust_method_gets_away(name: str, linear: str) -> None:
    formula, start, roots, _ = STARTS[name]
    outcome = solved(formula, start, "robust", linear)
    assert outcome.converged, outcome.message
    assert outcome.residual_norm <= 1e-8
    if roots:
        nearest = min(float(np.linalg.norm(outcome.state - root)) for root in np.array(roots))
        assert nearest < (1e-3 if name == "squeezed" else 1e-6)  # a double root: F is flat there
    np.testing.assert_array_equal(
        outcome.state, solved(formula, start, "robust", linear).state
    )  # nothing is drawn anew


@pytest.mark.parametrize("solver", FACTORISING, ids=lambda solver: "-".join(map(str, solver.values())))
@pytest.mark.parametrize("name", STARTS)
def test_the_others_say_what_happened_and_what_to_choose(name: str, solver: dict[str, Any]) -> None:
    formula, start, _, sentence = STARTS[name]
    outcome = solved(formula, start, solver)
    assert outcome.status is Status.SINGULAR_TANGENT
    assert outcome.detail.startswith(sentence)
    assert outcome.detail.endswith("choose the solver robust, which gets away from such a state, or another start")
    np.testing.assert_array_equal(outcome.state, start)


@pytest.mark.parametrize("name", ["parabola", "ring", "squares"])
def test_damped_least_squares_say_that_the_gradient_vanishes(name: str) -> None:
    formula, start, _, _ = STARTS[name]
    outcome = solved(formula, start, "levenberg-marquardt")
    assert outcome.status is Status.STAGNATED
    assert "Jᵀ R = 0 here: the least or another stationary point of ‖R‖" in outcome.detail
    assert outcome.detail.endswith("begin elsewhere, or choose robust")


def test_damped_least_squares_work_with_a_column_of_zeros() -> None:
    """The unknown whose column is zero stays, the other one is solved for."""
    outcome = solved(pair, [0.0, 0.0], "levenberg-marquardt")
    assert outcome.status is Status.STAGNATED
    np.testing.assert_allclose(outcome.state, [0.0, np.log(2.0)], atol=1e-6)
    assert solved(squeezed, [1.0, 1.0], "levenberg-marquardt").converged


@pytest.mark.parametrize("solver", ["newton", "anderson", "broyden", "robust"])
def test_a_tangent_that_becomes_singular_on_the_way_is_told_and_left(solver: str) -> None:
    """F = x³ − 3x + 7: Newton's step from 2 leads to 1, where F = 5 and F′ = 0. The root is near −2.426."""
    component = {"kind": solver} if solver == "robust" else {"kind": solver, "globalization": {"kind": "none"}}
    outcome = nlsolve.solve(
        lambda u: u**3 - 3.0 * u + 7.0, np.array([2.0]), solver=component, refresh={"kind": "every-iteration"}
    )
    if solver == "robust":
        assert outcome.converged, outcome.message
        np.testing.assert_allclose(outcome.state, np.roots([1.0, 0.0, -3.0, 7.0])[0].real)
        return
    assert outcome.status is Status.SINGULAR_TANGENT
    assert (outcome.iterations, outcome.state[0]) == (1, 1.0)
    assert outcome.detail.startswith("J = 0, so that R does not change with any unknown to first order")
    assert "choose the solver robust" in outcome.detail


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.integers(1, 5), hole=st.sampled_from(["row", "column"]))
def test_what_is_solved_beside_a_singular_start_is_mostly_solved_from_it(seed: int, size: int, hole: str) -> None:
    """u_i² = c_i, turned: J(0) has a row or column of zeros, or is zero. Every root is simple."""
    g = np.random.default_rng(seed)
    c = 0.5 + g.random(size)
    turn = np.linalg.qr(g.standard_normal((size, size)))[0]
    linear = g.random(size)
    linear[0] = 0.0

    def formula(u: Any) -> Any:
        values = u * u + as_numbers(linear, u) * u - as_numbers(c, u)
        return turn @ values if hole == "column" else values

    def as_numbers(values: np.ndarray, u: Any) -> Any:
        return values.reshape(-1, *[1] * (len(u.shape) - 1))

    outcome = solved(formula, [0.0] * size, "robust")
    assert outcome.converged, outcome.message
    np.testing.assert_allclose(outcome.state**2 + linear * outcome.state, c, atol=1e-6)


def test_without_a_root_the_last_sentence_tells_what_was_tried() -> None:
    outcome = solved(lambda u: u * u + 1.0, [0.0], "robust")
    assert outcome.status is Status.SINGULAR_TANGENT
    assert outcome.detail.endswith(
        "tried: steps of least norm and random moves, from which ‖R‖ does not fall to zero either"
    )


def test_a_start_without_a_derivative_is_left_too() -> None:
    """√u − 1 from 0, where its slope is infinite."""
    outcome = solved(lambda u: np.sqrt(u) - 1.0, [0.0], "robust")
    assert outcome.converged, outcome.message
    np.testing.assert_allclose(outcome.state, 1.0)


def test_a_thickening_flow_is_solved_from_rest_where_nothing_resists() -> None:
    """n = 2 and ε₀ = 0: J = 0 at every point that is at rest."""
    study = {
        "question": "?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
        "discretizer": {"kind": "delaunay"},
        "law": {"kind": "power-law", "index": 2.0, "regularization": 0.0},
        "start": {"values": []},
    }
    run = nlsolve.run({**study, "solver": {"kind": "robust"}}).runs.iloc[0]
    assert run["status"] == "converged", run["message"]
    failed = nlsolve.run({**study, "solver": {"kind": "newton"}}).runs.iloc[0]
    assert failed["status"] == "singular tangent"
    assert "choose the solver robust" in failed["message"]
