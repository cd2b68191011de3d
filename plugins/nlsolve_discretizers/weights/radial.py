"""[Φ P; ᵗP 0] [w; ·] = [L φ; L p] : weights of radial basis functions with polynomials, for many targets at once.

At each target, coordinates are centred there and scaled by the radius of the support, and the interpolant of the values
at k neighbours by kernels φ(|x − x_i|²) and the c monomials of a degree is differentiated. Kernels are written once, as
functions of the squared distance; series arithmetic gives their derivatives.
Wendland (2005); Flyer, Fornberg, Bayona & Barnett (2016) for polyharmonic splines with polynomials.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import factorial
from operator import mul
from typing import Any

import numpy as np

from nlsolve.plugin import Series
from nlsolve_discretizers.weights.least_squares import Derivatives, monomials

Kernel = Callable[[Any], Any]

COINCIDENT = 1e-28  # squared distance put for zero, where powers of the distance have no derivative


def kernel(name: str, power: int, shape: float) -> Kernel:
    """φ(s) of the squared distance s over the squared radius of the support: r^power, or a function of shape · r."""
    if name == "phs":
        return lambda s: reduce(mul, [s] * (power // 2), s**0.5)
    if name == "gaussian":
        return lambda s: np.exp(-(shape**2) * s)
    if name == "multiquadric":
        return lambda s: (1.0 + shape**2 * s) ** 0.5
    return _wendland(shape)


def _wendland(shape: float) -> Kernel:
    """(1 − ε r)⁴ (4 ε r + 1) within 1/ε, the C² function of minimal degree in the plane (Wendland 1995).

    In powers of t = (ε r)², so that its derivatives at r = 0 do not cancel.
    """

    def value(s: Any) -> Any:
        t = shape**2 * s
        inside = ((t.coefficient(0) if isinstance(t, Series) else t) < 1.0).astype(float)
        return (1.0 - 10.0 * t + 20.0 * t**1.5 - 15.0 * t**2 + 4.0 * t**2.5) * inside

    return value


def interpolate(
    places: np.ndarray, radius: np.ndarray, degree: int, derivatives: Derivatives, phi: Kernel
) -> tuple[np.ndarray, np.ndarray]:
    """Weights (D, T, k) of D derivatives ∂^(i+j)/∂x^i∂y^j up to the second, from neighbours at
    `places` x, y, … (3, k, T) over the `radius` (T,).

    Also an estimate of the reciprocal condition number of each local system, (T,): 0 where it is singular. It comes
    from one more right-hand side b of signs: ‖A⁻¹ b‖₂ is on average ‖A⁻¹‖_F.
    """
    x, y, _ = places
    k, targets = x.shape
    exponents = monomials(degree)
    system = np.zeros((targets, k + len(exponents), k + len(exponents)))
    between = (x[:, None] - x) ** 2
    between += (y[:, None] - y) ** 2
    system[:, :k, :k] = phi(np.maximum(between, COINCIDENT, out=between)).transpose(2, 0, 1)
    for c, (i, j) in enumerate(exponents, start=k):
        system[:, :k, c] = system[:, c, :k] = (x**i * y**j).T
    right = np.zeros((targets, k + len(exponents), len(derivatives) + 1))
    right[:, :k, :-1] = _at_centre(phi, x, y, derivatives).transpose(2, 1, 0)
    for d, (i, j) in enumerate(derivatives):
        right[:, k + exponents.index((i, j)), d] = factorial(i) * factorial(j)
    right[..., -1] = np.random.default_rng(0).choice([-1.0, 1.0], right.shape[1])
    solution, regular = _solutions(system, right)
    squares = np.einsum("tij,tij->t", system, system) * np.einsum("ti,ti->t", *[solution[..., -1]] * 2)
    weights = solution[:, :k, :-1] / radius[:, None, None] ** np.array([i + j for i, j in derivatives])
    return weights.transpose(2, 0, 1), np.where(regular, 1.0 / np.sqrt(squares), 0.0)


def _at_centre(phi: Kernel, x: np.ndarray, y: np.ndarray, derivatives: Derivatives) -> np.ndarray:
    """L φ(|x − x_i|²) at x = 0, (D, k, T): φ, −2 x_i φ′, and 4 x_i x_i φ″ + 2 φ′ on the diagonal."""
    s = Series.seed(np.maximum(x**2 + y**2, COINCIDENT))
    s.append(np.zeros_like(x))
    value = phi(s)

    def at_centre(derivative: tuple[int, int]) -> np.ndarray:
        along = [x] * derivative[0] + [y] * derivative[1]
        if not along:
            return value.coefficient(0)
        if len(along) == 1:
            return -2.0 * along[0] * value.coefficient(1)
        second = 8.0 * value.coefficient(2) * along[0] * along[1]  # coefficient 2 is φ″/2
        return second + 2.0 * value.coefficient(1) if along[0] is along[1] else second

    return np.stack([at_centre(derivative) for derivative in derivatives])


def _solutions(systems: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solutions of all systems, and which of them have one."""
    try:
        return np.linalg.solve(systems, right), np.ones(len(systems), dtype=bool)
    except np.linalg.LinAlgError:  # one singular system refuses them all
        sound = np.linalg.matrix_rank(systems) == systems.shape[1]
        solution = np.ones_like(right)
        solution[sound] = np.linalg.solve(systems[sound], right[sound])
        return solution, sound
