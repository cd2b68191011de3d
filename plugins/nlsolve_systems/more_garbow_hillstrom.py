"""F(u) = 0 after Moré, Garbow & Hillstrom (1981), Testing unconstrained optimization software, ACM TOMS 7(1), 17-41.

A number (1) … (35) is the problem's number in the paper. u has shape (U, …); indices k run from 1 as in the paper. Nine
of the first fourteen problems of Burkardt's TEST_NONLIN are problems of the paper, unchanged.
"""

from __future__ import annotations

from functools import cache, reduce
from operator import mul
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.plugin import as_column


def numbers(u: Any) -> np.ndarray:
    """k = 1 … U, in a shape that combines with u."""
    return as_column(np.arange(1.0, u.shape[0] + 1.0), u)


@cache
def shifted(size: int, below: float, above: float) -> Any:
    """The tridiagonal matrix with `below` and `above` beside a zero diagonal."""
    return sp.diags_array([below, above], offsets=[-1, 1], shape=(size, size), format="csr")


def generalized_rosenbrock(u: Any) -> Any:
    """1 − x_1;  10 (x_k − x_{k−1}²); (1) for two unknowns."""
    return np.concatenate([1.0 - u[:1], 10.0 * (u[1:] - u[:-1] ** 2)])


def powell_singular(u: Any) -> Any:
    """a + 10 b,  √5 (c − d),  (b − 2 c)²,  √10 (a − d)² of each four unknowns; (13), extended (22)."""
    a, b, c, d = u[0::4], u[1::4], u[2::4], u[3::4]
    equations = [a + 10.0 * b, np.sqrt(5.0) * (c - d), (b - 2.0 * c) ** 2, np.sqrt(10.0) * (a - d) ** 2]
    return np.stack(equations, axis=1).reshape(*u.shape)


def powell_badly_scaled(u: Any) -> Any:
    """10⁴ x y − 1,  e⁻ˣ + e⁻ʸ − 1.0001; (3)."""
    x, y = u
    return np.stack([1e4 * x * y - 1.0, np.exp(-x) + np.exp(-y) - 1.0001])


def wood(u: Any) -> Any:
    """The gradient of 100 (y − x²)² + (1 − x)² + 90 (w − z²)² + (1 − z)² + …, its rows for x and z halved; (14)."""
    x, y, z, w = u
    s, t = y - x**2, w - z**2
    return np.stack(
        [
            -200.0 * x * s - (1.0 - x),
            200.0 * s + 20.2 * (y - 1.0) + 19.8 * (w - 1.0),
            -180.0 * z * t - (1.0 - z),
            180.0 * t + 20.2 * (w - 1.0) + 19.8 * (y - 1.0),
        ]
    )


def helical_valley(u: Any) -> Any:
    """10 (z − 10 θ),  10 (r − 1),  z, with 2π θ the angle of (x, y) from −π/2 to 3π/2; (7)."""
    x, y, z = u
    theta = 0.25 + np.arctan2(-x, y) / (2.0 * np.pi)
    return np.stack([10.0 * (z - 10.0 * theta), 10.0 * (np.sqrt(x**2 + y**2) - 1.0), z])


def watson(u: Any) -> Any:
    """Half the gradient of Σ_i (p′(t_i) − p(t_i)² − 1)² + x_1² + (x_2 − x_1² − 1)², p(t) = Σ x_k t^{k−1}; (20)."""
    x, y = u[0], u[1]
    last = np.stack([x * (3.0 - 2.0 * y + 2.0 * x**2), y - x**2 - 1.0])
    return watson_interior(u, first=0) + np.concatenate([last, 0.0 * u[2:]])


def watson_interior(u: Any, first: int) -> Any:
    """Σ_i r_i (p′_k − 2 p t_i^{k−1}), r = Σ_{k>1} p′_k x_k − p² − 1, p′_k = (k − 1 + first) t_i^{k−2}, t_i = i/29."""
    t, k = np.arange(1.0, 30.0)[:, None] / 29.0, np.arange(u.shape[0])
    value, slope = t**k, (k + first) * t ** (k - 1.0)
    p = value @ u
    r = (slope * (k > 0)) @ u - p**2 - 1.0
    return slope.T @ r - 2.0 * (value.T @ (p * r))


def chebyquad(u: Any) -> Any:
    """(1/n) Σ_j T_k(x_j) − ∫₀¹ T_k, on [−1, 1]; (35)."""
    before, now, n = 1.0, u, u.shape[0]
    equations = []
    for k in range(1, n + 1):
        equations.append(np.sum(now, axis=0) / n + (1.0 / (k * k - 1.0) if k % 2 == 0 else 0.0))
        before, now = now, 2.0 * u * now - before
    return np.stack(equations)


