"""Pᵀ w P z = L(p), φ = w P z : weights of least squares for T targets, the same lines for numpy and as machine code.

P holds the monomials x^i y^j up to a degree at the k neighbours of a target, w their weights, L is a derivative at the
target. The entries of Pᵀ w P are the moments Σ_k w x^i y^j up to twice the degree.

The target is the last index everywhere, and a loop over `each` of them the innermost: for numpy one slice, of all
targets together; as machine code the numbers of a few targets, whose arrays stay in the cache.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from nlsolve_discretizers.kernels.machine_code import compiled, each

AT_ONCE = 64  # targets in the innermost loops of machine code
LEAST = float(np.finfo(float).tiny)


def place(i: int, j: int) -> int:
    """Number of x^i y^j among the monomials, lowest degree first."""
    return (i + j) * (i + j + 1) // 2 + j


def fitted(
    x: np.ndarray, y: np.ndarray, w: np.ndarray, degree: int, derivatives: Iterable[tuple[int, int]], radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """φ (D, k, T) of D derivatives ∂^(i+j)/∂x^i∂y^j over radius^(i+j), for weights w (k, T) at x, y (k, T) over the
    `radius` (T,) of each target.

    Also the smallest pivot of R relative to its column, where √w P = Q R, (T,): the root of that of the elimination.
    """
    phi, smallest = (machine_code() or together)(x, y, w, degree, np.array(derivatives), radius)
    return phi, np.sqrt(smallest)


def machine_code() -> Callable[..., Any] | None:
    """`in_blocks`, compiled; None where there is no compiler."""
    return compiled(in_blocks, "f2 f2 f2 i0 i2 f1c", place, eliminated, together)


def together(
    x: np.ndarray, y: np.ndarray, w: np.ndarray, degree: int, derivatives: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """φ (D, k, T) of D derivatives ∂^(i+j)/∂x^i∂y^j, rows i, j of (D, 2), over radius^(i+j), for weights w (k, T) at
    x, y (k, T) over the `radius` (T,).

    Also the smallest pivot of the elimination relative to its diagonal entry, (T,): where it vanishes φ means nothing.
    """
    near, targets = x.shape
    weighed = np.empty((place(0, 2 * degree) + 1, near, targets))
    moments = np.zeros((len(weighed), targets))
    weighed[0] = w
    for total in range(1, 2 * degree + 1):
        for j in range(total + 1):
            m, factor = place(total - j, j), x if j < total else y
            lower = place(total - 1 - j, j) if j < total else place(0, j - 1)
            for k in each(0, near):
                for t in each(0, targets):
                    weighed[m, k, t] = weighed[lower, k, t] * factor[k, t]
    for k in range(near):
        for m in each(0, len(weighed)):
            for t in each(0, targets):
                moments[m, t] += weighed[m, k, t]
    count = place(0, degree) + 1
    system = np.zeros((count, count + len(derivatives), targets))
    for total in range(degree + 1):
        for j in range(total + 1):
            for other in range(total, degree + 1):
                for q in range(other + 1):
                    r, s, m = place(total - j, j), place(other - q, q), place(total - j + other - q, j + q)
                    for t in each(0, targets):
                        system[r, s, t] = moments[m, t]
    for d in range(len(derivatives)):
        i, j = derivatives[d]
        factorials = 1.0
        for n in range(2, i + 1):
            factorials *= n
        for n in range(2, j + 1):
            factorials *= n
        system[place(i, j), count + d] = factorials / radius ** (i + j)
    smallest = eliminated(system)
    phi = np.zeros((len(derivatives), near, targets))
    for d in range(len(derivatives)):
        for c in range(count):
            for k in each(0, near):
                for t in each(0, targets):
                    phi[d, k, t] += system[c, count + d, t] * weighed[c, k, t]
    return phi, smallest


def eliminated(system: np.ndarray) -> np.ndarray:
    """Solve A z = b in place: `system` (c, c + D, T) holds A, symmetric and semi-definite, of which the upper triangle
    is used, and D columns b, which become z.

    Returns the smallest pivot relative to its diagonal entry, (T,); z means nothing where it vanishes.
    """
    count, width, targets = system.shape
    smallest = np.full(targets, np.inf)
    size, inverse = np.empty((count, targets)), np.empty(targets)
    for c in range(count):
        for t in each(0, targets):
            size[c, t] = np.maximum(system[c, c, t], LEAST)
    for c in range(count):
        for t in each(0, targets):
            pivot = np.maximum(system[c, c, t], 0.0)
            smallest[t] = np.minimum(smallest[t], pivot / size[c, t])
            inverse[t] = 1.0 / (pivot + (pivot == 0.0))
        for r in range(c + 1, count):
            for s in each(r, width):
                for t in each(0, targets):
                    system[r, s, t] -= system[c, r, t] * inverse[t] * system[c, s, t]
        for t in each(0, targets):
            system[c, c, t] = inverse[t]
    for c in range(count - 1, -1, -1):
        for s in each(count, width):
            for t in each(0, targets):
                system[c, s, t] *= system[c, c, t]
        for r in range(c):
            for s in each(count, width):
                for t in each(0, targets):
                    system[r, s, t] -= system[r, c, t] * system[c, s, t]
    return smallest


def in_blocks(
    x: np.ndarray, y: np.ndarray, w: np.ndarray, degree: int, derivatives: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`together`, AT_ONCE targets after AT_ONCE targets; φ of a target stays together."""
    near, targets = x.shape
    phi, smallest = np.empty((len(derivatives), targets, near)), np.empty(targets)
    for begin in range(0, targets, AT_ONCE):
        end = min(begin + AT_ONCE, targets)
        part, smallest[begin:end] = together(
            np.ascontiguousarray(x[:, begin:end]),
            np.ascontiguousarray(y[:, begin:end]),
            np.ascontiguousarray(w[:, begin:end]),
            degree,
            derivatives,
            radius[begin:end],
        )
        phi[:, begin:end] = part.transpose(0, 2, 1)
    return phi.transpose(0, 2, 1), smallest
