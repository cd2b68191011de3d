"""W(a) ≈ Σ_{k=1..L} a^k N_k / Δ(a),  N_k = Σ_i d_i W_{k−i},  Δ(a) = 1 + d_1 a + … + d_m a^m : the series and its Padés.

One scalar denominator serves all components (Cochelin, Damil, Potier-Ferry 1994; Najah, Cochelin, Damil, Potier-Ferry
1998), so the approximant is a weighted sum of the W_j; Δ = 1 is the series itself. Everything here works on coordinates
of the W_j in an orthonormal (Gram-Schmidt) basis of their span, a p × p array, whatever the size of the problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nlsolve.plugin import least_squares, unit

NOISE = 1e-10  # directions of the W_j below this part of the largest are rounding and lower the degree of Δ
ON_THE_PATH = 1.1  # a positive real pole up to here spoils W(a) on 0 < a ≤ 1
LARGEST_GROWTH = (1e-200, 1e200)  # of W_p over W_1 that the scaling of the fit follows
REAL = 1e-3  # a pole whose angle to the real axis is below this acts like a real one


@dataclass(frozen=True)
class Extrapolation:
    """Δ by its coefficients d_0 = 1, d_1, …, d_m, shape (m + 1,), and L, the degree of the numerator."""

    denominator: np.ndarray
    degree: int

    def weights(self, a: float) -> np.ndarray:
        """w_j of W(a) = Σ_j w_j W_j, shape (L,):  w_j = a^j (d_0 + … + d_i a^i)/Δ(a) with i = min(m, L − j)."""
        m, j = len(self.denominator) - 1, np.arange(1, self.degree + 1)
        partial = np.cumsum(self.denominator * a ** np.arange(m + 1))
        return a**j * partial[np.minimum(m, self.degree - j)] / partial[m]

    def poles(self) -> np.ndarray:
        """The zeros of Δ, complex, nearest first."""
        roots = np.roots(self.denominator[::-1])
        return roots[np.argsort(np.abs(roots))]

    def is_clear(self) -> bool:
        """Whether no pole lies on the path 0 < a ≤ 1 or just behind its end."""
        poles = self.poles()
        return not (np.abs(np.angle(poles)) <= REAL)[np.abs(poles) <= ON_THE_PATH].any()


def series(order: int) -> Extrapolation:
    """a W_1 + … + a^p W_p."""
    return Extrapolation(np.ones(1), order)


def coordinates(terms: list[np.ndarray]) -> np.ndarray:
    """The W_j, columns (p, p), in the orthonormal basis that Gram-Schmidt makes of them."""
    return np.asarray(np.linalg.qr(np.stack(terms, axis=1), mode="r"))


def pade(columns: np.ndarray, m: int) -> Extrapolation:
    """Least squares for d_1 … d_m in N_k = W_k + Σ_i d_i W_{k−i} = 0, k = m + 1 … p; L = p.

    What the least squares leave of these N_k is kept, so that the approximant agrees with the series to order p.
    columns : the W_j, shape (p, p) or (U, p). Order k is divided by ρ^k, ρ the mean growth of the W_j, so that all
    orders weigh alike. m is lowered to the rank of the fit: terms that depend on each other would admit any pole.
    Exact for a rational W(a) whose denominator and numerator have degrees ≤ m.
    """
    p = columns.shape[1]
    columns = columns / unit(columns)
    sizes = np.linalg.norm(columns, axis=0)
    growth = float(np.clip(max(sizes[-2:]) / sizes[0], *LARGEST_GROWTH)) ** (1.0 / (p - 1))
    scaled = columns / (sizes[0] * growth ** np.arange(p))
    left = np.concatenate([scaled[:, k - m : k][:, ::-1] for k in range(m, p)])  # W_{k−1} … W_{k−m}
    right = -np.concatenate([scaled[:, k] for k in range(m, p)])
    d, rank = least_squares(left, right, NOISE)
    if rank < m:
        return pade(columns, rank)
    return Extrapolation(np.concatenate([[1.0], d * growth ** np.arange(1, m + 1)]), p)


def least_squares_pade(columns: np.ndarray) -> Extrapolation:
    """m = p/2: half of the orders determine Δ, in the mean."""
    return pade(columns, columns.shape[1] // 2)


def gram_schmidt_pade(columns: np.ndarray) -> Extrapolation:
    """m = p − 1: W_p projected on all terms before it determines Δ (Najah et al. 1998, who then leave out N_p)."""
    return pade(columns, columns.shape[1] - 1)


PADES = {"pade": least_squares_pade, "gram-schmidt-pade": gram_schmidt_pade}


def extrapolate(kind: str, columns: np.ndarray) -> Extrapolation:
    """The approximant of this kind; the series where there is too little to fit or a pole lies on the path."""
    p = columns.shape[1]
    if p < 2 or not columns.any():
        return series(p)
    fitted = PADES[kind](columns)
    return fitted if fitted.is_clear() else series(p)
