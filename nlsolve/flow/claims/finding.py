"""What was found of one claim."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """A value for a column of `runs`, and what it means where it is above the limit of that column.

    value : NaN where nothing can be said.
    sentence : names the place and the values, and the way out.
    """

    value: float
    sentence: str = ""


NOTHING = Finding(float("nan"))
