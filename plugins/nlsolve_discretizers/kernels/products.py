"""ε̇(v), div v, div s, ∇p : derivatives of a vector field by the weights of ∂/∂x and ∂/∂y, as machine code.

Every weight is read once, where a sparse matrix has it once for each row. T targets, k neighbours each, `near` (T, k),
weights `both` (2, T, k) [1/mm], or their magnitudes; velocities are node-major, strain rates and stresses in blocks xx,
yy, xy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled


def weights(both: np.ndarray, t: int, n: int, magnitudes: bool) -> tuple[float, float]:
    """Those of ∂/∂x and ∂/∂y at neighbour n of target t."""
    dx, dy = both[0, t, n], both[1, t, n]
    return (abs(dx), abs(dy)) if magnitudes else (dx, dy)


def strain_rate(near: np.ndarray, both: np.ndarray, magnitudes: bool, velocity: np.ndarray) -> np.ndarray:
    """xx, yy, xy of ½(∇v + ᵗ∇v), (3 T,)."""
    targets, k = near.shape
    rates = np.empty(3 * targets)
    for t in range(targets):
        xx = yy = uy = vx = 0.0
        for n in range(k):
            dx, dy = weights(both, t, n, magnitudes)
            u, v = velocity[2 * near[t, n]], velocity[2 * near[t, n] + 1]
            xx += dx * u
            yy += dy * v
            uy += dy * u
            vx += dx * v
        rates[t], rates[targets + t], rates[2 * targets + t] = xx, yy, 0.5 * uy + 0.5 * vx
    return rates


def divergence(near: np.ndarray, both: np.ndarray, magnitudes: bool, velocity: np.ndarray) -> np.ndarray:
    """div v, (T,)."""
    targets, k = near.shape
    rates = np.empty(targets)
    for t in range(targets):
        xx = yy = 0.0
        for n in range(k):
            dx, dy = weights(both, t, n, magnitudes)
            xx += dx * velocity[2 * near[t, n]]
            yy += dy * velocity[2 * near[t, n] + 1]
        rates[t] = xx + yy
    return rates


def divergence_of_stress(near: np.ndarray, both: np.ndarray, magnitudes: bool, stress: np.ndarray) -> np.ndarray:
    """∂xx/∂x + ∂xy/∂y and ∂xy/∂x + ∂yy/∂y, node-major, (2 T,)."""
    (targets, k), points = near.shape, len(stress) // 3
    force = np.empty(2 * targets)
    for t in range(targets):
        xx = yy = shear_x = shear_y = 0.0
        for n in range(k):
            dx, dy = weights(both, t, n, magnitudes)
            shear = stress[2 * points + near[t, n]]
            xx += dx * stress[near[t, n]]
            yy += dy * stress[points + near[t, n]]
            shear_x += dx * shear
            shear_y += dy * shear
        force[2 * t], force[2 * t + 1] = xx + shear_y, shear_x + yy
    return force


def gradient(
    near: np.ndarray, both: np.ndarray, magnitudes: bool, pressure: np.ndarray, targets: np.ndarray
) -> np.ndarray:
    """∂p/∂x and ∂p/∂y at some of the targets (R,), node-major, (2 R,)."""
    force = np.empty(2 * len(targets))
    for r in range(len(targets)):
        t, x, y = targets[r], 0.0, 0.0
        for n in range(near.shape[1]):
            dx, dy = weights(both, t, n, magnitudes)
            x += dx * pressure[near[t, n]]
            y += dy * pressure[near[t, n]]
        force[2 * r], force[2 * r + 1] = x, y
    return force


STRAIN_RATE, DIVERGENCE, DIVERGENCE_OF_STRESS, GRADIENT = range(4)


def product(
    which: int, targets: np.ndarray, near: np.ndarray, both: np.ndarray, magnitudes: bool, vector: np.ndarray
) -> np.ndarray:
    """One of the four; of a gradient at some `targets` (R,), of the others at all."""
    if which == STRAIN_RATE:
        return strain_rate(near, both, magnitudes, vector)
    if which == DIVERGENCE:
        return divergence(near, both, magnitudes, vector)
    if which == DIVERGENCE_OF_STRESS:
        return divergence_of_stress(near, both, magnitudes, vector)
    return gradient(near, both, magnitudes, vector, targets)


def machine_code() -> Callable[..., Any] | None:
    """`product`, compiled; None where there is no compiler."""
    return compiled(product, "i0 u1c u2c f3c b0 f1c", weights, strain_rate, divergence, divergence_of_stress, gradient)
