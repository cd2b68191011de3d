"""Numbers as text: with some digits after the point, with some significant figures, alike within a column."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

FIXED = range(-3, 5)
"""Exponents of ten of the numbers that are written without one."""

Form = Callable[[float], str]
"""Number -> text."""


def exponent_of(value: float, figures: int) -> int:
    """e of value = m 10ᵉ, 1 ≤ |m| < 10, rounded to some figures; 0 for 0."""
    return int(f"{value:.{figures - 1}e}".partition("e")[2])


def significant(value: float, figures: int) -> str:
    """A number to some significant figures: 2 of 0.0124 are 0.012, of 1240 1200, of 1.24e-9 1.2e-09."""
    exponent = exponent_of(value, figures)
    if exponent not in FIXED:
        return f"{value:.{figures - 1}e}"
    decimals = figures - 1 - exponent
    return f"{round(value, decimals):.{max(decimals, 0)}f}"


def alike(values: Iterable[float], figures: int) -> Form:
    """How a column of a paper's table writes its numbers: integers as they are, others to some significant figures,
    all of them with an exponent of ten where one needs it.
    """
    known = [value for value in values if math.isfinite(value)]
    if all(value.is_integer() and abs(value) < 1e9 for value in known):
        return lambda value: f"{value:.0f}"
    if all(exponent_of(value, figures) in FIXED for value in known):
        return lambda value: significant(value, figures) if value else "0"
    return lambda value: f"{value:.{figures - 1}e}" if value else "0"


def plain(value: float) -> str:
    """Integers as they are, others with four digits."""
    return str(int(value)) if value.is_integer() and abs(value) < 1e9 else f"{value:.4g}"
