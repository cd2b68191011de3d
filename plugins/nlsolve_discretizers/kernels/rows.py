"""Σ_p c_p ∂_p f(first_p + s i) : rows of sparse matrices made of derivatives, at the neighbours i of each target.

A row has one term or several, each a multiple c_p of one of the derivatives, in columns of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve_discretizers.kernels.machine_code import compiled

Row = Sequence[tuple[int, int, float]]
"""First column, number of the derivative and factor of each term."""


def sparse_rows(
    near: np.ndarray,
    derivatives: np.ndarray,
    rows: Sequence[Row],
    stride: int,
    columns: int,
    of_target_together: bool = False,
) -> Any:
    """CSR matrix (R T, columns) with R rows for each of T targets, for neighbours (T, k) and derivatives (D, T, k).

    of_target_together : the rows of a target follow each other, and the terms of a row. Else all first rows come before
        all second ones, and terms take turns at each neighbour.

    The zeros that fill up smaller supports are not stored.
    """
    ends = np.cumsum([0, *map(len, rows)])
    terms = np.array([term[:2] for row in rows for term in row])
    factors = np.array([term[2] for row in rows for term in row])
    run = machine_code() or together
    values, places, starts = run(near, derivatives, ends, terms, factors, stride, of_target_together)
    return sp.csr_array((values, places, starts), shape=(len(starts) - 1, columns))


def machine_code() -> Callable[..., Any] | None:
    """`one_by_one`, compiled; None where there is no compiler."""
    return compiled(one_by_one, "i2 f3 i1 i2 f1 i0 b0")


def together(
    near: np.ndarray,
    derivatives: np.ndarray,
    ends: np.ndarray,
    terms: np.ndarray,
    factors: np.ndarray,
    stride: int,
    of_target_together: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, columns and starts of the rows, all targets together; row r has the terms ends[r] to ends[r + 1] − 1."""
    (targets, k), rows = near.shape, len(ends) - 1
    values, places = np.empty(len(terms) * near.size), np.empty(len(terms) * near.size, np.int32)
    scaled = stride * near.astype(np.int32)
    for r in range(rows):
        begin, end = ends[r], ends[r + 1]
        if of_target_together:
            parts = [a.reshape(targets, len(terms), k)[:, begin:end].swapaxes(0, 1) for a in (values, places)]
        else:
            parts = [a[begin * near.size : end * near.size].reshape(targets, k, -1) for a in (values, places)]
            parts = [np.moveaxis(part, 2, 0) for part in parts]
        for p in range(begin, end):
            np.multiply(factors[p], derivatives[terms[p, 1]], out=parts[0][p - begin])
            np.add(scaled, np.int32(terms[p, 0]), out=parts[1][p - begin])
    lengths = k * np.diff(ends)
    lengths = np.tile(lengths, targets) if of_target_together else np.repeat(lengths, targets)
    matrix = sp.csr_array(
        (values, places, np.append(np.int32(0), np.cumsum(lengths, dtype=np.int32))),
        shape=(rows * targets, int(places.max(initial=0)) + 1),
    )
    matrix.eliminate_zeros()
    return matrix.data, matrix.indices, matrix.indptr


def one_by_one(
    near: np.ndarray,
    derivatives: np.ndarray,
    ends: np.ndarray,
    terms: np.ndarray,
    factors: np.ndarray,
    stride: int,
    of_target_together: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`together`, one entry after the other."""
    (targets, k), rows = near.shape, len(ends) - 1
    values, places = np.empty(len(terms) * near.size), np.empty(len(terms) * near.size, np.int32)
    starts = np.zeros(rows * targets + 1, np.int32)
    entry = line = 0
    for first in range(targets if of_target_together else rows):
        for second in range(rows if of_target_together else targets):
            t, r = (first, second) if of_target_together else (second, first)
            begin, end = ends[r], ends[r + 1]
            for a in range(end - begin if of_target_together else k):
                for b in range(k if of_target_together else end - begin):
                    n, p = (b, begin + a) if of_target_together else (a, begin + b)
                    value = factors[p] * derivatives[terms[p, 1], t, n]
                    if value != 0.0:
                        values[entry], places[entry] = value, stride * near[t, n] + terms[p, 0]
                        entry += 1
            line += 1
            starts[line] = entry
    return values[:entry], places[:entry], starts
