"""x_s − x_t in each closed quadrant : whether the neighbours of a target lie all around it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled
from nlsolve_discretizers.kernels.offsets import offsets

ALL_FOUR = 15


def surrounded(sources: np.ndarray, targets: np.ndarray, index: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Whether the first counts[t] of the sources `index` (T, k) serve every quadrant around each target, (T,)."""
    return (machine_code() or together)(sources, targets, index, counts)


def machine_code() -> Callable[..., Any] | None:
    """`one_by_one`, compiled; None where there is no compiler."""
    return compiled(one_by_one, "f2 f2 i2 i1")


def quadrants(offsets: np.ndarray) -> list[np.ndarray]:
    """Which of the offsets (2, …) lie in each closed quadrant, (…) each."""
    (right, above), (left, below) = offsets >= 0, offsets <= 0
    return [right & above, left & above, left & below, right & below]


def together(sources: np.ndarray, targets: np.ndarray, index: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """`surrounded`, all targets together."""
    apart = offsets(sources, targets, index)
    served = np.zeros((4, len(index)), dtype=bool)
    for k in range(index.shape[1]):  # row by row, which stays in the cache
        for number, inside in enumerate(quadrants(apart[:, k])):
            served[number] |= inside & (k < counts)
    return np.logical_and.reduce(served)


def one_by_one(sources: np.ndarray, targets: np.ndarray, index: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """`surrounded`, one target after the other: each neighbour serves one quadrant, two, or all four."""
    around = np.empty(len(index), np.bool_)
    for t in range(len(index)):
        served = 0
        for k in range(counts[t]):
            x, y = sources[index[t, k], 0] - targets[t, 0], sources[index[t, k], 1] - targets[t, 1]
            right, above, left, below = x >= 0.0, y >= 0.0, x <= 0.0, y <= 0.0
            served |= (right & above) | (left & above) << 1 | (left & below) << 2 | (right & below) << 3
        around[t] = served == ALL_FOUR
    return around
