"""Where the entries of the matrices of one pattern are, so that each further one of them is only its values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp


def laid_out(compressed: Any, before: Layout | None) -> tuple[Layout, Any]:
    """The layout of a matrix in compressed rows, that of `before` if it fits, and the matrix with its entries sorted
    and those that share a place added; the given one stays as it is.
    """
    if before is not None and before.fits(compressed):
        return before, before.sorted(compressed)
    layout = Layout.of(compressed)
    if not layout.has_duplicates:
        return layout, layout.sorted(compressed)
    summed = compressed.copy()
    summed.sum_duplicates()
    return Layout.of(summed), summed


@dataclass(frozen=True)
class Layout:
    """The pattern of a sparse matrix in compressed rows.

    given : starts (U + 1,) of the rows and columns (E,) of the entries, in the order in which matrices have them.
    order : (E,), which of these entries comes first, second, … with the columns of each row sorted; None: all are.
    starts, columns : of the sorted entries.
    """

    given: tuple[np.ndarray, np.ndarray]
    order: np.ndarray | None
    starts: np.ndarray
    columns: np.ndarray

    @classmethod
    def of(cls, matrix: Any) -> Layout:
        """The pattern of a matrix in compressed rows; its own arrays may change later."""
        given = matrix.indptr.copy(), matrix.indices.copy()
        if matrix.has_sorted_indices:
            return cls(given, None, *given)
        numbered = sp.csr_array((np.arange(matrix.nnz), matrix.indices.copy(), matrix.indptr), shape=matrix.shape)
        numbered.sort_indices()
        return cls(given, numbered.data, numbered.indptr, numbered.indices)

    @property
    def entries(self) -> int:
        """E, the number of entries."""
        return len(self.columns)

    @property
    def has_duplicates(self) -> bool:
        """Whether a place is stored twice."""
        within_row = np.ones(len(self.columns), dtype=bool)
        within_row[self.starts[:-1][np.diff(self.starts) > 0]] = False
        return bool((within_row[1:] & (np.diff(self.columns) == 0)).any())

    def fits(self, matrix: Any) -> bool:
        """Whether a matrix in compressed rows has the same entries in the same order."""
        starts, columns = self.given
        return np.array_equal(starts, matrix.indptr) and np.array_equal(columns, matrix.indices)

    def sorted(self, matrix: Any) -> Any:
        """A matrix that fits, with its entries sorted; values are shared where they are so already."""
        values = matrix.data if self.order is None else matrix.data[self.order]
        return sp.csr_array((values, self.columns, self.starts), shape=matrix.shape)

    @cached_property
    def upper(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the entries on and above the diagonal: numbers among the sorted ones, columns, and starts of rows."""
        rows = np.repeat(np.arange(len(self.starts) - 1, dtype=self.columns.dtype), np.diff(self.starts))
        numbers = np.flatnonzero(self.columns >= rows)
        return numbers, self.columns[numbers], np.searchsorted(numbers, self.starts).astype(self.starts.dtype)

    def upper_of(self, matrix: Any) -> Any:
        """The entries on and above the diagonal of a sorted matrix of this pattern."""
        numbers, columns, starts = self.upper
        return sp.csr_array((matrix.data[numbers], columns, starts), shape=matrix.shape)
