"""Helpers of the checks: a sentence for a broken promise, comparison of arrays, of shapes and of coefficients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve.series import Array

ORDER = 4  # the highest Taylor coefficient that is checked
PARTS = 0.5 ** np.arange(2, 22)  # steps and path lengths tried; at the best, truncation and rounding are small


def require(holds: Any, sentence: str) -> None:
    """Raise AssertionError with this sentence unless the promise holds."""
    if not holds:
        raise AssertionError(sentence)


def norm(value: Any) -> float:
    """‖value‖₂ of all its numbers."""
    return float(np.linalg.norm(np.ravel(value)))


def same(found: Any, expected: Any, scale: float, what: str, tolerance: float = 1e-10) -> None:
    """max |found − expected| ≤ tolerance · scale. Raises AssertionError, which names `what`."""
    off = float(np.max(np.abs(found - expected), initial=0.0))
    require(off <= tolerance * scale, f"{what}: off by {off:.2e}, allowed {tolerance:g} of {scale:.2e}")


def shaped(found: Any, shape: tuple[int, ...], what: str) -> None:
    """Raise AssertionError, which names `what`, unless `found` is an array of this shape."""
    is_of = getattr(found, "shape", None)
    require(is_of == shape, f"{what} of shape {is_of}, not {shape}")


def check_coefficients(f: Callable[[float], Array], coefficients: list[Array], what: str) -> None:
    """f(a) = Σ_j a^j f_j: at some small a the first j + 1 terms must leave less than 2 % of the last one."""
    values = {float(a): f(float(a)) for a in PARTS}
    for j in range(1, len(coefficients)):
        size = norm(coefficients[j]) or norm(coefficients[0])
        left = min(
            norm(y - sum(a**i * coefficients[i] for i in range(j + 1))) / (a**j * size) for a, y in values.items()
        )
        require(left <= 0.02, f"{what}: coefficient {j} misses {left:.1%} of what it should be")
