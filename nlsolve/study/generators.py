"""Swept values written as a rule: `{ logspace = [1e-8, 1e-2, 7] }` in place of a list."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema

FORMS = {
    "linspace": "[first, last, count]: numbers, evenly spaced from the first to the last",
    "logspace": "[first, last, count]: positive numbers, their logarithms evenly spaced from the first to the last",
    "range": "[first, last, step]: first, first + step, …, not beyond the last",
}
"""What the list of each generator holds."""

DIGITS = 12
"""Significant digits that generated numbers are rounded to, so that 0.1 + 2 · 0.1 is written 0.3."""

CLOSE = 1e-9
"""Part of a step by which the last number of a range may be missed."""


def is_generator(name: str, value: Mapping[str, Any]) -> bool:
    """Whether the table `value` of a parameter generates its values. A `range` may also be a field that is swept: it
    generates where it holds numbers only, and where `name` is no section."""
    if len(value) != 1 or "." not in name:
        return False
    (form, inside) = next(iter(value.items()))
    numbers = isinstance(inside, list | tuple) and all(_is_number(number) for number in inside)
    return form in FORMS and (form != "range" or numbers)


def generated(value: Any) -> Any:
    """The values of a generator; anything else unchanged. Raises ValueError for a generator that makes none."""
    if not isinstance(value, Mapping):
        return value
    form, inside = next(iter(value.items()), ("", None))
    if form not in FORMS or len(value) != 1:
        raise ValueError("should be a list of values, or { linspace = … }, { logspace = … } or { range = … }")
    if not (isinstance(inside, list | tuple) and len(inside) == 3 and all(map(_is_number, inside))):
        raise ValueError(f"{form} needs {FORMS[form]}")
    first, last, third = inside
    return _range(first, last, third) if form == "range" else _spaced(form, first, last, third)


def _spaced(form: str, first: float, last: float, count: float) -> list[float]:
    """count numbers from first to last, evenly spaced, or their logarithms are."""
    if not isinstance(count, int) or count < 1:
        raise ValueError(f"{form} needs a count of at least 1, and has {count}")
    parts = [part / max(count - 1, 1) for part in range(count)]
    if form == "linspace":
        return [_rounded(first + (last - first) * part) for part in parts]
    if first <= 0 or last <= 0:
        raise ValueError(f"logspace needs positive numbers, and goes from {first} to {last}")
    low, high = math.log10(first), math.log10(last)
    return [_rounded(10.0 ** (low + (high - low) * part)) for part in parts]


def _range(first: float, last: float, step: float) -> list[float]:
    """first + k step for k = 0, 1, …, not beyond last."""
    if step == 0 or (last - first) / step < 0:
        raise ValueError(f"range goes from {first} to {last} by steps of {step}, which never arrive")
    count = math.floor((last - first) / step + CLOSE) + 1
    whole = isinstance(first, int) and isinstance(step, int)
    return [first + k * step if whole else _rounded(first + k * step) for k in range(count)]


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


Values = Annotated[
    list[Any], BeforeValidator(generated), WithJsonSchema({"anyOf": [{"type": "array"}, {"type": "object"}]})
]
"""Values of a swept parameter, listed or generated."""
