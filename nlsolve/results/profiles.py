"""The share of problems that a strategy solves within a cost, and how certain it is. A failure costs ∞."""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.stats, which takes long, when it is first asked for

from nlsolve.series import Array


def ratios(costs: Array) -> Array:
    """r_sp = t_sp/min_s t_sp, shape (S, P): cost of strategy s over the least for problem p; ∞ where t_sp is.

    Dolan & Moré (2002), whose performance profile is the share of problems with r_sp ≤ τ. Costs are positive.
    """
    if not (costs > 0.0).all():
        raise ValueError("costs should be positive, and ∞ where a strategy failed")
    return np.divide(costs, costs.min(axis=0), out=np.full(costs.shape, np.inf), where=np.isfinite(costs))


def within(costs: Array, limits: Array) -> Array:
    """|{p : t_sp ≤ limit}|/P, shape (S, T), of costs (S, P) and finite limits (T,).

    Of costs themselves a data profile (Moré & Wild 2009), of their `ratios` a performance profile.
    """
    return (costs[:, :, None] <= limits).mean(axis=1)


def band(costs: Array, limits: Array, interval: float, samples: int, seed: int) -> tuple[Array, Array]:
    """Ends (S, T) of the interval that holds this part of the shares when the P problems are drawn anew, P at a time.

    The percentile bootstrap (Efron 1979) over problems; one seed gives all strategies the same draws.
    """
    if costs.shape[1] == 1:  # a single problem drawn anew is the same problem
        shares = within(costs, limits)
        return shares, shares

    def share(drawn: Array, axis: int) -> Array:
        return np.stack([(drawn <= limit).mean(axis=axis) for limit in limits])

    ends = [
        scipy.stats.bootstrap(
            (row,), share, n_resamples=samples, confidence_level=interval, method="percentile", rng=seed
        ).confidence_interval
        for row in costs
    ]
    return np.array([low for low, _ in ends]), np.array([high for _, high in ends])


def wilson(solved: int, runs: int, interval: float) -> tuple[float, float]:
    """(p + z²/2N ± z √(p (1 − p)/N + z²/4N²))/(1 + z²/N), p = solved/N: interval of the chance of success.

    The score interval (Wilson 1927). A bootstrap is certain of success after five of five; this is not.
    """
    low, high = scipy.stats.binomtest(solved, runs).proportion_ci(interval, method="wilson")
    return float(low), float(high)
