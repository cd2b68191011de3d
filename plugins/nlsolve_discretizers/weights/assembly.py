"""B and S as sparse matrices, from neighbours and the weights of ∂/∂x and ∂/∂y."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve_discretizers.kernels.rows import sparse_rows

X, Y = 0, 1


@dataclass(frozen=True)
class Gradient:
    """∂/∂x and ∂/∂y at T targets: neighbours `near` (T, k) among the sources, weights `both` (2, T, k) [1/mm]."""

    near: np.ndarray
    both: np.ndarray

    @property
    def dx(self) -> np.ndarray:
        """The weights of ∂/∂x, (T, k)."""
        return self.both[X]

    @property
    def dy(self) -> np.ndarray:
        """The weights of ∂/∂y, (T, k)."""
        return self.both[Y]

    def at(self, targets: np.ndarray) -> Gradient:
        """The same at some of the targets."""
        return Gradient(self.near[targets], self.both[:, targets])

    def matrices(self, sources: int) -> tuple[Any, Any]:
        """Sparse (T, sources) matrices."""
        dx, dy = (sparse_rows(self.near, self.both, [[(0, axis, 1.0)]], 1, sources) for axis in (X, Y))
        return dx, dy

    def strain(self, nodes: int) -> Any:
        """B (3T, 2 nodes): xx, yy, xy of ½(∇v + ᵗ∇v)."""
        rows = [[(0, X, 1.0)], [(1, Y, 1.0)], [(0, Y, 0.5), (1, X, 0.5)]]
        return sparse_rows(self.near, self.both, rows, 2, 2 * nodes)

    def divergence(self, nodes: int) -> Any:
        """div v (T, 2 nodes)."""
        return sparse_rows(self.near, self.both, [[(0, X, 1.0), (1, Y, 1.0)]], 2, 2 * nodes)

    def divergence_of_stress(self, points: int) -> Any:
        """S (2T, 3 points): ∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major."""
        xx, yy, xy = 0, points, 2 * points
        rows = [[(xx, X, 1.0), (xy, Y, 1.0)], [(yy, Y, 1.0), (xy, X, 1.0)]]
        return sparse_rows(self.near, self.both, rows, 1, 3 * points, of_target_together=True)

    def of_pressure(self, points: int) -> Any:
        """(2T, points): ∂p/∂x and ∂p/∂y, node-major."""
        return sparse_rows(self.near, self.both, [[(0, X, 1.0)], [(0, Y, 1.0)]], 1, points, of_target_together=True)


def rows_times(factors: np.ndarray, matrix: Any) -> Any:
    """The CSR matrix with each of its rows times a factor, (rows,)."""
    values = np.repeat(factors, np.diff(matrix.indptr)) * matrix.data
    return sp.csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
