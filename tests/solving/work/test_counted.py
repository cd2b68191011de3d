"""What a method is handed: a Jacobian whose products are counted, and a problem that says what it lacks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from nlsolve import SolveError, Status
from nlsolve.plugin import Expansion, NonlinearProblem, Series, cached_jacobian
from nlsolve.series import Array
from nlsolve.solving.work.counted_matrix import CountedMatrix
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_problem
from nlsolve.testing.toy_problem import ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
A = sp.random_array((12, 12), density=0.4, rng=np.random.default_rng(0), format="csr")
B = sp.random_array((12, 12), density=0.4, rng=np.random.default_rng(1), format="csr")


@pytest.fixture
def ledger() -> Ledger:
    return Ledger()


# The matrix.


@pytest.mark.parametrize(
    ("work", "products"),
    [
        (lambda a: a @ START, 1),
        (lambda a: START @ a, 1),
        (lambda a: a.T @ START, 1),
        (lambda a: (2.0 * a - B) @ START, 1),
        (lambda a: a @ np.eye(12, 3), 3),
        (lambda a: np.eye(3, 12) @ a, 3),
        (lambda a: a @ (a.T @ START), 2),
        (lambda a: a.diagonal(), 0),
        (lambda a: a.toarray(), 0),
        (lambda a: a.tocsr() @ START, 0),
    ],
)
def test_a_product_with_a_vector_is_counted_and_reading_is_not(work: Any, products: int, ledger: Ledger) -> None:
    np.testing.assert_allclose(work(CountedMatrix(A, ledger)), work(A), rtol=1e-13)
    assert ledger.counts["matrix_product"] == products


@pytest.mark.parametrize(
    "combine",
    [
        lambda a: a + B,
        lambda a: B + a,
        lambda a: a - B,
        lambda a: B - a,
        lambda a: a + a,
        lambda a: -a,
        lambda a: a.T,
        lambda a: 2.0 * a,
        lambda a: np.float64(2.0) * a,
        lambda a: a / 2.0,
        lambda a: a * START,
        lambda a: START[:, None] * a,
        lambda a: a / START,
        lambda a: a @ B,
        lambda a: B @ a,
        lambda a: a.T @ a,
        lambda a: a + 0.5 * sp.eye_array(12),
        lambda a: a.T @ a + 0.1 * sp.diags_array((a.T @ a).diagonal()),
    ],
)
def test_what_is_combined_is_counted_again(combine: Any, ledger: Ledger) -> None:
    combined = combine(CountedMatrix(A, ledger))
    assert isinstance(combined, CountedMatrix)
    assert ledger.counts["matrix_product"] == 0
    np.testing.assert_allclose(combined.toarray(), combine(A).toarray(), rtol=1e-13)
    np.testing.assert_allclose(combined @ START, combine(A) @ START, rtol=1e-12)
    assert ledger.counts["matrix_product"] == 1


def test_a_counted_matrix_can_be_read(ledger: Ledger) -> None:
    matrix = CountedMatrix(A, ledger)
    assert (matrix.shape, matrix.nnz, matrix.dtype) == (A.shape, A.nnz, A.dtype)
    np.testing.assert_array_equal(matrix.data, A.data)
    for form in ("csr", "csc", "coo"):
        read = getattr(matrix, f"to{form}")()
        assert read.format == form
        np.testing.assert_array_equal(read.toarray(), A.toarray())


def test_a_cached_jacobian_is_assembled_once_a_state(ledger: Ledger) -> None:
    jacobian = cached_jacobian(CountedProblem(ToyProblem(), ledger))
    state = START.copy()
    first = jacobian(state)
    assert jacobian(state.copy()) is first
    state += 1.0  # in place: the state is remembered, not the array
    assert jacobian(state) is not first
    assert ledger.counts["jacobian"] == 2


# The problem.


class ResidualOnly(NonlinearProblem):
    """The least that is a problem."""

    def residual(self, u: Any) -> Any:
        return u**3 - 1.0


class Bent(NonlinearProblem):
    """|u| + u − 1, written as one formula, which is not analytic."""

    def residual(self, u: Any) -> Any:
        return np.abs(u) + u - 1.0

    def jacobian(self, u: Any) -> Any:
        return sp.csr_array(np.atleast_2d(self.residual(Series.seed(u)).coefficient(1)))

    def expand(self, u: Any) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))


def refusal(work: Any) -> SolveError:
    with pytest.raises(SolveError) as caught:
        work()
    assert caught.value.status is Status.NOT_APPLICABLE
    return caught.value


def test_a_problem_says_what_it_lacks_and_the_way_out(ledger: Ledger) -> None:
    for problem in (ResidualOnly(), CountedProblem(ResidualOnly(), ledger)):
        assert not problem.has_series
        assert refusal(lambda p=problem: p.jacobian(START)).detail == (
            "ResidualOnly has no Jacobian: define its method `jacobian`, or choose a method that needs its residual "
            "only, such as scipy-root with precondition = false"
        )
        assert refusal(lambda p=problem: p.expand(START)).detail == (
            "ResidualOnly has no Taylor series of its residual: write the residual as one formula and run it on a "
            "Series in a method `expand`, or choose a method that needs no series, such as newton or anderson"
        )
        assert refusal(lambda p=problem: p.secant(START)).detail.startswith("ResidualOnly has no secant matrix")


def test_a_problem_with_an_expansion_says_so_through_the_counted_view(ledger: Ledger) -> None:
    assert ToyProblem().has_series
    assert CountedProblem(ToyProblem(), ledger).has_series


def test_a_formula_that_is_not_analytic_is_a_status_where_a_series_is_asked_for(ledger: Ledger) -> None:
    counted = CountedProblem(Bent(), ledger)
    detail = refusal(lambda: counted.expand(np.ones(1))).detail
    assert detail.startswith("the formula of Bent has no Taylor series: absolute value, comparison")
    assert detail.endswith("or choose a method that needs no series, such as newton or anderson")
    assert refusal(lambda: counted.jacobian(np.ones(1))).detail.endswith("or define its method `jacobian`")


def test_an_error_of_the_formula_is_not_dressed_up_as_a_missing_series(ledger: Ledger) -> None:
    class Mistaken(Bent):
        def residual(self, u: Any) -> Any:
            return u + "one"

    with pytest.raises((TypeError, ValueError)) as caught:
        CountedProblem(Mistaken(), ledger).expand(np.ones(1))
    assert not isinstance(caught.value, SolveError)


def test_a_dense_jacobian_is_taken_for_a_sparse_one(ledger: Ledger) -> None:
    class Dense(ToyProblem):
        def jacobian(self, u: Any) -> Any:
            return super().jacobian(u).toarray()

    jacobian: Any = CountedProblem(Dense(), ledger).jacobian(START)
    np.testing.assert_array_equal(jacobian.toarray(), ToyProblem().jacobian(START).toarray())
    np.testing.assert_allclose(jacobian @ START, ToyProblem().jacobian(START) @ START, rtol=1e-13)


def test_the_check_of_problems_takes_one_without_a_series() -> None:
    class Plain(ToyProblem):
        expand = NonlinearProblem.expand  # type: ignore[assignment]

    check_problem(Plain(), START)


def test_the_driver_evaluates_a_residual_once_and_not_where_the_method_has(ledger: Ledger) -> None:
    evaluated: list[float] = []

    class Told(ToyProblem):
        def residual(self, u: Array) -> Array:
            evaluated.append(float(u[0]))
            return super().residual(u)

    problem = CountedProblem(Told(), ledger)
    for state in (START, START.copy(), 2.0 * START):
        np.testing.assert_array_equal(problem.uncounted_residual(state), ToyProblem().residual(state))
    problem.residual(3.0 * START)
    problem.uncounted_residual(3.0 * START)
    assert evaluated == [START[0], 2.0 * START[0], 3.0 * START[0]]
    assert ledger.counts["residual"] == 1
