"""Layouts: the same matrix sorted and cut, whatever the order in which its entries are stored."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from nlsolve_linear.equilibrium import is_symmetric
from nlsolve_linear.layout import Layout, laid_out
from nlsolve_linear.pardiso import Pardiso


def unsorted(dense: np.ndarray, seed: int) -> Any:
    """The matrix in compressed rows, its columns in an order drawn at random within each row."""
    matrix, draw = sp.csr_array(dense), np.random.default_rng(seed)
    for start, end in zip(matrix.indptr, matrix.indptr[1:], strict=False):
        order = start + draw.permutation(end - start)
        matrix.indices[start:end], matrix.data[start:end] = matrix.indices[order], matrix.data[order]
    matrix.has_sorted_indices = False
    return matrix


def drawn(seed: int, symmetric: bool) -> np.ndarray:
    draw = np.random.default_rng(seed)
    dense = np.where(draw.random((7, 7)) < 0.4, draw.normal(size=(7, 7)), 0.0)
    return dense + dense.T if symmetric else dense


@given(st.integers(0, 10_000), st.booleans())
def test_a_layout_sorts_and_cuts_every_matrix_of_its_pattern(seed: int, symmetric: bool) -> None:
    dense = drawn(seed, symmetric)
    given_one = unsorted(dense, seed)
    layout, rows = laid_out(given_one, None)
    assert (rows.toarray() == dense).all()
    assert rows.has_canonical_format
    assert is_symmetric(rows) == np.array_equal(dense, dense.T)
    assert (layout.upper_of(rows).toarray() == np.triu(dense)).all()
    again = given_one.copy()
    again.data *= 2.0
    assert layout.fits(again)
    same, doubled = laid_out(again, layout)
    assert same is layout
    assert (doubled.toarray() == 2.0 * dense).all()


def test_a_layout_outlives_the_matrix_it_was_made_for() -> None:
    """Sorted in place afterwards, the matrix no longer fits: its entries have changed places."""
    matrix = unsorted(drawn(1, symmetric=False), 3)
    layout = Layout.of(matrix)
    matrix.sort_indices()
    assert not layout.fits(matrix)


def test_entries_that_share_a_place_are_added_and_the_given_matrix_stays() -> None:
    matrix = sp.csr_array((np.array([1.0, 2.0, 3.0]), np.array([1, 1, 0]), np.array([0, 2, 3])), shape=(2, 2))
    layout, rows = laid_out(matrix, None)
    assert rows.toarray().tolist() == [[0.0, 3.0], [3.0, 0.0]]
    assert matrix.nnz == 3
    assert not layout.fits(matrix)


def test_factors_of_a_later_matrix_in_another_order_solve_with_it() -> None:
    if Pardiso.absent is not None:
        return
    dense = drawn(5, symmetric=True) + 9.0 * np.eye(7)
    b = np.arange(7.0)
    first = Pardiso().factorize(unsorted(dense, 1))
    for seed, factor in ((1, 2.0), (2, 3.0)):
        later = Pardiso().factorize(unsorted(factor * dense, seed), first)
        assert np.allclose(factor * dense @ later.solve(b), b)
    assert np.allclose(dense @ first.solve(b), b)
