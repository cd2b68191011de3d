"""J from J S : columns of a sparse Jacobian that share no row are computed as one (Curtis, Powell & Reid 1974)."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.series import Array, Indices


class Colouring:
    """The columns of a (U, U) pattern in C groups.

    seeds : S, (U, C); S_jc = 1 where column j belongs to group c. Without a pattern each column is a group of its own.
    """

    def __init__(self, pattern: Any | None, size: int) -> None:
        self._places: tuple[Indices, Indices] | None = None
        if pattern is None:
            self.seeds: Array = np.eye(size)
            return
        entries = sp.coo_array(pattern)
        self._places = entries.coords
        groups = groups_of(entries)
        self.seeds = np.zeros((size, groups.max(initial=-1) + 1))
        self.seeds[np.arange(size), groups] = 1.0
        self._columns = groups[entries.coords[1]]

    def unpack(self, product: Array) -> Any:
        """J, sparse (U, U), from J S, (U, C)."""
        if self._places is None:
            return sp.csr_array(product)
        rows, columns = self._places
        return sp.csr_array((product[rows, self._columns], (rows, columns)), shape=(len(product),) * 2)


def groups_of(pattern: Any) -> Indices:
    """The group of each column, (U,); no two of a group share a row. Each gets the first group without a neighbour."""
    entries = sp.csc_array(pattern, dtype=bool).astype(int)
    neighbours = sp.csr_array(entries.T @ entries)
    groups = np.full(entries.shape[1], -1)
    for column in range(len(groups)):
        others = neighbours.indices[neighbours.indptr[column] : neighbours.indptr[column + 1]]
        taken = set(groups[others].tolist())
        groups[column] = next(group for group in range(len(taken) + 1) if group not in taken)
    return groups