def brown_almost_linear(u: Any) -> Any:
    """x_k + Σ x_j − (n + 1), k < n;  Π x_j − 1; (27)."""
    product = reduce(mul, u)
    return np.concatenate([u[:-1] + np.sum(u, axis=0) - (u.shape[0] + 1.0), np.stack([product - 1.0])])


def discrete_boundary_value(u: Any) -> Any:
    """2 x_k − x_{k−1} − x_{k+1} + h² (x_k + t_k + 1)³/2,  t_k = k h,  h = 1/(n + 1); (28)."""
    h = 1.0 / (u.shape[0] + 1)
    return 2.0 * u + shifted(u.shape[0], -1.0, -1.0) @ u + 0.5 * h**2 * (u + h * numbers(u) + 1.0) ** 3


def discrete_integral(u: Any, both: bool = False) -> Any:
    """x_k + h/2 ((1 − t_k) Σ_{j≤k} t_j c_j + t_k Σ_{j>k} (1 − t_j) c_j),  c = (x + t + 1)³; (29).

    With `both` the second sum counts j = k too.
    """
    h = 1.0 / (u.shape[0] + 1)
    t = h * numbers(u)
    cubes = (u + t + 1.0) ** 3
    low, high = t * cubes, (1.0 - t) * cubes
    behind = np.sum(high, axis=0) - np.cumsum(high, axis=0) + (high if both else 0.0)
    return u + 0.5 * h * ((1.0 - t) * np.cumsum(low, axis=0) + t * behind)


def trigonometric(u: Any) -> Any:
    """n − Σ cos x_j + k (1 − cos x_k) − sin x_k; (26)."""
    cosines = np.cos(u)
    return u.shape[0] - np.sum(cosines, axis=0) + numbers(u) * (1.0 - cosines) - np.sin(u)


def variably_dimensioned(u: Any) -> Any:
    """x_k − 1 + k s (1 + 2 s²),  s = Σ j (x_j − 1); the gradient of (25), halved."""
    s = np.sum(numbers(u) * (u - 1.0), axis=0)
    return u - 1.0 + numbers(u) * (s * (1.0 + 2.0 * s**2))


def broyden_tridiagonal(u: Any) -> Any:
    """(3 − 2 x_k) x_k − x_{k−1} − 2 x_{k+1} + 1; (30)."""
    return (3.0 - 2.0 * u) * u + shifted(u.shape[0], -1.0, -2.0) @ u + 1.0


def broyden_banded(u: Any) -> Any:
    """x_k (2 + 5 x_k²) + 1 − Σ_j x_j (1 + x_j) over the five j below k and the one above; (31)."""
    return u * (2.0 + 5.0 * u**2) + 1.0 - band(u.shape[0]) @ (u * (1.0 + u))


@cache
def band(size: int) -> Any:
    """Ones on the five diagonals below the main one and on the one above."""
    offsets = [offset for offset in (-5, -4, -3, -2, -1, 1) if abs(offset) < size]
    return sp.diags_array([1.0] * len(offsets), offsets=offsets, shape=(size, size), format="csr")


def extended_rosenbrock(u: Any) -> Any:
    """10 (b − a²),  1 − a of each two unknowns; (21)."""
    a, b = u[0::2], u[1::2]
    return np.stack([10.0 * (b - a**2), 1.0 - a], axis=1).reshape(*u.shape)


def gulf(u: Any) -> Any:
    """exp(−|y_i − b|ᶜ/a) − t_i,  t_i = i/100,  y_i = 25 + (−50 ln t_i)^{2/3},  i = 1, 2, 3; (11), m = 3."""
    a, b, c = u
    t = as_column(np.arange(1.0, 4.0) / 100.0, u)
    y = 25.0 + (-50.0 * np.log(t)) ** (2.0 / 3.0)
    return np.exp(-np.exp(0.5 * c * np.log((y - b) ** 2)) / a) - t


def box(u: Any) -> Any:
    """e^{−t a} − e^{−t b} − c (e^{−t} − e^{−10 t}),  t = 0.1, 0.2, 0.3; (12), m = 3."""
    a, b, c = u
    t = as_column(np.arange(1.0, 4.0) / 10.0, u)
    return np.exp(-t * a) - np.exp(-t * b) - c * (np.exp(-t) - np.exp(-10.0 * t))


def biggs(u: Any) -> Any:
    """c e^{−t a} − d e^{−t b} + f e^{−t e} − y,  y = e^{−t} − 5 e^{−10 t} + 3 e^{−4 t},  t = 0.1 … 0.6; (18), m = 6."""
    a, b, c, d, e, f = u
    t = as_column(np.arange(1.0, 7.0) / 10.0, u)
    y = np.exp(-t) - 5.0 * np.exp(-10.0 * t) + 3.0 * np.exp(-4.0 * t)
    return c * np.exp(-t * a) - d * np.exp(-t * b) + f * np.exp(-t * e) - y
