"""y = A x, counted: a sparse matrix whose products with vectors are entered in a ledger."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.series import Array
from nlsolve.solving.work.ledger import Ledger


class CountedMatrix:
    """A sparse matrix A as a method receives it.

    A @ x, x @ A : a product with a vector is counted and timed; with an array of k vectors it is counted as k products.
    A.T, −A, A + B, A − B, s A, A / s, A @ B, B @ A : are counted matrices again, for numbers s and sparse or counted B.
    shape, dtype, nnz, data, diagonal(), toarray(), tocsr(), tocsc(), tocoo() : can be read, which is not counted.

    For every other operation `tocsr`, `tocsc` and `tocoo` return an ordinary SciPy array. K* is what factorises.
    """

    __array_ufunc__ = None  # so that NumPy's arrays and numbers leave x @ A and s A to this class

    def __init__(self, matrix: Any, ledger: Ledger) -> None:
        self._matrix, self._ledger = matrix, ledger

    # Products, which are counted.

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

    # Combinations, which are counted matrices again.

    def _again(self, result: Any) -> Any:
        return CountedMatrix(result, self._ledger) if sp.issparse(result) else result

    @property
    def T(self) -> CountedMatrix:
        """Aᵀ, a counted matrix."""
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

    # Entries and shape, which can be read.

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns."""
        rows, columns = self._matrix.shape
        return rows, columns

    @property
    def dtype(self) -> Any:
        """NumPy type of the entries."""
        return self._matrix.dtype

    @property
    def nnz(self) -> int:
        """Number of stored entries."""
        return int(self._matrix.nnz)

    @property
    def data(self) -> Array:
        """The stored entries, (nnz,), in the order of the format that the problem assembled."""
        return self._matrix.data

    def diagonal(self) -> Array:
        """The entries A_ii, (U,) for a (U, U) matrix."""
        return self._matrix.diagonal()

    def toarray(self) -> Array:
        """A as a dense array, of the shape of A."""
        return self._matrix.toarray()

    def tocsr(self) -> Any:
        """A as a SciPy array that stores rows."""
        return self._matrix.tocsr()

    def tocsc(self) -> Any:
        """A as a SciPy array that stores columns."""
        return self._matrix.tocsc()

    def tocoo(self) -> Any:
        """A as a SciPy array that stores row, column and value of each entry."""
        return self._matrix.tocoo()


def counted(matrix: Any, ledger: Ledger) -> CountedMatrix:
    """A matrix (U, U) with its products counted; a dense array is made sparse."""
    if isinstance(matrix, CountedMatrix):
        return matrix
    return CountedMatrix(sp.csr_array(matrix) if isinstance(matrix, np.ndarray) else matrix, ledger)


def plain(matrix: Any) -> Any:
    """The SciPy matrix inside a counted one; anything else unchanged."""
    return matrix._matrix if isinstance(matrix, CountedMatrix) else matrix
