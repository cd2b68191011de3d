"""A formula as a problem: its Jacobian with constants of any shape, in the forms in which people write equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import nlsolve
from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.status import InputError, SolveError, Status
from nlsolve.testing import check_problem

U = 5
MATRIX = np.random.default_rng(1).standard_normal((U, U))
CONSTANTS = np.arange(1.0, U + 1.0)
TRIDIAGONAL = sp.diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(U, U)).tocsr()


def with_constants(u: Any) -> Any:
    return MATRIX @ u + CONSTANTS * u**2


def by_parts(u: Any) -> Any:
    """An array made of the equations, one of which does not depend on u."""
    a, b, c, d, e = u
    return np.array([a * b - 1.0, np.exp(c), d - e**2, 7.0, a])


def as_a_list(u: Any) -> Any:
    a, b, c, d, e = u
    return [a + b, b * c, np.sin(d), 1, e]


def through_asarray(u: Any) -> Any:
    return np.asarray(u) * 2.0


def of_neighbours(u: Any) -> Any:
    return TRIDIAGONAL @ u + CONSTANTS * np.sinh(u)


@pytest.mark.parametrize("formula", [with_constants, by_parts, as_a_list, of_neighbours, lambda u: CONSTANTS])
def test_the_jacobian_of_a_formula_for_states_is_its_derivative(formula):
    """Without a pattern there are U groups of columns, beside which a constant (U,) would stand in the wrong place."""
    problem = FormulaProblem(formula, U)
    for u in (np.zeros(U), np.linspace(-1.0, 2.0, U)):
        differences = [(problem.residual(u + 1e-6 * e) - problem.residual(u - 1e-6 * e)) / 2e-6 for e in np.eye(U)]
        np.testing.assert_allclose(problem.jacobian(u).toarray(), np.array(differences).T, atol=1e-8)


def test_a_formula_of_vectors_is_expanded_and_keeps_the_contract_of_problems():
    check_problem(FormulaProblem(with_constants, U), np.linspace(0.5, 1.5, U), 1e-6)
    check_problem(FormulaProblem(by_parts, U), np.linspace(0.5, 1.5, U), 1e-6)
    check_problem(FormulaProblem(of_neighbours, U, TRIDIAGONAL), np.linspace(0.5, 1.5, U), 1e-6)


def test_a_pattern_saves_runs_of_the_formula():
    runs = 0

    def formula(u: Any) -> Any:
        nonlocal runs
        runs += 1
        return of_neighbours(u)

    u = np.linspace(0.5, 1.5, U)
    full = FormulaProblem(formula, U).jacobian(u).toarray()
    assert runs == U
    runs = 0
    np.testing.assert_array_equal(FormulaProblem(formula, U, TRIDIAGONAL).jacobian(u).toarray(), full)
    assert runs == 3


@pytest.mark.parametrize("dense", [True, False])
def test_a_jacobian_that_is_given_is_used(dense):
    def jacobian(u: Any) -> Any:
        return np.diag(np.sign(u)) if dense else sp.diags_array(np.sign(u))

    problem = FormulaProblem(np.abs, 2, jacobian=jacobian)
    matrix = problem.jacobian(np.array([2.0, -3.0]))
    assert sp.issparse(matrix)
    np.testing.assert_array_equal(matrix.toarray(), [[1.0, 0.0], [0.0, -1.0]])


@pytest.mark.parametrize(
    "formula", [np.abs, lambda u: np.where(u > 0.0, u, 0.0), lambda u: u.copy(), lambda u: np.asarray(u)[0] * u]
)
def test_what_runs_on_arrays_only_has_neither_jacobian_nor_expansion(formula):
    problem = FormulaProblem(formula, 2)
    with pytest.raises(SolveError, match="F does not run on one: give `jacobian`, or choose") as refused:
        problem.jacobian(np.ones(2))
    assert refused.value.status is Status.NOT_APPLICABLE
    with pytest.raises(SolveError, match="F does not run on one: choose a method") as refused:
        problem.expand(np.ones(2))
    assert refused.value.status is Status.NOT_APPLICABLE


def test_asarray_of_a_series_does_no_harm():
    np.testing.assert_array_equal(FormulaProblem(through_asarray, 3).jacobian(np.ones(3)).toarray(), 2.0 * np.eye(3))


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        (None, "F(u) = None: should be real numbers of shape (2,); does the function return them?"),
        (np.ones(3), "F(u) = array([1., 1., 1.]): should be real numbers of shape (2,), and has shape (3,)"),
        (np.ones((2, 1)), "F(u): should be real numbers of shape (2,), and has shape (2, 1)"),
        (1.0, "F(u) = 1.0: should be real numbers of shape (2,), and has shape ()"),
        (["a", "b"], "F(u) = ['a', 'b']: should be real numbers of shape (2,), not str"),
        ([None, 1], "F(u) = [None, 1]: should be real numbers of shape (2,), not object"),
        ([True, False], "F(u) = [True, False]: should be real numbers of shape (2,), not bool"),
        ([[1], [1, 2]], "F(u) = [[1], [1, 2]]: should be real numbers of shape (2,), not lists of several lengths"),
        ([1j, 1], "F(u) = [1j, 1]: should be real numbers of shape (2,); make real and imaginary parts unknowns"),
    ],
)
def test_what_is_no_residual(returned, sentence):
    with pytest.raises(InputError) as refused:
        FormulaProblem(lambda u: returned, 2).residual(np.ones(2))
    assert str(refused.value).startswith(sentence)


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        (np.eye(3), "jacobian(u): should be real numbers of shape (2, 2), and has shape (3, 3)"),
        (1j * np.eye(2), "jacobian(u): should be real numbers of shape (2, 2); make real"),
        (None, "jacobian(u) = None: should be real numbers of shape (2, 2); does the function return them?"),
        (sp.eye_array(3), "jacobian(u): should have shape (2, 2), and has shape (3, 3)"),
        (sp.eye_array(2, dtype=complex), "entries of jacobian(u) = array([1.+0.j, 1.+0.j]): should be real numbers"),
    ],
)
def test_what_is_no_jacobian(returned, sentence):
    with pytest.raises(InputError) as refused:
        FormulaProblem(np.abs, 2, jacobian=lambda u: returned).jacobian(np.ones(2))
    assert str(refused.value).startswith(sentence)


def test_integers_are_numbers():
    residual = FormulaProblem(lambda u: [1, 2], 2).residual(np.ones(2))
    assert residual.dtype == np.float64


def square_roots(u: Any) -> Any:
    return np.sqrt(u) + u - 3.0


@pytest.mark.parametrize("columns", [True, False])
def test_a_formula_without_a_derivative_at_a_state_says_where_and_why(columns: bool) -> None:
    problem = FormulaProblem(square_roots, 2, columns=columns)
    with pytest.raises(
        SolveError, match=r"F has no derivative here: sqrt has no power series at x = 0 \(entry 1"
    ) as refusal:
        problem.jacobian(np.array([1.0, 0.0]))
    assert refusal.value.status is Status.NON_FINITE
    check_problem(problem, np.array([1.0, 0.5]))


@pytest.mark.parametrize("solver", ["newton", "anm", "newton-krylov", "trust-region"])
def test_a_method_that_meets_such_a_state_ends_with_that_sentence(solver: str) -> None:
    outcome = nlsolve.solve(square_roots, np.array([1.0, 0.0]), solver=solver)
    assert outcome.status is Status.NON_FINITE
    assert "sqrt has no power series at x = 0 (entry 1" in outcome.detail
    assert "its slope is infinite there" in outcome.detail


def test_the_derivative_of_a_power_above_one_at_zero_is_zero() -> None:
    outcome = nlsolve.solve(lambda u: u**1.5 + u - 2.0, np.zeros(3), solver="newton")
    np.testing.assert_allclose(outcome.state, 1.0)
