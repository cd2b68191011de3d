"""B and S as sparse matrices, from neighbours and the weights of ∂/∂x and ∂/∂y."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Gradient:
    """∂/∂x and ∂/∂y at T targets: neighbours `near` (T, k) among the sources, weights `dx` and `dy` (T, k) [1/mm]."""

    near: np.ndarray
    dx: np.ndarray
    dy: np.ndarray

    def at(self, targets: np.ndarray) -> Gradient:
        """The same at some of the targets."""
        return Gradient(self.near[targets], self.dx[targets], self.dy[targets])

    def matrices(self, sources: int) -> tuple[Any, Any]:
        """Sparse (T, sources) matrices."""
        shape = (len(self.near), sources)
        return sparse_rows([(self.near, self.dx)], shape), sparse_rows([(self.near, self.dy)], shape)

    def strain(self, nodes: int) -> Any:
        """B (3T, 2 nodes): xx, yy, xy of ½(∇v + ᵗ∇v)."""
        u, v = 2 * self.near, 2 * self.near + 1
        blocks = [(u, self.dx), (v, self.dy), (_in_turn(u, v), _in_turn(0.5 * self.dy, 0.5 * self.dx))]
        return sparse_rows(blocks, (3 * len(self.near), 2 * nodes))

    def divergence(self, nodes: int) -> Any:
        """div v (T, 2 nodes)."""
        block = _in_turn(2 * self.near, 2 * self.near + 1), _in_turn(self.dx, self.dy)
        return sparse_rows([block], (len(self.near), 2 * nodes))

    def divergence_of_stress(self, points: int) -> Any:
        """S (2T, 3 points): ∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major."""
        xx, yy, xy = self.near, self.near + points, self.near + 2 * points
        columns, values = np.hstack([xx, xy, yy, xy]), np.hstack([self.dx, self.dy, self.dy, self.dx])
        return _node_major(columns, values, 3 * points)

    def of_pressure(self, points: int) -> Any:
        """(2T, points): ∂p/∂x and ∂p/∂y, node-major."""
        return _node_major(np.hstack([self.near, self.near]), np.hstack([self.dx, self.dy]), points)


def sparse_rows(blocks: list[tuple[np.ndarray, np.ndarray]], shape: tuple[int, int]) -> Any:
    """CSR matrix of stacked blocks of rows, each its columns and its values, (T, k) both.

    The zeros that fill up smaller supports are not stored.
    """
    lengths = np.concatenate([np.full(len(columns), columns.shape[1]) for columns, _ in blocks])
    columns = np.concatenate([columns.ravel() for columns, _ in blocks], dtype=np.int32)
    values = np.concatenate([values.ravel() for _, values in blocks])
    starts = np.concatenate([[0], np.cumsum(lengths)], dtype=np.int32)
    matrix = sp.csr_array((values, columns, starts), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def rows_times(factors: np.ndarray, matrix: Any) -> Any:
    """The CSR matrix with each of its rows times a factor, (rows,)."""
    values = np.repeat(factors, np.diff(matrix.indptr)) * matrix.data
    return sp.csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)


def _in_turn(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The entries (T, k) of the one and the other by turns, (T, 2k)."""
    return np.stack([one, other], axis=2).reshape(len(one), -1)


def _node_major(columns: np.ndarray, values: np.ndarray, sources: int) -> Any:
    """Two rows of each of T nodes, side by side in `columns` and `values` (T, 2k), as rows 2 t and 2 t + 1."""
    rows = 2 * len(columns), columns.shape[1] // 2
    return sparse_rows([(columns.reshape(rows), values.reshape(rows))], (rows[0], sources))
