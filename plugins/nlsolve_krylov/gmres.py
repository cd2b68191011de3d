"""min ‖b − A x‖₂ over x = M⁻¹ v, v in span{b, A M⁻¹ b, …} : GMRES, preconditioned on the right.

Saad & Schultz (1986).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nlsolve import SolveError, Status

Map = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Krylov:
    """What GMRES found.

    solution : x, shape (U,).
    left : ‖b − A x‖₂.
    count : dimension of the space, which is the number of products, and of solves with M.
    """

    solution: np.ndarray
    left: float
    count: int


def gmres(product: Map, precondition: Map, b: np.ndarray, tolerance: float, most: int) -> Krylov:
    """x with ‖b − A x‖ ≤ tolerance, or the best of `most` dimensions; b ≠ 0.

    Preconditioned on the right, the residual that is minimised is the true one, and x = Z y needs no further solve.
    """
    size = left = float(np.linalg.norm(b))
    basis, directions = np.empty((most + 1, len(b))), np.empty((most, len(b)))
    basis[0] = b / size
    hessenberg = np.zeros((most + 1, most))
    y: np.ndarray = np.zeros(0)
    for k in range(most):
        directions[k] = precondition(basis[k])
        w: np.ndarray = product(directions[k])
        length = float(np.linalg.norm(w))
        if not np.isfinite(length):
            raise SolveError(Status.NON_FINITE, "a product with the Jacobian was not finite")
        for _ in range(2):  # Gram and Schmidt twice are enough (Kahan)
            projections = basis[: k + 1] @ w
            w = w - projections @ basis[: k + 1]
            hessenberg[: k + 1, k] += projections
        hessenberg[k + 1, k] = np.linalg.norm(w)
        e_1 = np.zeros(k + 2)
        e_1[0] = size
        y = np.asarray(np.linalg.lstsq(hessenberg[: k + 2, : k + 1], e_1, rcond=None)[0])
        left = float(np.linalg.norm(e_1 - hessenberg[: k + 2, : k + 1] @ y))
        if left <= tolerance or hessenberg[k + 1, k] <= np.finfo(float).eps * length:
            break
        basis[k + 1] = w / hessenberg[k + 1, k]
    return Krylov(y @ directions[: len(y)], left, len(y))
