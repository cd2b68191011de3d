"""The balance of moments on discs of the flow, control volumes that no discretizer knows.

    ∮ a² S_rθ dθ + ∫_{r<a} x × f dA = 0      x from the centre of a disc; S the stresses, f all other forces

A pressure has no moment about the centre of a disc, so that only the stresses of the law are needed. The mean over the
radii a from R/2 to R is an integral over a ring, in which the stresses of single points matter little:

    M = (2/R) ∫_{R/2<r<R} r S_rθ dA + ∫_{r<R} φ x × f dA = 0      φ = min(1, 2 − 2 r/R)

D discs, P points in each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.flow.claims.finding import NOTHING, Finding
from nlsolve.series import Array

COUNT = 64
"""The largest number of discs."""

WIDEST, NARROWEST = 6.0, 2.5
"""Radii of discs in spacings. Wider discs hardly answer to what is wrong in one place; narrower ones have few nodes."""

FROM_WALLS = 0.8
"""Radii of discs in distances to the walls: where stresses fall as 1/r² from a tool in a wide flow, a disc that reaches
the tool would need far more angles.
"""

APART = 0.75
"""Centres of discs keep out of this share of the radius of others."""

ANGLES = 20
ABSCISSAE, WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class Discs:
    """Discs that hold no node of a wall: `centres` (D, 2) and `radii` (D,) [mm]."""

    centres: Array
    radii: Array

    @classmethod
    def within(cls, cloud: Cloud) -> Discs:
        """The largest discs around inner nodes first, each centre outside of those before it."""
        spacing = cloud.spacing[cloud.interior]
        nodes = cloud.nodes[cloud.interior]
        to_walls = scipy.spatial.cKDTree(cloud.nodes[cloud.boundary]).query(nodes)[0]
        radii = np.minimum(FROM_WALLS * to_walls, WIDEST * spacing)
        radii[radii < NARROWEST * spacing] = 0.0
        chosen: list[tuple[float, float, float]] = []
        while len(chosen) < COUNT and radii.max(initial=0.0) > 0.0:
            largest = int(radii.argmax())
            chosen.append((*nodes[largest], radii[largest]))
            radii[np.linalg.norm(nodes - nodes[largest], axis=1) <= APART * radii[largest]] = 0.0
        x, y, widths = np.array(chosen).reshape(-1, 3).T
        return cls(np.stack([x, y], axis=1), widths)

    def ring(self, inner: float, outer: float) -> Ring:
        """The points with inner < r/R < outer, at three radii of Gauss and `ANGLES` angles."""
        half = 0.5 * (outer - inner)
        radii = 0.5 * (outer + inner) + half * ABSCISSAE
        turn = 2.0 * np.pi / ANGLES
        share, angle = np.repeat(radii, ANGLES), np.tile(turn * np.arange(ANGLES), len(radii))
        offsets = share[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        areas = np.outer(self.radii**2, share * np.repeat(half * WEIGHTS, ANGLES) * turn)
        return Ring(self.centres[:, None] + self.radii[:, None, None] * offsets, share, angle, areas)


@dataclass(frozen=True)
class Ring:
    """Points for integrals over one ring of each disc.

    points : (D, P, 2) [mm].
    share, angle : r/R and θ of the points of any disc, (P,).
    areas : the area of each point, (D, P) [mm²].
    """

    points: Array
    share: Array
    angle: Array
    areas: Array

    def stress(self, stress: Callable[[Array], Array]) -> tuple[Array, Array]:
        """S_rθ and |S| = √(½ S:S), (D, P)."""
        xx, yy, xy = stress(self.points.reshape(-1, 2)).reshape(3, *self.areas.shape)
        size = np.sqrt(0.5 * (xx**2 + yy**2) + xy**2)
        return 0.5 * (yy - xx) * np.sin(2.0 * self.angle) + xy * np.cos(2.0 * self.angle), size

    def across(self, force: Callable[[Array], Array]) -> Array:
        """f_θ, (D, P)."""
        x, y = np.moveaxis(force(self.points.reshape(-1, 2)).reshape(self.points.shape), -1, 0)
        across: Array = y * np.cos(self.angle) - x * np.sin(self.angle)
        return across


def largest_moment(cloud: Cloud, stress: Callable[[Array], Array], force: Callable[[Array], Array] | None) -> Finding:
    """The largest |M| over the larger of N and its mean over all discs; N is the moment with |S| in place of S_rθ.

    stress : S (3, T) ordered xx, yy, xy at points (T, 2).
    force : f (T, 2) there; None: none.
    NaN where the walls leave no room for a disc.
    """
    discs = Discs.within(cloud)
    if not len(discs.radii):
        return NOTHING
    outer = discs.ring(0.5, 1.0)
    shear, size = outer.stress(stress)
    moments = 2.0 * (outer.areas * shear) @ outer.share
    whole = 2.0 * (outer.areas * size) @ outer.share
    if force is not None:
        for ring in (discs.ring(0.0, 0.5), outer):
            carried = np.minimum(1.0, 2.0 - 2.0 * ring.share)
            moments = moments + discs.radii * ((ring.areas * ring.across(force)) @ (carried * ring.share))
    ratios = np.abs(moments) / np.maximum(np.maximum(whole, whole.mean()), np.finfo(float).tiny)
    worst = int(ratios.argmax())
    x, y = discs.centres[worst]
    return Finding(
        float(ratios[worst]),
        f"on the disc of radius {discs.radii[worst]:.3g} mm around ({x:.3g}, {y:.3g}) the moments are out of balance "
        f"by {ratios[worst]:.0%} of what the stresses have: choose a finer or evener spacing, or check the discretizer",
    )
