"""∇×(div S(ε̇(V)) + f) = 0 : does an exact velocity V solve its scene? The curl knows no pressure.

V is differenced at steps h of a stencil that is refined: what an exact solution leaves falls as h², until rounding
takes over; what another field leaves stays.
"""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import ConstitutiveLaw, stress
from nlsolve.contracts.continuum.terms import Physics
from nlsolve.series import Array
from nlsolve.testing.kit.toys import ToyLaw
from nlsolve.testing.promises import require

PLACES = 60
"""Interior nodes at which it is evaluated, at most."""

REFINED = 0.5 ** np.arange(3, 10)
"""Steps over the distance of the nearest node."""

LEFT = 0.05
"""Largest part of the terms of the curl that may be left at a place, at its best step."""

MOST = 0.75
"""The part of the places where no more may be left: where next to nothing is strained, differences are rounding."""


def check_exact(scene: Geometry, law: ConstitutiveLaw, cloud: Cloud) -> None:
    """What the exact velocity leaves in the curl falls below `LEFT` of its terms. Raises AssertionError, with the
    values under refinement. Of a law that tends to a power law that one is taken, for which closed solutions hold.
    """
    form = law.power_form()
    pure = law if form is None else ToyLaw(consistency=form.consistency, index=form.index)
    nodes = cloud.interior[:: max(1, len(cloud.interior) // PLACES)]
    with np.errstate(all="ignore"):
        extent = float(np.ptp(cloud.nodes, axis=0).max())
        places, nearest = cloud.nodes[nodes], cloud.nearest_distance[nodes]
        left = [_left(scene, pure, places, part * nearest, extent) for part in REFINED]
    told = ", ".join(f"{np.nanquantile(values, MOST):.2g}" for values in left)
    require(
        np.nanquantile(np.fmin.reduce(left), MOST) <= LEFT,
        f"the exact velocity of {scene.called()!r} does not solve the scene: of the terms of ∇×(div S + f) it leaves "
        f"{told} at steps that are halved, and an exact solution leaves a quarter each time",
    )


def _left(scene: Geometry, law: ConstitutiveLaw, points: Array, step: Array, extent: float) -> Array:
    """|∇×(div S + f)| over the size of its terms, (P,), by central differences with a step (P,) at points (P, 2)."""

    def shifted(i: int, j: int) -> Array:
        return points + step[:, None] * np.array([i, j])

    velocities = {
        (i, j): _velocity(scene, law, shifted(i, j)) for i in range(-3, 4) for j in range(-3, 4) if abs(i) + abs(j) <= 3
    }

    def stresses(i: int, j: int) -> Array:
        along_x = (velocities[i + 1, j] - velocities[i - 1, j]) / (2.0 * step[:, None])
        along_y = (velocities[i, j + 1] - velocities[i, j - 1]) / (2.0 * step[:, None])
        return stress(law, np.stack([along_x[:, 0], along_y[:, 1], 0.5 * (along_y[:, 0] + along_x[:, 1])]))

    s = {(i, j): stresses(i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) <= 2}
    centre = s[0, 0]
    xx = (s[1, 0] - 2.0 * centre + s[-1, 0]) / step**2
    yy = (s[0, 1] - 2.0 * centre + s[0, -1]) / step**2
    xy = (s[1, 1] - s[1, -1] - s[-1, 1] + s[-1, -1]) / (4.0 * step**2)
    terms = [xx[2], xy[1], -xy[0], -yy[2]]  # ∂x(∂x S_xy + ∂y S_yy) − ∂y(∂x S_xx + ∂y S_xy)
    forces = {way: scene.body_force(shifted(*way), law, Physics()) for way in ((1, 0), (-1, 0), (0, 1), (0, -1))}
    if all(force is not None for force in forces.values()):
        f = {way: np.asarray(force) for way, force in forces.items()}
        terms += [(f[1, 0] - f[-1, 0])[:, 1] / (2.0 * step), -(f[0, 1] - f[0, -1])[:, 0] / (2.0 * step)]
    size = np.sum(np.abs(terms), axis=0) + np.abs(centre).max(axis=0) / extent**2  # which a uniform ∇S leaves
    return np.abs(np.sum(terms, axis=0)) / size


def _velocity(scene: Geometry, law: ConstitutiveLaw, points: Array) -> Array:
    exact = scene.exact(law, points, 0.0)
    if exact is None:
        raise AssertionError("exact gives a solution at the nodes, and none at the points between them")
    return exact.velocity
