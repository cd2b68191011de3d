"""Clouds that several tests discretise, and points and polynomials to try weights on."""

from __future__ import annotations

import numpy as np
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve.series import Array

CLOUDS = {
    "rings": StirringTool(nodes=Rings(spacing=0.5)).cloud(PowerLaw()),
    "graded": StirringTool(nodes=GradedRings(first=0.15, growth=0.2, spacing=0.5)).cloud(PowerLaw()),
    "grid": Channel(spacing=0.2).cloud(PowerLaw()),
    "jittered": Channel(spacing=0.2, jitter=0.3, seed=2).cloud(PowerLaw()),
    "scattered": Channel(nodes="scattered", spacing=0.2).cloud(PowerLaw()),
}


def jittered_points(seed: int, side: int = 9) -> Array:
    """A jittered grid over the unit square."""
    shift = np.random.default_rng(seed).uniform(-0.3, 0.3, (side * side, 2)) / (side - 1)
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, side)] * 2), axis=-1).reshape(-1, 2)
    return grid + shift


def power(x: Array, exponents: tuple[int, int], derivative: tuple[int, int]) -> Array:
    """∂^(i+j) of x^a y^b."""
    result = np.ones(len(x))
    for axis in range(2):
        a, i = exponents[axis], derivative[axis]
        factor = float(np.prod([a - l for l in range(i)]))  # noqa: E741
        result = result * (factor * x[:, axis] ** (a - i) if a >= i else 0.0)
    return result
