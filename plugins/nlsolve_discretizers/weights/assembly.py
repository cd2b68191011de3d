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
        u, v = self._columns(2, 0), self._columns(2, 1)
        blocks = [(u, self.dx), (v, self.dy), ([u, v], [0.5 * self.dy, 0.5 * self.dx])]
        return sparse_rows(blocks, (3 * len(self.near), 2 * nodes))

    def divergence(self, nodes: int) -> Any:
        """div v (T, 2 nodes)."""
        block = [self._columns(2, 0), self._columns(2, 1)], [self.dx, self.dy]
        return sparse_rows([block], (len(self.near), 2 * nodes))

    def divergence_of_stress(self, points: int) -> Any:
        """S (2T, 3 points): ∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major."""
        xx, yy, xy = (self._columns(1, component * points) for component in range(3))
        block = [xx, xy, xy, yy], [self.dx, self.dy, self.dx, self.dy]
        return sparse_rows([block], (2 * len(self.near), 3 * points), axis=1)

    def of_pressure(self, points: int) -> Any:
        """(2T, points): ∂p/∂x and ∂p/∂y, node-major."""
        block = [self._columns(1, 0)] * 2, [self.dx, self.dy]
        return sparse_rows([block], (2 * len(self.near), points), axis=1)

    def _columns(self, factor: int, first: int) -> np.ndarray:
        return factor * self.near.astype(np.int32) + np.int32(first)


def sparse_rows(blocks: list[tuple[Any, Any]], shape: tuple[int, int], axis: int = 2) -> Any:
    """CSR matrix of stacked blocks of as many rows each, given by their columns and their values, (T, k) both.

    Blocks may have lists of both, whose entries take turns, or follow each other at each target (`axis` = 1). The zeros
    that fill up smaller supports are not stored.
    """
    parts = [tuple(part if isinstance(part, list) else [part] for part in block) for block in blocks]
    ends = np.cumsum([0] + [len(values) * values[0].size for _, values in parts])
    columns, values = np.empty(ends[-1], np.int32), np.empty(ends[-1])
    for begin, end, (its_columns, its_values) in zip(ends, ends[1:], parts, strict=False):
        form = np.insert(its_values[0].shape, axis, len(its_values))
        np.stack(its_columns, axis, out=columns[begin:end].reshape(form), casting="same_kind")
        np.stack(its_values, axis, out=values[begin:end].reshape(form))
    rows = shape[0] // len(blocks)
    starts = np.zeros(shape[0] + 1, np.int32)
    np.cumsum(np.repeat(np.diff(ends) // rows, rows), out=starts[1:])
    matrix = sp.csr_array((values, columns, starts), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def rows_times(factors: np.ndarray, matrix: Any) -> Any:
    """The CSR matrix with each of its rows times a factor, (rows,)."""
    values = np.repeat(factors, np.diff(matrix.indptr)) * matrix.data
    return sp.csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
