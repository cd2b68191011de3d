"""Why a formula has no Taylor coefficients, at all or at the values it is run at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
INFINITE, UNREAL, STEEP = "it is infinite there", "it has no real value there", "its slope is infinite there"

WAY_OUT = (
    "write the formula with +, -, *, /, powers, the elementary functions of numpy (exp, log, sqrt, sin, atan2, sinh, "
    "…), np.sum, np.stack and matrices from the left"
)


class NoSeries(TypeError):
    """A formula that has no Taylor coefficients, or is not written so that a `Series` can find them."""


class NoSeriesHere(NoSeries):
    """A formula that has Taylor coefficients, but not at the values it is run at.

    entry : index of the first such value in the array of values.
    """

    def __init__(self, name: str, values: Array, where: Mask, why: str) -> None:
        self.entry = tuple(int(i) for i in np.argwhere(where)[0])
        place = f" (entry {', '.join(map(str, self.entry))})" if values.size > 1 else ""
        super().__init__(f"{name} has no power series at x = {values[self.entry]:g}{place}: {why}")


def not_analytic(name: str) -> NoSeries:
    return NoSeries(
        f"absolute value, comparison and choice by condition (here {name}) are not analytic, so they have no Taylor "
        f"coefficients: {WAY_OUT}"
    )


def unknown(name: str) -> NoSeries:
    return NoSeries(f"a series has no rule for {name}: {WAY_OUT}")
