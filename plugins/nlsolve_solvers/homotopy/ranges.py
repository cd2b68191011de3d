"""a_max, how far along its path an approximant of W(a) can be trusted, by one of six rules; a_max ≥ 1: to the end."""

from __future__ import annotations

from typing import Literal

import numpy as np

from nlsolve.plugin import Range, RangeRule, SeriesBranch, norm
from nlsolve_solvers.homotopy.extrapolations import least_squares_pade

TRIALS = 6  # residuals spent on finding the end of a range
HALVINGS = 30  # of a range in coordinates, where they cost next to nothing


class Ratio(RangeRule):
    """a_max = min over j = p − 1, p of (η ‖W_1‖/‖W_j‖)^(1/(j−1)): the last terms are small beside the first.

    The 2015 paper takes j = p alone; W_2 vanishes when K* is the tangent at W = 0, hence the larger of two terms.
    """

    kind: Literal["ratio"] = "ratio"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by ‖W_j‖/‖W_1‖ ≤ η, j the order with the smaller range."""
        return by_terms(branch, tolerance, (branch.order - 1, branch.order))


class LastTerm(RangeRule):
    """a_max = (η ‖W_1‖/‖W_p‖)^(1/(p−1)): the last term is small beside the first (Timesli et al. 2015, eq. 24).

    One coefficient decides alone: where W_p = 0 the range is infinite, whatever the other terms. At p = 2 that happens
    whenever K* is the tangent at W = 0 (fixed-point form: W_2 = 0), so use p ≥ 3; of an odd or even W each second term
    vanishes. `ratio` looks at two.
    """

    kind: Literal["last-term"] = "last-term"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by ‖W_p‖/‖W_1‖ ≤ η."""
        return by_terms(branch, tolerance, (branch.order,))


class ResidualCoefficient(RangeRule):
    """a_max = (η ‖r_1‖/‖r_{p+1}‖)^(1/(p+1)): the first coefficient that W_1 … W_p leave in the homotopy, r_{p+1}.

    One more order of the residual, and no solve; on a linear problem it is the true residual of the series.
    """

    kind: Literal["residual-coefficient"] = "residual-coefficient"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by ‖r_{p+1}‖/‖r_1‖ ≤ η."""
        left = norm(branch.next_coefficient())
        return Range(_growing(tolerance * branch.residual, left, branch.order), part(left, branch.residual), tolerance)


class TrueResidual(RangeRule):
    """The a up to which W(a) misses its path by no more than η ‖G(0)‖: at a = 1, ‖G(W(1))‖ ≤ η ‖G(0)‖.

    The miss grows like a^(p+1), which gives the next a to try; every trial is one residual, the last one not checked.
    """

    kind: Literal["true-residual"] = "true-residual"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by ‖G(W(1))‖/‖G(0)‖ ≤ η."""
        allowed, a, at_end = tolerance * branch.residual, 1.0, np.nan
        for _ in range(TRIALS if used else 1):
            defect = branch.defect(a)
            at_end = part(defect, branch.residual) if a == 1.0 else at_end
            estimate = a * _growing(allowed, defect, branch.order)
            if estimate >= a:
                return Range(estimate if a == 1.0 else a, at_end, tolerance)
            a = 0.9 * estimate if estimate > 0.0 else 0.5 * a  # 0 or NaN: G is not finite there
        return Range(a, at_end, tolerance)


class PadePair(RangeRule):
    """The a up to which the approximants of orders p and p − 1 differ by no more than η ‖W(a)‖.

    Cochelin, Damil, Potier-Ferry (1994); with the series in place of a Padé the last term beside the sum.
    """

    kind: Literal["pade-pair"] = "pade-pair"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by ‖difference‖/‖W‖ ≤ η at a = 1."""
        now, before = branch.approximant(), branch.approximant(branch.order - 1)

        def excess(a: float) -> float:
            value = now(a)
            return norm(value - before(a)) / (tolerance * norm(value))

        at_end = excess(1.0)
        if at_end <= 1.0 or not used:
            return Range(_growing(1.0, at_end, branch.order - 1), tolerance * at_end, tolerance)
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if excess(middle) <= 1.0 else (low, middle)
        return Range(low, tolerance * at_end, tolerance)


class NearestPole(RangeRule):
    """a_max = η^(1/p) ρ with ρ the nearest pole of a Padé of the series, real or not: behind it a^j W_j grows."""

    kind: Literal["nearest-pole"] = "nearest-pole"

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        """Decided by (1/ρ)^p ≤ η."""
        poles = least_squares_pade(branch.columns).poles()
        nearest = float(np.abs(poles[0])) if len(poles) else np.inf
        return Range(tolerance ** (1.0 / branch.order) * nearest, float(np.power(nearest, -branch.order)), tolerance)


def by_terms(branch: SeriesBranch, tolerance: float, orders: tuple[int, ...]) -> Range:
    """The smallest (η ‖W_1‖/‖W_j‖)^(1/(j−1)) over some orders j > 1; infinite where all these W_j vanish."""
    sizes = branch.sizes
    found = [
        Range((tolerance * sizes[0] / sizes[j - 1]) ** (1.0 / (j - 1)), sizes[j - 1] / sizes[0], tolerance)
        for j in orders
        if j > 1 and sizes[j - 1] > 0.0
    ]
    return min(found, key=lambda one: one.a_max, default=Range(np.inf, 0.0, tolerance))


def part(value: float, of: float) -> float:
    """value/of, and infinite of nothing."""
    return value / of if of else np.inf


def _growing(allowed: float, error: float, power: int) -> float:
    """(allowed/error)^(1/(power + 1)): where an error, known at a = 1, that grows like a^(power + 1) is as allowed."""
    return (allowed / error) ** (1.0 / (power + 1)) if error != 0.0 else np.inf


RANGE_RULES: tuple[type[RangeRule], ...] = (
    Ratio,
    LastTerm,
    ResidualCoefficient,
    TrueResidual,
    PadePair,
    NearestPole,
)
