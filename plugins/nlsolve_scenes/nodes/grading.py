"""Spacings that grow from both walls to the middle, each by the same factor over the one before."""

from __future__ import annotations

import numpy as np


def relative_spacing(depth: np.ndarray, grading: float) -> np.ndarray:
    """h over its mean at the depth 0 ≤ t ≤ ½ from a wall, in widths: proportional to g + 2 (1 − g) t, so g at it."""
    if grading == 1.0:
        return np.ones_like(depth)
    return (grading + 2.0 * (1.0 - grading) * depth) * np.log(1.0 / grading) / (1.0 - grading)


def lines(count: int, grading: float) -> np.ndarray:
    """t in [0, 1], shape (count + 1,), with dt/di = `relative_spacing`/count."""
    s = np.linspace(0.0, 1.0, count + 1)
    if grading == 1.0:
        return s
    near = 0.5 * grading * np.expm1(-2.0 * np.log(grading) * np.minimum(s, 1.0 - s)) / (1.0 - grading)
    return np.where(s <= 0.5, near, 1.0 - near)
