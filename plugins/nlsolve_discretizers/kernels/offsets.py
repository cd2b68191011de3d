"""x_s − x_t and its length : where the sources lie around each target, the same lines for numpy and machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled, each


def offsets(sources: np.ndarray, targets: np.ndarray, index: np.ndarray) -> np.ndarray:
    """x_s − x_t, (2, k, T) [mm], for the sources `index` (T, k) of each target."""
    return (machine_code() or together)(sources, targets, index.T)


def over_radius(sources: np.ndarray, targets: np.ndarray, index: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """`offsets` over the `radius` (T,) [mm] of each target, and their lengths, (3, k, T)."""
    return (code_over_radius() or scaled)(offsets(sources, targets, index), radius)


def machine_code() -> Callable[..., Any] | None:
    """`together`, compiled; None where there is no compiler."""
    code_over_radius()
    return compiled(together, "f2 f2 i2")


def code_over_radius() -> Callable[..., Any] | None:
    """`scaled`, compiled; None where there is no compiler."""
    return compiled(scaled, "f3c f1c")


def together(sources: np.ndarray, targets: np.ndarray, near: np.ndarray) -> np.ndarray:
    """`offsets` for the sources `near` (k, T)."""
    apart = np.empty((2, *near.shape))
    for axis in range(2):
        x, origin = np.ascontiguousarray(sources[:, axis]), np.ascontiguousarray(targets[:, axis])
        for k in each(0, near.shape[0]):
            for t in each(0, near.shape[1]):
                apart[axis, k, t] = x[near[k, t]] - origin[t]
    return apart


def scaled(apart: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """`over_radius` for `offsets` (2, k, T)."""
    found = np.empty((3, *apart.shape[1:]))
    for k in each(0, apart.shape[1]):
        for t in each(0, apart.shape[2]):
            found[0, k, t] = apart[0, k, t] / radius[t]
            found[1, k, t] = apart[1, k, t] / radius[t]
            found[2, k, t] = np.sqrt(found[0, k, t] * found[0, k, t] + found[1, k, t] * found[1, k, t])
    return found
