"""d₁ ≤ d₂ ≤ … : the listed sources of each target by distance, from an order that a motion has changed a little."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled


def ranked(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The sources of each target by distance, and the distances (T, K) [mm], for `sources` (S, 2) and `targets` (T, 2).

    index, rows : the lists of before (T′, K), and whose of them each target has, (T,).
    numbers : the number now of each source of the lists, −1 for one that is no more, at an infinite distance.
    """
    return (machine_code() or by_sorting)(sources, targets, index, rows, numbers)


def machine_code() -> Callable[..., Any] | None:
    """`by_insertion`, compiled; None where there is no compiler."""
    return compiled(by_insertion, "f2 f2 i2 i1 i1")


def by_sorting(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`ranked`, all targets together."""
    index = numbers[index[rows]]
    (x, y), (u, v) = np.ascontiguousarray(sources.T), targets.T[..., None]
    squared = (x[index] - u) ** 2 + (y[index] - v) ** 2
    squared[index < 0] = np.inf
    order, row = np.argsort(squared, axis=1), np.arange(len(targets))[:, None]
    return index[row, order], np.sqrt(squared[row, order])


def by_insertion(
    sources: np.ndarray, targets: np.ndarray, index: np.ndarray, rows: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`ranked`, one target after the other: each source moves up past those that are farther."""
    now, squared = np.empty((len(rows), index.shape[1]), np.intp), np.empty((len(rows), index.shape[1]))
    for t in range(len(targets)):
        for k in range(index.shape[1]):
            s, far = numbers[index[rows[t], k]], np.inf
            if s >= 0:
                far = (sources[s, 0] - targets[t, 0]) ** 2 + (sources[s, 1] - targets[t, 1]) ** 2
            place = k
            while place and squared[t, place - 1] > far:
                now[t, place], squared[t, place] = now[t, place - 1], squared[t, place - 1]
                place -= 1
            now[t, place], squared[t, place] = s, far
    return now, np.sqrt(squared)
