"""y = A x, counted: a sparse matrix whose products with vectors are entered in a ledger."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.series import Array
from nlsolve.solving.ledger import Ledger


class CountedMatrix:
    """A sparse matrix A as a method receives it.

    A @ x, x @ A : a product with a vector is counted and timed; with an array of k vectors it is counted as k products.
    A.T, −A, A + B, A − B, s A, A / s, A @ B, B @ A : with numbers s and sparse or counted B are counted matrices again.
    shape, dtype, nnz, data, diagonal(), toarray(), tocsr(), tocsc(), tocoo() : can be read, which is not counted.

    What `tocsr` and its like return is an ordinary SciPy array for all that is not said here. Factorising is for K*.
    """

    __array_ufunc__ = None  # NumPy's arrays and numbers leave x @ A and s A to us

    def __init__(self, matrix: Any, ledger: Ledger) -> None:
        self._matrix, self._ledger = matrix, ledger

    # Products, which are work.

    def __matmul__(self, other: Any) -> Any:
        right = plain(other)
        return self._again(self._matrix @ right) if sp.issparse(right) else self._product(self._matrix, right)

    def __rmatmul__(self, other: Any) -> Any:
        left = plain(other)
        return self._again(left @ self._matrix) if sp.issparse(left) else self._product(self._matrix.T, left.T).T

    def _product(self, matrix: Any, vectors: Array) -> Any:
        with self._ledger.entry("matrix_product"):
            product = matrix @ vectors
        if vectors.ndim > 1:
            self._ledger.counts["matrix_product"] += vectors.shape[1] - 1
        return product

    # Combinations.

    def _again(self, result: Any) -> Any:
        return CountedMatrix(result, self._ledger) if sp.issparse(result) else result

    @property
    def T(self) -> CountedMatrix:
        return CountedMatrix(self._matrix.T, self._ledger)

    def __neg__(self) -> CountedMatrix:
        return CountedMatrix(-self._matrix, self._ledger)

    def __add__(self, other: Any) -> Any:
        return self._again(self._matrix + plain(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self._again(self._matrix - plain(other))

    def __rsub__(self, other: Any) -> Any:
        return self._again(plain(other) - self._matrix)

    def __mul__(self, factor: Any) -> Any:
        return self._again(self._matrix.multiply(plain(factor)))  # entry by entry, be it an array or a matrix of SciPy

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Any:
        return self._again(self._matrix / divisor)

    # What can be read.

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self._matrix.shape
        return rows, columns

    @property
    def dtype(self) -> Any:
        return self._matrix.dtype

    @property
    def nnz(self) -> int:
        return int(self._matrix.nnz)

    @property
    def data(self) -> Array:
        """The stored entries, in the order of the format that the problem assembled."""
        return self._matrix.data

    def diagonal(self) -> Array:
        return self._matrix.diagonal()

    def toarray(self) -> Array:
        return self._matrix.toarray()

    def tocsr(self) -> Any:
        return self._matrix.tocsr()

    def tocsc(self) -> Any:
        return self._matrix.tocsc()

    def tocoo(self) -> Any:
        return self._matrix.tocoo()


def counted(matrix: Any, ledger: Ledger) -> CountedMatrix:
    """The matrix with its products counted; a dense array is taken for a sparse one."""
    if isinstance(matrix, CountedMatrix):
        return matrix
    return CountedMatrix(sp.csr_array(matrix) if isinstance(matrix, np.ndarray) else matrix, ledger)


def plain(matrix: Any) -> Any:
    """The matrix in a counted one; anything else as it is."""
    return matrix._matrix if isinstance(matrix, CountedMatrix) else matrix
