"""The selection of runs for a table or a figure: `where = { "solver.kind" = ["newton", "anm"] }`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, WithJsonSchema

Scalar = bool | int | float | str
"""What a study can ask a column for."""

Names = Annotated[
    tuple[str, ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]
"""One or several columns; a study may write a single name without brackets."""

Where = dict[str, Scalar | list[Scalar]]
"""Column of `runs` -> the value, or one of the values, that a run must have in it."""

CLOSE = 1e-9
"""Relative difference up to which two numbers are the same."""


def same(a: Any, b: Any) -> bool:
    """|a − b| ≤ CLOSE max(|a|, |b|) for numbers, a = b for others: whether two values of a frame are equal.

    Missing values are equal. A number equals a word that spells it: a column that holds numbers in some cases and words
    in others is stored as words.
    """
    if _missing(a) or _missing(b):
        return _missing(a) and _missing(b)
    if isinstance(a, str) == isinstance(b, str):
        numbers = _is_number(a) and _is_number(b)
        return math.isclose(a, b, rel_tol=CLOSE) if numbers else bool(a == b)
    word, other = (a, b) if isinstance(a, str) else (b, a)
    if word == str(other):
        return True
    try:
        return _is_number(other) and math.isclose(float(word), other, rel_tol=CLOSE)
    except ValueError:
        return False


def is_wanted(value: Any, wanted: Scalar | list[Scalar]) -> bool:
    """Whether a value is the one that is wanted, or one of several."""
    return any(same(value, one) for one in (wanted if isinstance(wanted, list) else [wanted]))


def fits(run: Mapping[str, Any], where: Where) -> bool:
    """Whether a run has every value that is asked for."""
    return all(is_wanted(run.get(name), wanted) for name, wanted in where.items())


def _missing(value: Any) -> bool:
    return bool(np.ndim(value) == 0 and pd.isna(value))


def _is_number(value: Any) -> bool:
    return isinstance(value, (bool, int, float, np.number, np.bool_))
