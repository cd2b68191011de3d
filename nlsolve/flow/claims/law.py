"""S:ε̇ ≥ 0 and d(2 μ ε̄)/dε̄ ≥ 0 : what every viscous law claims, at the rates of a solved state."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.law import CONTRACTION, ConstitutiveLaw, rate_squared, stress
from nlsolve.flow.claims.finding import NOTHING, Finding
from nlsolve.series import Array

SAMPLES = 400
"""Rates, between the smallest and the largest of a state, at which the stress is sampled besides those of the state."""


def gained_power(law: ConstitutiveLaw, points: Array, strain_rate: Array) -> Finding:
    """max(0, −min S:ε̇) / max |S:ε̇| over the strain points (M, 2), for their strain rates (3, M)."""
    power = CONTRACTION @ (stress(law, strain_rate) * strain_rate)
    finite = np.isfinite(power)
    largest = float(np.abs(power[finite]).max(initial=0.0))
    if not largest:
        return NOTHING
    negative = finite & (power < 0.0)
    if not negative.any():
        return Finding(0.0)
    worst = int(np.where(negative, power, 0.0).argmin())
    squared = rate_squared(strain_rate[:, worst])
    viscosity = float(law.viscosity(np.array([squared]))[0])
    (x, y), count = points[worst], int(negative.sum())
    return Finding(
        -float(power[worst]) / largest,
        f"the law {law.called()!r} gives off power, S:ε̇ < 0, at {count} of {len(power)} strain points, most at "
        f"({x:.3g}, {y:.3g}), where μ = {viscosity:.3g} MPa s and ε̄ = {np.sqrt(squared):.3g} 1/s: make its viscosity "
        "positive",
    )


def falling_stress(law: ConstitutiveLaw, strain_rate: Array) -> Finding:
    """max over ε̄ of 1 − 2 μ ε̄ / (largest 2 μ ε̄ at a smaller rate), ε̄ between the least and the largest rate of a
    state with strain rates (3, M): 0 for a stress that does not fall while ε̄ grows.
    """
    rate = np.sqrt(rate_squared(strain_rate))
    rate = rate[np.isfinite(rate) & (rate > 0.0)]
    if not len(rate):
        return NOTHING
    rates = np.union1d(rate, np.geomspace(rate.min(), rate.max(), SAMPLES))
    stresses = 2.0 * law.viscosity(rates**2) * rates
    finite = np.isfinite(stresses)
    rates, stresses = rates[finite], stresses[finite]
    if not (stresses > 0.0).any():
        return NOTHING
    highest = np.maximum.accumulate(np.maximum(stresses, 0.0))
    fall = np.where(highest > 0.0, 1.0 - stresses / np.where(highest > 0.0, highest, 1.0), 0.0)
    worst = int(fall.argmax())
    top = int(np.abs(stresses[: worst + 1] - highest[worst]).argmin())
    return Finding(
        float(fall[worst]),
        f"the stress 2 μ ε̄ of the law {law.called()!r} falls from {stresses[top]:.3g} MPa at ε̄ = {rates[top]:.3g} "
        f"1/s to {stresses[worst]:.3g} MPa at {rates[worst]:.3g} 1/s, so that one stress belongs to several rates and "
        "this state is one of many: choose a law whose stress grows",
    )
