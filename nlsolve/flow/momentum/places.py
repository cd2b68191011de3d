"""Where the law of a flow fails, and where its balance is farthest from zero: places of strain points (M, 2) [mm]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.law import ConstitutiveLaw, rate_squared
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, NoSeriesHere

WAY_OUT = "give it a regularization ε₀ > 0, or begin from a state that is deformed everywhere (start.values)"


def undefined(law: ConstitutiveLaw, points: Array, strain_rate: Array) -> str:
    """The first point where the viscosity at the strain rates (3, M) is not finite, and how many there are."""
    squared = rate_squared(strain_rate)
    where = ~np.isfinite(law.viscosity(squared))
    if not (where & np.isfinite(squared)).any():
        return ""
    return f"the law {law.called()!r} has no finite viscosity at {_spot(points, squared, where)}; {WAY_OUT}"


def without_series(law: ConstitutiveLaw, points: Array, strain_rate: Array, refusal: NoSeriesHere) -> SolveError:
    """The error of a law whose formula has refused to give the series, with a point where it does not."""
    squared = rate_squared(strain_rate)
    where = squared == 0.0
    if not where.any() and refusal.entry and refusal.entry[-1] < len(squared):
        where[refusal.entry[-1]] = True
    spot = f" at {_spot(points, squared, where)}" if where.any() else ""
    return SolveError(
        Status.NON_FINITE,
        f"the law {law.called()!r} has no series{spot}: {refusal}; {WAY_OUT}, or choose a method that "
        "needs no series, such as newton",
    )


def _spot(points: Array, squared: Array, where: Any) -> str:
    """The first of the points that are marked, its strain rate by ε̄² (M,), and their number."""
    (x, y), rate = points[where][0], np.sqrt(squared[where][0])
    return f"({x:.3g}, {y:.3g}), where ε̄ = {rate:.2g} 1/s ({where.sum()} of {len(where)} strain points)"


def blame(
    cloud: Cloud, law: ConstitutiveLaw, points: Array, strain_rate: Array, residual: Array
) -> Mapping[str, float]:
    """The node where ‖R‖ is largest, the strain rate at the point nearest to it, and the share of the points where
    ε̄ < ε₀, where the regularization sets the viscosity. Of nodes where R (2F,) is not finite, the one where that strain
    rate is least.
    """
    forces = np.nan_to_num(np.linalg.norm(residual.reshape(-1, 2), axis=1), nan=np.inf)
    largest = cloud.interior[np.flatnonzero(forces == forces.max())]
    rate = np.sqrt(rate_squared(strain_rate))
    beside = scipy.spatial.cKDTree(points).query(cloud.nodes[largest])[1]
    node, nearest = min(zip(largest, beside, strict=True), key=lambda pair: float(rate[pair[1]]))
    floor = law.regularization_rate or 0.0
    return {
        "blame_x": float(cloud.nodes[node, 0]),
        "blame_y": float(cloud.nodes[node, 1]),
        "blame_rate": float(rate[nearest]),
        "blame_regularized": float(np.mean(rate < floor)),
    }
