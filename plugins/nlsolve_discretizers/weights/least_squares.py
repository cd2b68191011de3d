"""f(x) ≈ Σ_i φ_i(x) f_i, φ = w P (Pᵀ w P)⁻¹ L(p) : moving least squares weights for many targets at once.

At each target a polynomial, centred there and scaled by the radius of the support, is fitted to the values at k
neighbours with weights w; P holds the k × c monomials, and L is a linear functional such as ∂/∂x at the target. The
normal equations lose twice the digits that P has lost, which is no harm on usual supports, whose pivots are near 1.
Where one is below `SOUND`, √w P = Q R (thin QR) gives φ = √w Q R^(−ᵀ) L(p) instead. Q and R are built by Gram-Schmidt
carried out twice, which keeps Q orthogonal to working precision ("twice is enough": Giraud, Langou, Rozložník 2005).
Either way is taken for all T targets together: arrays have the target last.
Lancaster & Salkauskas (1981); Timesli et al. (2015), section 3.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from nlsolve_discretizers.kernels.normal_equations import fitted

Derivatives = tuple[tuple[int, int], ...]

SOUND = 0.05  # smallest pivot, relative to its column, with which the normal equations keep 13 digits


def weight_function(name: str, s: np.ndarray, shape: float) -> np.ndarray:
    """w(s) for the distance s over the radius of the support: exp(−(shape s)²), (1 − s²)⁴ or the quartic spline."""
    if name == "gaussian":
        return np.exp(-((shape * s) ** 2))
    inside = np.minimum(s, 1.0)
    if name == "quartic":
        return (1.0 - inside**2) ** 4
    return (1.0 - inside) ** 3 * (1.0 + 3.0 * inside)  # 1 − 6 s² + 8 s³ − 3 s⁴, never below zero by rounding


def monomials(degree: int) -> list[tuple[int, int]]:
    """Exponents (i, j) of x^i y^j up to the total degree, lowest first."""
    return [(total - j, j) for total in range(degree + 1) for j in range(total + 1)]


def fit(
    places: np.ndarray, radius: np.ndarray, degree: int, derivatives: Derivatives, weight: str, shape: float
) -> tuple[np.ndarray, np.ndarray]:
    """φ (D, T, k) for each of D derivatives ∂^(i+j)/∂x^i∂y^j, from neighbours at `places` x, y, |(x, y)| (3, k, T)
    over the `radius` (T,) of the support of each of T targets.

    Also the smallest pivot of R relative to its column, (T,): 1 for orthogonal monomials, 0 where the support does not
    determine a polynomial of `degree` and φ means nothing.
    """
    x, y, distance = places
    w = np.where(distance < 1.0, weight_function(weight, distance, shape), 0.0)
    phi, smallest = fitted(x, y, w, degree, derivatives, radius)
    poor = np.flatnonzero(~(smallest >= SOUND))
    if len(poor):
        scaled, smallest[poor] = _by_orthogonal_columns(x[:, poor], y[:, poor], w[:, poor], degree, derivatives)
        orders = np.array(derivatives).sum(axis=1)
        phi[..., poor] = scaled / radius[poor] ** orders[:, None, None]
    return phi.transpose(0, 2, 1), smallest


def _by_orthogonal_columns(
    x: np.ndarray, y: np.ndarray, w: np.ndarray, degree: int, derivatives: Derivatives
) -> tuple[np.ndarray, np.ndarray]:
    """φ (D, k, T) in the scaled coordinates and the smallest pivot (T,), by √w P = Q R."""
    root, exponents = np.sqrt(w), monomials(degree)
    count, targets = len(exponents), x.shape[1]
    q = np.empty((count, *x.shape))
    r = np.zeros((count, count, targets))
    smallest = np.full(targets, np.inf)
    for c, (i, j) in enumerate(exponents):
        column = root * x**i * y**j
        length = np.sqrt(np.einsum("kt,kt->t", column, column))
        for _ in range(2):
            for b in range(c):
                overlap = np.einsum("kt,kt->t", q[b], column)
                r[b, c] += overlap
                column -= overlap * q[b]
        r[c, c] = np.sqrt(np.einsum("kt,kt->t", column, column))
        smallest = np.minimum(smallest, r[c, c] / np.maximum(length, np.finfo(float).tiny))
        # A vanished column leaves Q undefined there; the smallest pivot tells.
        q[c] = column / np.where(r[c, c] > 0.0, r[c, c], 1.0)
    r[np.arange(count), np.arange(count)] = np.where(smallest > 0.0, r[np.arange(count), np.arange(count)], 1.0)
    z = np.stack([_of_functional(r, exponents.index(d), d) for d in derivatives])
    return root * np.einsum("dct,ckt->dkt", z, q), smallest


def _of_functional(r: np.ndarray, place: int, derivative: tuple[int, int]) -> np.ndarray:
    """z (c, T) with Rᵀ z = L(p): at the centre only the monomial of the derivative itself has one, i! j!."""
    i, j = derivative
    z = np.zeros((len(r), r.shape[2]))
    for c in range(place, len(r)):
        value = float(factorial(i) * factorial(j)) if c == place else 0.0
        z[c] = (value - np.einsum("bt,bt->t", r[place:c, c], z[place:c])) / r[c, c]
    return z
