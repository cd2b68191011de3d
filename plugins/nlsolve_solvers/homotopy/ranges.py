"""a_max, how far along its path an approximant of W(a) can be trusted, by one of five rules; a_max ≥ 1: to the end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlsolve_solvers.homotopy.branch import Branch
from nlsolve_solvers.homotopy.extrapolations import least_squares_pade

TRIALS = 6  # residuals spent on finding the end of a range
HALVINGS = 30  # of a range in coordinates, where they cost next to nothing

Rule = Callable[[Branch, float, bool], float]
"""a_max of a branch with tolerance η. The last argument says whether a range below 1 will be used: where it will not be
(a series still growing), a rule may answer with anything below 1."""


def ratio(branch: Branch, tolerance: float, used: bool) -> float:
    """a_max = min over j = p − 1, p of (η ‖W_1‖/‖W_j‖)^(1/(j−1)): the last terms are small beside the first.

    The 2015 paper takes j = p alone; W_2 vanishes when K* is the tangent at W = 0, hence the larger of two terms.
    """
    sizes = branch.sizes
    last = [j for j in (branch.order - 1, branch.order) if j > 1 and sizes[j - 1] > 0.0]
    return min(((tolerance * sizes[0] / sizes[j - 1]) ** (1.0 / (j - 1)) for j in last), default=np.inf)


def residual_coefficient(branch: Branch, tolerance: float, used: bool) -> float:
    """a_max = (η ‖r_1‖/‖r_{p+1}‖)^(1/(p+1)): the first coefficient that W_1 … W_p leave in the homotopy, r_{p+1}.

    One more order of the residual, and no solve; on a linear problem it is the true residual of the series.
    """
    return _growing(
        tolerance * branch.residual, float(np.linalg.norm(branch.recurrence.right_hand_side())), branch.order
    )


def true_residual(branch: Branch, tolerance: float, used: bool) -> float:
    """The a up to which W(a) misses its path by no more than η ‖G(0)‖: at a = 1, ‖G(W(1))‖ ≤ η ‖G(0)‖.

    The miss grows like a^(p+1), which gives the next a to try; every trial is one residual, the last one not checked.
    """
    allowed, a = tolerance * branch.residual, 1.0
    for _ in range(TRIALS if used else 1):
        estimate = a * _growing(allowed, branch.defect(a), branch.order)
        if estimate >= a:
            return estimate if a == 1.0 else a
        a = 0.9 * estimate if estimate > 0.0 else 0.5 * a  # 0 or NaN: G is not finite there
    return a


def pade_pair(branch: Branch, tolerance: float, used: bool) -> float:
    """The a up to which the approximants of orders p and p − 1 differ by no more than η ‖W(a)‖.

    Cochelin, Damil, Potier-Ferry (1994); with the series in place of a Padé the last term beside the sum.
    """
    now, before = branch.extrapolation(), branch.extrapolation(branch.order - 1)

    def excess(a: float) -> float:
        value = branch.columns[:, : now.degree] @ now.weights(a)
        change = value - branch.columns[:, : before.degree] @ before.weights(a)
        return float(np.linalg.norm(change)) / (tolerance * float(np.linalg.norm(value)))

    at_end = excess(1.0)
    if at_end <= 1.0 or not used:
        return _growing(1.0, at_end, branch.order - 1)
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) <= 1.0 else (low, middle)
    return low


def nearest_pole(branch: Branch, tolerance: float, used: bool) -> float:
    """a_max = η^(1/p) ρ with ρ the nearest pole of a Padé of the series, real or not: behind it a^j W_j grows."""
    poles = least_squares_pade(branch.columns).poles()
    return tolerance ** (1.0 / branch.order) * float(np.abs(poles[0])) if len(poles) else np.inf


def _growing(allowed: float, error: float, power: int) -> float:
    """(allowed/error)^(1/(power + 1)): where an error, known at a = 1, that grows like a^(power + 1) is as allowed."""
    return (allowed / error) ** (1.0 / (power + 1)) if error != 0.0 else np.inf


RULES: dict[str, Rule] = {
    "ratio": ratio,
    "residual-coefficient": residual_coefficient,
    "true-residual": true_residual,
    "pade-pair": pade_pair,
    "nearest-pole": nearest_pole,
}
