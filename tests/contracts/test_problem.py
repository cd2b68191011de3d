"""Helpers that methods share: least squares that refuse numbers LAPACK would complain about by itself."""

from __future__ import annotations

import numpy as np
import pytest

from nlsolve.contracts.problem import Expansion, least_squares
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Series


def test_least_squares_leave_a_residual_orthogonal_to_the_columns():
    rng = np.random.default_rng(3)
    matrix, rhs = rng.normal(size=(7, 3)), rng.normal(size=7)
    x, rank = least_squares(matrix, rhs)
    np.testing.assert_allclose(matrix.T @ (rhs - matrix @ x), 0.0, atol=1e-13)
    assert rank == 3


def test_of_many_solutions_the_smallest_is_given_and_the_rank_is_told():
    x, rank = least_squares(np.ones((2, 2)), np.array([2.0, 2.0]))
    np.testing.assert_allclose(x, [1.0, 1.0])
    assert rank == 1
    assert least_squares(np.diag([1.0, 1e-5]), np.ones(2), noise=1e-3)[1] == 1


@pytest.mark.parametrize("odd", [np.nan, np.inf])
@pytest.mark.parametrize("where", ["matrix", "rhs"])
def test_numbers_that_are_not_finite_are_a_status_and_print_nothing(odd, where, capfd):
    given = {"matrix": np.ones((3, 2)), "rhs": np.ones(3)}
    given[where][0] = odd
    with pytest.raises(SolveError, match="least squares of numbers that are not finite") as raised:
        least_squares(**given)
    assert raised.value.status is Status.NON_FINITE
    assert capfd.readouterr() == ("", "")


def test_a_remainder_stays_when_the_coefficient_that_it_left_out_is_pushed():
    """R(u) = u, whose coefficients are those of the path itself."""
    path = Series(np.ones(2))
    expansion = Expansion(path, path)
    remainder = expansion.remainder(1)
    expansion.append(np.array([3.0, 4.0]))
    np.testing.assert_array_equal(remainder, np.zeros(2))
    np.testing.assert_array_equal(expansion.coefficient(1), [3.0, 4.0])
