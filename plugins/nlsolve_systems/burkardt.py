"""F(u) = 0 of TEST_NONLIN (J. Burkardt) as in SciML's NonlinearProblemLibrary: what is not in Moré, Garbow & Hillstrom.

u has shape (U, …). Three of its problems differ from those they are named after. They are kept as they are, because
published figures refer to them: "Watson" starts the powers of its polynomial one too high and has x_2² instead of x_1²
(the code of 2024 also had x_1² instead of x_1 x_2, and added to what its output held before); "discrete integral"
counts j = k in both sums; "Chandrasekhar" has the right ends of the intervals instead of their midpoints.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.plugin import as_column
from nlsolve_systems.more_garbow_hillstrom import discrete_integral, watson_interior

TINY = 1e-4
"""Eigenvalue of Hammarling's matrices."""


def watson_of_burkardt(u: Any) -> Any:
    """Problem 6."""
    x, y = u[0], u[1]
    last = np.stack([x * (3.0 - 2.0 * y + 2.0 * x**2), y * (1.0 - y) - 1.0])
    return watson_interior(u, first=1) + np.concatenate([last, 0.0 * u[2:]])


def discrete_integral_of_burkardt(u: Any) -> Any:
    """Problem 10."""
    return discrete_integral(u, both=True)


def hammarling(u: Any) -> Any:
    """X² − A, A = 10⁻⁴ I but for A_12 = 1, row by row; problems 15 and 16 (Hammarling, in Higham 1987)."""
    m = round(u.shape[0] ** 0.5)
    x = u.reshape(m, m, *u.shape[1:])
    a = TINY * np.eye(m)
    a[0, 1] = 1.0
    square = sum(x[:, k, None] * x[None, k] for k in range(m))
    return square.reshape(*u.shape) - as_column(a.ravel(), u)


def dennis_schnabel(u: Any) -> Any:
    """x + y − 3,  x² + y² − 9; problem 17 (Dennis & Schnabel 1983, example 6.5.1)."""
    x, y = u
    return np.stack([x + y - 3.0, x**2 + y**2 - 9.0])


def sample_18(u: Any) -> Any:
    """y² (1 − e^{−x²})/x,  x (1 − e^{−y²})/y; problem 18. Zero on both axes, where the quotients are 0/0."""
    x, y = u
    return np.stack([y**2 * (1.0 - np.exp(-(x**2))) / x, x * (1.0 - np.exp(-(y**2))) / y])


def sample_19(u: Any) -> Any:
    """(x, y) (x² + y²); problem 19."""
    x, y = u
    return u * (x**2 + y**2)


def scalar(u: Any) -> Any:
    """x (x − 5)²; problem 20."""
    return u * (u - 5.0) ** 2


def freudenstein_roth(u: Any) -> Any:
    """x − y³ + 5 y² − 2 y − 13,  x + y³ + y² − 14 y − 29; problem 21, and (2) of Moré, Garbow & Hillstrom."""
    x, y = u
    return np.stack([x - y**3 + 5.0 * y**2 - 2.0 * y - 13.0, x + y**3 + y**2 - 14.0 * y - 29.0])


def boggs(u: Any) -> Any:
    """x² − y + 1,  x − cos(π y/2); problem 22 (Boggs 1971)."""
    x, y = u
    return np.stack([x**2 - y + 1.0, x - np.cos(0.5 * np.pi * y)])


def chandrasekhar_at(u: Any, mu: np.ndarray, c: float) -> Any:
    """x_i − 1/(1 − c/(2 n) Σ_j μ_i x_j/(μ_i + μ_j)), of nodes μ (n,): Chandrasekhar's H-function (Kelley 1980)."""
    kernel = 0.5 * c / len(mu) * mu[:, None] / (mu[:, None] + mu)
    return u - 1.0 / (1.0 - kernel @ u)


def chandrasekhar_of_burkardt(u: Any) -> Any:
    """Problem 23: c = 0.9, μ_i = i/n."""
    return chandrasekhar_at(u, np.arange(1.0, u.shape[0] + 1.0) / u.shape[0], 0.9)
