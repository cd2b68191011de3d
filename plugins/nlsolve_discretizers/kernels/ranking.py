"""d₁ ≤ … ≤ d_k ≤ d_{k+1} : the nearest sources of each target among those listed, from lists of before a motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled


def ranked(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """The listed sources (T, K), of which the `count` nearest come first, by number, and the distances (2, T) [mm] of
    the last and of the next one, for `sources` (S, 2) and `targets` (T, 2); K > count.

    index, rows : the lists of before (T′, K), and whose of them each target has, (T,).
    numbers : the number now of each source of the lists, −1 for one that is no more, at an infinite distance.
    """
    return (machine_code() or by_sorting)(sources, targets, index, rows, numbers, count)


def machine_code() -> Callable[..., Any] | None:
    """`one_by_one`, compiled; None where there is no compiler."""
    return compiled(one_by_one, "f2 f2 i2 i1 i1 i0", ordered)


def by_sorting(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """`ranked`, all targets together."""
    index = numbers[index[rows]]
    (x, y), (u, v) = np.ascontiguousarray(sources.T), targets.T[..., None]
    squared = (x[index] - u) ** 2 + (y[index] - v) ** 2
    squared[index < 0] = np.inf
    order, row = np.argsort(squared, axis=1), np.arange(len(targets))
    index = index[row[:, None], order]
    index[:, :count].sort(axis=1)
    return index, np.sqrt([squared[row, order[:, k]] for k in (count - 1, count)])


def one_by_one(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """`ranked`, one target after the other: as a rule the nearest sources are those of before."""
    (targets_now, listed), most = (len(rows), index.shape[1]), np.inf
    now, squared, distances = np.empty((targets_now, listed), np.intp), np.empty(listed), np.empty((2, targets_now))
    for t in range(targets_now):
        last, following, before, in_order = 0.0, most, -1, True
        for k in range(listed):
            s, far = numbers[index[rows[t], k]], most
            if s >= 0:
                far = (sources[s, 0] - targets[t, 0]) ** 2 + (sources[s, 1] - targets[t, 1]) ** 2
            now[t, k], squared[k] = s, far
            if k < count:
                in_order &= s > before
                last, before = max(last, far), s
            else:
                following = min(following, far)
        if not last < following:
            ordered(squared, now[t])
            last, following, in_order = squared[count - 1], squared[count], False
        if not in_order:
            ordered(now[t, :count], squared)
        distances[0, t], distances[1, t] = last, following
    return now, np.sqrt(distances)


def ordered(values: np.ndarray, others: np.ndarray) -> None:
    """Put `values` (K,) in order by insertion, and the first K of `others` along with them."""
    for k in range(1, len(values)):
        value, other = values[k], others[k]
        while k and values[k - 1] > value:
            values[k], others[k] = values[k - 1], others[k - 1]
            k -= 1
        values[k], others[k] = value, other
