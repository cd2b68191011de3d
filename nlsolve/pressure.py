"""p ← p − λ div v : the pressure of an incompressible flow iterated from one solve with a penalty to the next.

Each iterate is a solution with the penalty λ alone and the pressure so far as a force (augmented Lagrangian: Powell
1969, Hestenes 1969; for viscous flow Fortin & Glowinski 1983). The map contracts like μ/λ, but slowly for pressures
that the velocities hardly feel; mixing the last few iterates (Anderson 1965) deals with those.
"""

from __future__ import annotations

import numpy as np

from nlsolve.series import Array

DEPTH = 8  # iterates mixed
FLATTEST = 1e-10  # singular value of the differences, relative to the largest, below which they say nothing new


class Mixing:
    """Anderson's mixing of a fixed-point map p ← g(p): the combination of past images whose changes cancel best."""

    def __init__(self) -> None:
        self._states: list[Array] = []
        self._images: list[Array] = []

    def next(self, state: Array, image: Array) -> Array:
        """The next iterate, from g(state) = image and the iterates before."""
        self._states = [*self._states[-DEPTH:], state]
        self._images = [*self._images[-DEPTH:], image]
        images = np.array(self._images)
        changes = images - np.array(self._states)
        if len(changes) == 1:
            return image
        part, *_ = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=FLATTEST)
        return image - np.diff(images, axis=0).T @ part
