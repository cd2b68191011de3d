"""How long cases will take, from those of the same study that have been run in the folder.

log(t/t_p) = c + Σ_q a_q(value of q) + Σ_q b_q log|value of q| over the swept parameters q, fitted to the seconds t of
the known cases by least squares with the penalty λ Σ (a² + b²). t_p is what the forecast from unit costs says, c the
median. A value that no known case has counts by the slope b_q alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nlsolve.series import Array
from nlsolve.study.case import Case

OVERHEAD = 0.05
"""Seconds of a case beside its work, where none has been run yet: it is sent to a worker process and written [s]."""

PENALTY = 0.3
"""λ: of the effect of a value that one known case has, 1/(1 + λ) is believed."""

SHORTEST = 1e-3
"""Seconds that a case takes at least in the fit [s]."""

FEWEST_LEFT_OUT, MOST_LEVERAGE = 3, 0.9
"""Number of known cases from which on each is told from the others; and how far a case may decide on itself."""

MOST_VALUES = 40
"""Number of values of a parameter up to which each has an effect of its own."""

MOST_KNOWN = 1000
"""Number of known cases that are looked at."""


def seconds_expected(
    cases: Sequence[Case], forecast: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    """Case -> seconds from its start until it is written [s]; NaN where neither known cases nor the forecast tell.

    cases : all cases of a study.
    forecast : case -> seconds of its work from unit costs [s]; NaN where they could not be measured.
    known : case -> seconds that it took, of those that have been run [s].
    """
    prior = {case.id: forecast.get(case.id, math.nan) + OVERHEAD for case in cases}
    if not known:
        return prior
    if not all(map(math.isfinite, prior.values())):
        prior = dict.fromkeys(prior, 1.0)
    chosen = [case for case in cases if case.id in known]
    chosen = chosen[:: -(-len(chosen) // MOST_KNOWN)]
    features = _Features(chosen)
    x, scale = features.of(chosen), np.array([prior[case.id] for case in chosen])
    taken = np.array([max(known[case.id], SHORTEST) for case in chosen])
    penalties = PENALTY * np.eye(x.shape[1])
    penalties[0, 0] = 0.0
    inverse = np.linalg.inv(x.T @ x + penalties)
    effects = inverse @ x.T @ np.log(taken / scale)
    fitted = {
        case.id: prior[case.id] * math.exp(value)
        for case, value in zip(cases, features.of(cases) @ effects, strict=True)
    }
    level = 1.0
    if len(chosen) >= FEWEST_LEFT_OUT:
        leverage = np.minimum(np.einsum("ij,jk,ik->i", x, inverse, x), MOST_LEVERAGE)
        without = np.log(taken / scale) - (np.log(taken / scale) - x @ effects) / (1.0 - leverage)
        level = float(taken.sum() / (scale * np.exp(without)).sum())
    return {case: known.get(case, level * seconds) for case, seconds in fitted.items()}


class _Features:
    """The columns of the least squares: 1, then 1 where a case has a value, and centred logarithms of numbers."""

    def __init__(self, cases: Sequence[Case]) -> None:
        names = dict.fromkeys(name for case in cases for name in case.parameters)
        held = {name: list(dict.fromkeys(str(case.parameters.get(name)) for case in cases)) for name in names}
        self._values = {name: values for name, values in held.items() if 1 < len(values) <= MOST_VALUES}
        self._centres = {
            name: float(np.mean([_logarithm(case.parameters.get(name)) for case in cases]))
            for name, values in held.items()
            if len(values) > 1 and all(math.isfinite(_logarithm(case.parameters.get(name))) for case in cases)
        }

    def of(self, cases: Sequence[Case]) -> Array:
        """(cases, features)"""
        return np.array([self._row(case.parameters) for case in cases]).reshape(len(cases), -1)

    def _row(self, parameters: Mapping[str, Any]) -> list[float]:
        row = [1.0]
        for name, values in self._values.items():
            value = str(parameters.get(name))
            row += [float(value == known) for known in values]
        for name, centre in self._centres.items():
            slope = _logarithm(parameters.get(name)) - centre
            row.append(slope if math.isfinite(slope) else 0.0)
        return row


def _logarithm(value: Any) -> float:
    """log|value|; NaN for what is no number, and for 0."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and value
    return math.log(abs(value)) if is_number else math.nan
