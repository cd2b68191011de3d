"""Lengths in mm, stresses in MPa, densities in t/mm³ : numbers that no material has in these units.

The balance of momentum holds in any consistent units. Density and heat capacity of aluminium, the spacings of `auto`
nodes and the heating are in mm, s, MPa and t.
"""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.flow.claims.finding import Finding

SMALL = 0.1
"""Largest extent of a cloud that is suspected to be given in m: 0.1 mm, or 10 cm [mm or m]."""

STRONGEST = 1e5
"""A flow stress above that of any material, whose shear moduli are below 5e5 MPa [MPa]."""

STRONGEST_SMALL = 2e4
"""The same where the cloud is small as well: above the ideal strength of any metal [MPa]."""

DENSEST = 1e-6
"""Forty times the density of osmium [t/mm³]."""

WAY_OUT = "give lengths in mm (m times 1e3), stresses in MPa (Pa times 1e-6) and densities in t/mm³ (kg/m³ times 1e-12)"


def strange_sizes(law: ConstitutiveLaw, density: float, reference_rate: float, cloud: Cloud) -> Finding:
    """The largest of |2 μ ε̄| at the reference rate [1/s] over the largest stress of a material, and in a small cloud of
    the density [t/mm³] over the largest density.
    """
    extent = float(np.ptp(cloud.nodes, axis=0).max())
    small = extent < SMALL
    stress = 2.0 * abs(float(law.viscosity(np.array([reference_rate**2]))[0])) * reference_rate
    ratios = {
        f"the stress of the law {law.called()!r} is {stress:.3g} MPa at ε̄ = {reference_rate:.3g} 1/s": stress
        / (STRONGEST_SMALL if small else STRONGEST),
        f"the density is {density:.3g} t/mm³": density / DENSEST if small else 0.0,
    }
    strange = " and ".join(told for told, ratio in ratios.items() if ratio > 1.0)
    return Finding(
        max(ratios.values()),
        f"{strange} in a scene of {extent:.3g} mm, as if the numbers were in SI units; heating, default density and "
        f"`auto` nodes are in mm, s, MPa and t: {WAY_OUT}",
    )
