"""f(x) ≈ Σ_i φ_i(x) f_i, φ = √w Q R^(−ᵀ) L(p) : moving least squares weights for many targets at once.

At each target a polynomial, centred there and scaled by the radius of the support, is fitted to the values at k
neighbours with weights w. With √w P = Q R (thin QR; P holds the k × c monomials) the weights of a linear functional L
follow from one triangular solve. Q and R are built by Gram-Schmidt carried out twice, which keeps Q orthogonal to
working precision ("twice is enough": Giraud, Langou, Rozložník 2005), for all T targets together: arrays have the
target last.
Lancaster & Salkauskas (1981); Timesli et al. (2015), section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy.spatial import cKDTree

from nlsolve import SolveError, Status

SMALLEST_PIVOT = 1e-8  # of R, relative to its column: below, the support does not determine the polynomial


def weight_function(name: str, s: np.ndarray, shape: float) -> np.ndarray:
    """w(s) for the distance s over the radius of the support: exp(−(shape s)²), (1 − s²)⁴ or the quartic spline."""
    if name == "gaussian":
        return np.exp(-((shape * s) ** 2))
    inside = np.minimum(s, 1.0)
    if name == "quartic":
        return (1.0 - inside**2) ** 4
    return (1.0 - inside) ** 3 * (1.0 + 3.0 * inside)  # 1 − 6 s² + 8 s³ − 3 s⁴, never below zero by rounding


@dataclass(frozen=True)
class Supports:
    """The neighbours of T targets among the sources: `index` (T, k), `radius` (T,) [mm] of each support."""

    index: np.ndarray
    radius: np.ndarray

    @classmethod
    def nearest(cls, sources: np.ndarray, targets: np.ndarray, count: int) -> Supports:
        """The `count` nearest sources; the radius lies half-way to the next one."""
        if len(sources) <= count:
            raise SolveError(
                Status.BAD_CLOUD, f"a support of {count} neighbours was asked for among {len(sources)} points"
            )
        distance, index = cKDTree(sources).query(targets, count + 1)
        farthest, next_one = distance[:, count - 1], distance[:, count]
        # On a regular grid the two tie, and a source on the rim would weigh nothing: the rim lies just beyond it.
        return cls(index[:, :count], np.maximum(0.5 * (farthest + next_one), 1.001 * farthest))

    @classmethod
    def within(cls, sources: np.ndarray, targets: np.ndarray, radius: float) -> Supports:
        """All sources nearer than `radius`. Short supports are filled up with farther points, which weigh nothing."""
        tree = cKDTree(sources)
        most = int(tree.query_ball_point(targets, radius, return_length=True).max())
        _, index = tree.query(targets, min(most, len(sources)))
        return cls(index, np.full(len(targets), radius))


def monomials(degree: int) -> list[tuple[int, int]]:
    """Exponents (i, j) of x^i y^j up to the total degree, lowest first."""
    return [(total - j, j) for total in range(degree + 1) for j in range(total + 1)]


def weights(
    sources: np.ndarray,
    targets: np.ndarray,
    supports: Supports,
    degree: int,
    derivatives: tuple[tuple[int, int], ...],
    weight: str,
    shape: float,
) -> list[np.ndarray]:
    """φ for each derivative ∂^(i+j)/∂x^i∂y^j asked for: a (T, k) array each.

    Raises SolveError (bad cloud) naming the first target whose support does not determine a polynomial of `degree`.
    """
    offsets = (sources[supports.index] - targets[:, None]) / supports.radius[:, None, None]
    x, y = np.ascontiguousarray(offsets.transpose(2, 1, 0))  # (k, T) each
    distance = np.hypot(x, y)
    root = np.sqrt(np.where(distance < 1.0, weight_function(weight, distance, shape), 0.0))
    exponents = monomials(degree)
    count, targets_count = len(exponents), x.shape[1]
    q = np.empty((count, *x.shape))
    r = np.zeros((count, count, targets_count))
    smallest = np.full(targets_count, np.inf)
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
        # A vanished column leaves Q undefined there; the check below names the place.
        q[c] = column / np.where(r[c, c] > 0.0, r[c, c], 1.0)
    worst = int(smallest.argmin())
    if not smallest[worst] > SMALLEST_PIVOT:
        place = ", ".join(f"{coordinate:.6g}" for coordinate in targets[worst])
        raise SolveError(
            Status.BAD_CLOUD,
            f"the {x.shape[0]} neighbours of the point ({place}) do not determine a polynomial of degree {degree}: "
            "widen the supports or lower the degree",
        )
    return [
        _of_functional(q, r, exponents.index(derivative), derivative, root, supports.radius)
        for derivative in derivatives
    ]


def _of_functional(
    q: np.ndarray, r: np.ndarray, place: int, derivative: tuple[int, int], root: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """√w Q z with Rᵀ z = L(p): at the centre only the monomial of the derivative itself has one, i! j!."""
    i, j = derivative
    z = np.zeros((len(q), q.shape[2]))
    for c in range(place, len(q)):
        value = float(factorial(i) * factorial(j)) if c == place else 0.0
        z[c] = (value - np.einsum("bt,bt->t", r[place:c, c], z[place:c])) / r[c, c]
    return np.ascontiguousarray((root * np.einsum("ct,ckt->kt", z, q) / radius ** (i + j)).T)
