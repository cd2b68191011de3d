"""min ‖b − A x‖₂ over x = M⁻¹ v, v in span{b, A M⁻¹ b, …} : GMRES, preconditioned on the right.

Saad & Schultz (1986), flexible (Saad 1993). SciPy's `gmres` preconditions on the left, so that it minimises, and stops
by, ‖M⁻¹ (b − A x)‖, at two solves and a product more; its `gcrotmk` preconditions on the right, but returns x alone. An
inexact Newton method needs

- preconditioning on the right, so that ‖b − A x‖ itself is minimised and compared with the forcing term;
- x = Z y from the directions z_k = M⁻¹ v_k as they were stored, without a further solve, and correct also where M
  changes from one to the next, as an M that iterates does;
- ‖b − A x‖ and the dimension as results: the former gives the next forcing term, both give the contraction per solve,
  by which the refresh rule judges K*.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nlsolve.plugin import SolveError, Status, least_squares, norm

Map = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Krylov:
    """The result of GMRES.

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
    Raises SolveError (not finite) if a product is not finite.
    """
    size = left = norm(b)
    basis, directions = np.empty((most + 1, len(b))), np.empty((most, len(b)))
    basis[0] = b / size
    triangle, rotated = np.zeros((most, most)), [size]  # R of the Hessenberg matrix, and Qᵀ e_1 ‖b‖
    rotations: list[tuple[float, float]] = []
    for k in range(most):
        directions[k] = precondition(basis[k])
        w: np.ndarray = product(directions[k])
        length = norm(w)
        if not np.isfinite(length):
            raise SolveError(Status.NON_FINITE, "a product with the Jacobian was not finite")
        column = np.zeros(k + 1)
        for _ in range(2):  # Gram and Schmidt twice are enough (Kahan)
            projections = basis[: k + 1] @ w
            w = w - projections @ basis[: k + 1]
            column += projections
        beyond = norm(w)
        triangle[: k + 1, k], rotation = rotated_column([*column.tolist(), beyond], rotations)
        rotations.append(rotation)
        cosine, sine = rotation
        rotated[k:] = [cosine * rotated[k], -sine * rotated[k]]
        left = abs(rotated[k + 1])
        if left <= tolerance or beyond <= np.finfo(float).eps * length:
            break
        basis[k + 1] = w / beyond
    count = len(rotations)
    y, _ = least_squares(triangle[:count, :count], np.array(rotated[:count]))
    return Krylov(y @ directions[:count], left, count)


def rotated_column(
    column: list[float], rotations: list[tuple[float, float]]
) -> tuple[list[float], tuple[float, float]]:
    """A new column of the Hessenberg matrix after the rotations before it (Givens), and the one that clears its end."""
    for i, (cosine, sine) in enumerate(rotations):
        upper, lower = column[i], column[i + 1]
        column[i], column[i + 1] = cosine * upper + sine * lower, cosine * lower - sine * upper
    norm = float(np.hypot(column[-2], column[-1]))
    rotation = (column[-2] / norm, column[-1] / norm) if norm else (1.0, 0.0)
    return [*column[:-2], norm], rotation
