"""B and S as sparse matrices, from neighbours and the weights of ∂/∂x and ∂/∂y; assembled when they must be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve_discretizers.kernels import products
from nlsolve_discretizers.kernels.rows import Row, sparse_rows

X, Y = 0, 1


@dataclass(frozen=True)
class Gradient:
    """∂/∂x and ∂/∂y at T targets: neighbours `near` (T, k) among the sources, weights `both` (2, T, k) [1/mm].

    targets : those that are meant, (R,); None: all. The weights of the others are kept: what reads both the ones and
        all reads them once into the cache.
    """

    near: np.ndarray
    both: np.ndarray
    targets: np.ndarray | None = None

    @property
    def dx(self) -> np.ndarray:
        """The weights of ∂/∂x, (T, k)."""
        return self.both[X]

    @property
    def dy(self) -> np.ndarray:
        """The weights of ∂/∂y, (T, k)."""
        return self.both[Y]

    @cached_property
    def numbers(self) -> np.ndarray:
        """The neighbours, in half the memory."""
        return np.ascontiguousarray(self.near, dtype=np.uint32)

    def at(self, targets: np.ndarray) -> Gradient:
        """The same at some of the targets."""
        return Gradient(self.numbers, self.both, targets)

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours (R, k) and weights (2, R, k) of the targets that are meant."""
        if self.targets is None:
            return self.near, self.both
        return self.near.take(self.targets, axis=0).astype(np.intp), self.both.take(self.targets, axis=1)

    def matrices(self, sources: int) -> tuple[Any, Any]:
        """Sparse (T, sources) matrices."""
        dx, dy = (sparse_rows(self.near, self.both, [[(0, axis, 1.0)]], 1, sources) for axis in (X, Y))
        return dx, dy

    def strain(self, nodes: int) -> Unassembled:
        """B (3T, 2 nodes): xx, yy, xy of ½(∇v + ᵗ∇v)."""
        rows = [[(0, X, 1.0)], [(1, Y, 1.0)], [(0, Y, 0.5), (1, X, 0.5)]]
        return self._unassembled(products.STRAIN_RATE, rows, 2, 2 * nodes)

    def divergence(self, nodes: int) -> Unassembled:
        """div v (T, 2 nodes)."""
        return self._unassembled(products.DIVERGENCE, [[(0, X, 1.0), (1, Y, 1.0)]], 2, 2 * nodes)

    def divergence_of_stress(self, points: int) -> Unassembled:
        """S (2T, 3 points): ∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major."""
        xx, yy, xy = 0, points, 2 * points
        rows = [[(xx, X, 1.0), (xy, Y, 1.0)], [(yy, Y, 1.0), (xy, X, 1.0)]]
        return self._unassembled(products.DIVERGENCE_OF_STRESS, rows, 1, 3 * points, of_target_together=True)

    def of_pressure(self, points: int) -> Unassembled:
        """(2T, points): ∂p/∂x and ∂p/∂y, node-major."""
        return self._unassembled(products.GRADIENT, [[(0, X, 1.0)], [(0, Y, 1.0)]], 1, points, of_target_together=True)

    def _unassembled(
        self, which: int, rows: Sequence[Row], stride: int, columns: int, of_target_together: bool = False
    ) -> Unassembled:
        count = len(self.near if self.targets is None else self.targets)
        return Unassembled((len(rows) * count, columns), self, which, tuple(rows), stride, of_target_together)


@dataclass(frozen=True, eq=False)
class Unassembled:
    """A sparse matrix of derivatives, `shape`, whose entries are made when they are first asked for.

    A @ x with a vector asks for none where numba is installed: it reads each weight once. For all else A is a matrix of
    SciPy, and what is made of it as well.

    weights : the derivatives that its entries are made of.
    which : the product A @ x among those of `kernels.products`.
    rows, stride, of_target_together : the same in terms of `sparse_rows`.
    magnitudes : whether A is that of the magnitudes of its entries.
    """

    shape: tuple[int, int]
    weights: Gradient
    which: int
    rows: tuple[Row, ...]
    stride: int
    of_target_together: bool
    magnitudes: bool = False
    dtype = np.dtype(float)
    __array_ufunc__ = None  # so that NumPy's arrays leave x @ A to this class

    def tocsr(self) -> Any:
        """A as a SciPy array that stores rows, always the same one."""
        return self._matrix

    @cached_property
    def _matrix(self) -> Any:
        near, both = self.weights.rows()
        both = np.abs(both) if self.magnitudes else both
        return sparse_rows(near, both, self.rows, self.stride, self.shape[1], self.of_target_together)

    @cached_property
    def _times(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """x -> A x from the weights; None where that is not compiled."""
        code = products.machine_code()
        if code is None:
            return None
        near, both, targets = self.weights.numbers, np.ascontiguousarray(self.weights.both), self.weights.targets
        chosen = np.arange(len(near)) if targets is None else targets
        return partial(code, self.which, chosen.astype(np.uint32), near, both, self.magnitudes)

    def __matmul__(self, other: Any) -> Any:
        if self._times is not None and isinstance(other, np.ndarray) and other.shape == self.shape[1:]:
            return self._times(np.ascontiguousarray(other, dtype=float))
        entries = _entries(other)
        return self._matrix @ entries if isinstance(entries, np.ndarray) or sp.issparse(entries) else NotImplemented

    def __abs__(self) -> Unassembled:
        return replace(self, magnitudes=True)  # all factors are positive, and each weight has an entry of its own

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._matrix, name)

    def __getitem__(self, part: Any) -> Any:
        return self._matrix[part]

    def __rmatmul__(self, other: Any) -> Any:
        return other @ self._matrix

    def __neg__(self) -> Any:
        return -self._matrix

    def __add__(self, other: Any) -> Any:
        return self._matrix + _entries(other)

    def __sub__(self, other: Any) -> Any:
        return self._matrix - _entries(other)

    def __rsub__(self, other: Any) -> Any:
        return other - self._matrix

    def __mul__(self, factor: Any) -> Any:
        return self._matrix * factor

    __radd__, __rmul__ = __add__, __mul__


def _entries(matrix: Any) -> Any:
    return matrix.tocsr() if isinstance(matrix, Unassembled) else matrix


def rows_times(factors: np.ndarray, matrix: Any) -> Any:
    """The CSR matrix with each of its rows times a factor, (rows,)."""
    values = np.repeat(factors, np.diff(matrix.indptr)) * matrix.data
    return sp.csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
