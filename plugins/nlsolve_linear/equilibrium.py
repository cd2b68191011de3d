"""Rows and columns brought to one size by powers of two, so that what a library takes for small depends on no unit."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

ASYMMETRY = 1e-12  # largest |A − Aᵀ| over largest |A| of a matrix that counts as symmetric
MOST, NEAR = 12, 3  # steps towards equilibrium, and the power of two within which entries are near 1
GOLDEN = 0.5 * (1.0 + 5.0**0.5)
TINY = float(np.finfo(float).tiny)


def powers_of_two(sizes: np.ndarray) -> np.ndarray:
    """The power of two, (U,), that makes each size (U,) between 1/2 and 1; 1 for zero."""
    return np.where(sizes > 0.0, np.ldexp(1.0, -np.frexp(sizes)[1]), 1.0)


def equilibrated(matrix: Any, symmetric: bool) -> tuple[np.ndarray, np.ndarray, Any]:
    """R and C, both (U,), and R A C of a sparse matrix in compressed rows.

    Where it shall stay symmetric R = C, of roots of the largest entries until these are near 1 (Ruiz 2001).
    """
    if symmetric:
        both, even = np.ones(matrix.shape[0]), matrix
        for _ in range(MOST):
            largest = largest_in_rows(even)
            if ((largest == 0.0) | (np.abs(np.log2(np.fmax(largest, TINY))) <= NEAR)).all():
                break
            both = both * powers_of_two(np.sqrt(largest))
            even = scaled(matrix, both, both)
        return both, both, even
    rows = powers_of_two(largest_in_rows(matrix))
    largest = np.zeros(matrix.shape[1])
    np.maximum.at(largest, matrix.indices, np.abs(matrix.data) * np.repeat(rows, np.diff(matrix.indptr)))
    columns = powers_of_two(largest)
    return rows, columns, scaled(matrix, rows, columns)


def even_by_diagonal(matrix: Any) -> tuple[np.ndarray, np.ndarray, Any]:
    """R twice, (U,), and R A R with a diagonal between 1/4 and 1, which no entry of a positive definite matrix exceeds
    (van der Sluis 1969).

    matrix : in compressed rows, with a positive diagonal.
    """
    both = powers_of_two(np.sqrt(matrix.diagonal()))
    return both, both, scaled(matrix, both, both)


def scaled(matrix: Any, rows: np.ndarray, columns: np.ndarray) -> Any:
    """R A C with the pattern of A, compressed rows; nothing is rounded for powers of two."""
    data = np.repeat(rows, np.diff(matrix.indptr)) * matrix.data * columns[matrix.indices]
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def largest_in_rows(matrix: Any) -> np.ndarray:
    """The largest |a| of each row of a sparse matrix in compressed rows, (U,); 0 for an empty row."""
    starts, largest = matrix.indptr[:-1], np.zeros(matrix.shape[0])
    filled = np.diff(matrix.indptr) > 0
    if filled.any():
        largest[filled] = np.maximum.reduceat(np.abs(matrix.data), starts[filled])
    return largest


def is_symmetric(compressed: Any) -> bool:
    """Whether a sparse matrix is its transpose, to 1e-12 of its largest entry: |A w − Aᵀ w| for one vector w of weights
    between 1 and 2, of which no sum cancels by chance.

    Entries that cancel are stored on one side and not on the other, so the patterns need not be the same.
    """
    weights = 1.0 + np.modf(GOLDEN * np.arange(compressed.shape[0]))[0]
    difference = compressed @ weights - weights @ compressed
    largest = np.abs(compressed.data).max(initial=0.0)
    return bool(np.abs(difference).max(initial=0.0) <= ASYMMETRY * largest)
