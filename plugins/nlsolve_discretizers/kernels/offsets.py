"""x_s − x_t : where the sources lie around each target, the same lines for numpy and as machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled, each


def offsets(sources: np.ndarray, targets: np.ndarray, index: np.ndarray) -> np.ndarray:
    """x_s − x_t, (2, k, T) [mm], for the sources `index` (T, k) of each target."""
    return (machine_code() or together)(sources, targets, index.T)


def machine_code() -> Callable[..., Any] | None:
    """`together`, compiled; None where there is no compiler."""
    return compiled(together, "f2 f2 i2")


def together(sources: np.ndarray, targets: np.ndarray, near: np.ndarray) -> np.ndarray:
    """`offsets` for the sources `near` (k, T)."""
    apart = np.empty((2, *near.shape))
    for axis in range(2):
        x, origin = np.ascontiguousarray(sources[:, axis]), np.ascontiguousarray(targets[:, axis])
        for k in each(0, near.shape[0]):
            for t in each(0, near.shape[1]):
                apart[axis, k, t] = x[near[k, t]] - origin[t]
    return apart
