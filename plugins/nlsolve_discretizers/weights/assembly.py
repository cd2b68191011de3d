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
        return sparse_rows([[(self.near, self.dx)]], shape), sparse_rows([[(self.near, self.dy)]], shape)

    def strain(self, nodes: int) -> Any:
        """B (3T, 2 nodes): xx, yy, xy of ½(∇v + ᵗ∇v)."""
        u, v = 2 * self.near, 2 * self.near + 1
        rows = [[(u, self.dx)], [(v, self.dy)], [(u, 0.5 * self.dy), (v, 0.5 * self.dx)]]
        return sparse_rows(rows, (3 * len(self.near), 2 * nodes))

    def divergence(self, nodes: int) -> Any:
        """div v (T, 2 nodes)."""
        return sparse_rows([[(2 * self.near, self.dx), (2 * self.near + 1, self.dy)]], (len(self.near), 2 * nodes))

    def divergence_of_stress(self, points: int) -> Any:
        """S (2T, 3 points): ∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major."""
        xx, yy, xy = self.near, self.near + points, self.near + 2 * points
        rows = [[(xx, self.dx), (xy, self.dy)], [(xy, self.dx), (yy, self.dy)]]
        return _node_major(sparse_rows(rows, (2 * len(self.near), 3 * points)))

    def of_pressure(self, points: int) -> Any:
        """(2T, points): ∂p/∂x and ∂p/∂y, node-major."""
        return _node_major(sparse_rows([[(self.near, self.dx)], [(self.near, self.dy)]], (2 * len(self.near), points)))


def sparse_rows(blocks: list[list[tuple[np.ndarray, np.ndarray]]], shape: tuple[int, int]) -> Any:
    """CSR matrix of stacked blocks of rows; a block joins (columns, values) pairs, (T, k) each, side by side.

    The zeros that fill up smaller supports are not stored.
    """
    columns = [np.concatenate([pair[0] for pair in block], axis=1) for block in blocks]
    values = [np.concatenate([pair[1] for pair in block], axis=1) for block in blocks]
    lengths = np.concatenate([np.full(len(block), block.shape[1]) for block in columns])
    starts = np.concatenate([[0], np.cumsum(lengths)])
    matrix = sp.csr_array(
        (np.concatenate([v.ravel() for v in values]), np.concatenate([c.ravel() for c in columns]), starts), shape=shape
    )
    matrix.eliminate_zeros()
    return matrix


def _node_major(matrix: Any) -> Any:
    """Rows x_0 … x_F, y_0 … y_F brought into the order x_0, y_0, x_1, …"""
    return matrix[np.arange(matrix.shape[0]).reshape(2, -1).T.ravel()]
