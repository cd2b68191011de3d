"""cost(ρ) = slope ρ + rest : which of several straight lines is lowest, and where one lies under another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlsolve.series import Array

Interval = tuple[int, float, float]
"""Position of a line, and from where to where it is the lowest."""


def lower_envelope(slopes: Sequence[float] | Array, rests: Sequence[float] | Array) -> list[Interval]:
    """Which of the lines is lowest for 0 ≤ ρ < ∞, from left to right; of equals the first."""
    a, b = np.asarray(slopes, dtype=float), np.asarray(rests, dtype=float)
    here, low = int(np.lexsort((a, b))[0]), 0.0
    found = list[Interval]()
    while True:
        flatter = np.flatnonzero(a < a[here])
        if not len(flatter):
            return [*found, (here, low, np.inf)]
        crossings = (b[flatter] - b[here]) / (a[here] - a[flatter])
        first = float(crossings.min())
        there = flatter[crossings == first]
        found.append((here, low, first))
        here, low = int(there[a[there].argmin()]), first


def wins(line: int, intervals: Sequence[Interval]) -> str:
    """Where a line is the lowest, "18 … 130", or "never"."""
    found = [f"{text(low)} … {text(high)}" for winner, low, high in intervals if winner == line]
    return found[0] if found else "never"


def at_best(line: int, slopes: Array, rests: Array, intervals: Sequence[Interval]) -> str:
    """Least ratio of a line to the lowest one, and the ρ there, "1.4 at 30"; "1" for a line that is lowest somewhere.

    On an interval the quotient of two lines is monotonic, so it is least at an end.
    """
    found = []
    for winner, low, high in intervals:
        found.append(((slopes[line] * low + rests[line]) / (slopes[winner] * low + rests[winner]), low))
        if high == np.inf:
            limit = slopes[line] / slopes[winner] if slopes[winner] else np.inf
            found.append((float(limit), high))
    factor, place = min(found)
    return "1" if any(winner == line for winner, _, _ in intervals) else f"{factor:.3g} at {text(place)}"


def under(slope: float, rest: float) -> str:
    """Where slope ρ + rest < 0 for ρ > 0: "above 85", "below 12", "always" or "never"."""
    if slope == 0.0:
        return "always" if rest < 0.0 else "never"
    crossing = -rest / slope
    if crossing <= 0.0:
        return "always" if slope < 0.0 else "never"
    return f"{'above' if slope < 0.0 else 'below'} {text(crossing)}"


def text(ratio: float) -> str:
    """A ratio ρ in three digits."""
    return "∞" if ratio == np.inf else f"{ratio:.3g}"
