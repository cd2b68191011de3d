"""p ← p − λ div v : the pressure of an incompressible flow iterated from one solve with a penalty to the next.

Each iterate is a solution with the penalty λ alone and the pressure so far as a force (augmented Lagrangian: Powell
1969, Hestenes 1969; for viscous flow Fortin & Glowinski 1983). The map contracts like μ/λ, but slowly for pressures
that the velocities hardly feel; mixing the last few iterates (Anderson 1965) deals with those.
"""

from __future__ import annotations

from nlsolve.solving.anderson_mixing import Mixing

DEPTH = 8  # changes mixed


def pressure_mixing() -> Mixing:
    """Of one increment: undamped, over the last `DEPTH` changes."""
    return Mixing(DEPTH, 1.0)
