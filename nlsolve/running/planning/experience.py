"""How long cases will take, from those of the same study that have been run in the folder.

log(t/t_p) = c + Σ_q a_q(value of q) + Σ_q b_q log|value of q| over the swept parameters q, fitted to the seconds t of
the known cases by least squares with the penalty λ Σ (a² + b²). t_p is what the forecast from unit costs says, c the
median. A value that no known case has counts by the slope b_q alone.

The level is then moved towards the one at which the known cases, each told from the others, have the sum that they
have: a study is planned by its sum, which a few long cases make, and not by its median. Of n known cases this counts
by the exponent n/(n + FEW).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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

FEW = 10
"""Number of known cases whose sum is believed by half."""

MOST_VALUES = 40
"""Number of values of a parameter up to which each has an effect of its own."""

MOST_KNOWN = 1000
"""Number of known cases that are looked at."""

FEWEST_TO_HALVE, HALVINGS = 6, 40
"""Number of known cases from which on half of them, so many times, tell how far the forecast of a sum is off."""

CONFIDENCE = 1.64
"""Standard deviations on either side of the interval of a sum, which is to hold it with a probability of 0.9."""


@dataclass(frozen=True)
class Expectation:
    """What is expected of the cases of a study.

    seconds : case -> seconds from its start until it is written [s]; NaN where neither known cases nor the forecast
        tell.
    spread : standard deviation of log t of a known case about what the others tell of it; NaN where too few are known.
    factor : by which the sum over several cases may be more or less; NaN where too few are known.
    """

    seconds: Mapping[str, float]
    spread: float = math.nan
    factor: float = math.nan


def expectation(cases: Sequence[Case], forecast: Mapping[str, float], known: Mapping[str, float]) -> Expectation:
    """What is expected of cases.

    cases : all cases of a study.
    forecast : case -> seconds of its work from unit costs [s]; NaN where they could not be measured.
    known : case -> seconds that it took, of those that have been run [s].

    The factor is that of the known cases: half of them, drawn HALVINGS times, forecast the sum of the others.
    """
    prior = {case.id: forecast.get(case.id, math.nan) + OVERHEAD for case in cases}
    if not known:
        return Expectation(prior)
    if not all(map(math.isfinite, prior.values())):
        prior = dict.fromkeys(prior, 1.0)
    chosen = [case for case in cases if case.id in known]
    chosen = chosen[:: -(-len(chosen) // MOST_KNOWN)]
    fit = _Fit(chosen, prior, known)
    fitted = dict(zip([case.id for case in cases], fit.seconds(cases).tolist(), strict=True))
    return Expectation({**fitted, **known}, fit.spread, _factor(chosen, prior, known))


def _factor(cases: Sequence[Case], prior: Mapping[str, float], known: Mapping[str, float]) -> float:
    if len(cases) < FEWEST_TO_HALVE:
        return math.nan
    generator = np.random.default_rng(0)
    off = []
    for _ in range(HALVINGS):
        order = [cases[place] for place in generator.permutation(len(cases))]
        half, others = order[: len(order) // 2], order[len(order) // 2 :]
        forecast = _Fit(half, prior, known).seconds(others).sum()
        off.append(math.log(forecast / sum(max(known[case.id], SHORTEST) for case in others)))
    return math.exp(CONFIDENCE * math.sqrt(np.mean(np.square(off))))


class _Fit:
    """The least squares over known cases.

    spread : see `Expectation`.
    """

    def __init__(self, cases: Sequence[Case], prior: Mapping[str, float], known: Mapping[str, float]) -> None:
        self._features, self._prior = _Features(cases), prior
        self._level, self.spread = 1.0, math.nan
        x = self._features.of(cases)
        taken = np.array([max(known[case.id], SHORTEST) for case in cases])
        log = np.log(taken / self._priors(cases))
        penalties = PENALTY * np.eye(x.shape[1])
        penalties[0, 0] = 0.0
        inverse = np.linalg.inv(x.T @ x + penalties)
        self._effects = inverse @ x.T @ log
        if len(cases) >= FEWEST_LEFT_OUT:
            leverage = np.minimum(np.einsum("ij,jk,ik->i", x, inverse, x), MOST_LEVERAGE)
            missed = (log - x @ self._effects) / (1.0 - leverage)
            level = float(taken.sum() / (taken * np.exp(-missed)).sum())
            self._level = level ** (len(cases) / (len(cases) + FEW))
            self.spread = float(np.std(missed, ddof=1))

    def seconds(self, cases: Sequence[Case]) -> Array:
        """(cases,) what is expected of each [s]."""
        fitted: Array = self._level * self._priors(cases) * np.exp(self._features.of(cases) @ self._effects)
        return fitted

    def _priors(self, cases: Sequence[Case]) -> Array:
        return np.array([self._prior[case.id] for case in cases])


class _Features:
    """The columns of the least squares: 1, then 1 where a case has a value, and centred logarithms of numbers.

    Of k parameters that tell the known cases apart in the same way, such as a solver and its order, each counts by
    1/√k: together they are one.
    """

    def __init__(self, cases: Sequence[Case]) -> None:
        names = dict.fromkeys(name for case in cases for name in case.parameters)
        held = {name: list(dict.fromkeys(str(case.parameters.get(name)) for case in cases)) for name in names}
        told = {
            name: tuple(values.index(str(case.parameters.get(name))) for case in cases)
            for name, values in held.items()
            if len(values) > 1
        }
        alike = Counter(told.values())
        self._weights = {name: 1.0 / math.sqrt(alike[apart]) for name, apart in told.items()}
        self._values = {name: held[name] for name in told if len(held[name]) <= MOST_VALUES}
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
            row += [self._weights[name] * (value == known) for known in values]
        for name, centre in self._centres.items():
            slope = _logarithm(parameters.get(name)) - centre
            row.append(self._weights[name] * slope if math.isfinite(slope) else 0.0)
        return row


def _logarithm(value: Any) -> float:
    """log|value|; NaN for what is no number, and for 0."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and value
    return math.log(abs(value)) if is_number else math.nan
