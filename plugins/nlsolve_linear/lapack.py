"""P A = L U with dense factors by LAPACK: for small systems, and for systems whose matrix is dense."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse.linalg
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status
from nlsolve_linear.equilibrium import powers_of_two

LARGEST = 20_000  # unknowns: above it the factors take more than 3 GB, and sparse ones a fraction of that


class DenseFactors(Factors):
    """L and U of R A C for one matrix A of U unknowns, U² entries.

    R and C are diagonal, of powers of two that make the largest entry of each row and column about 1. So neither the
    pivots nor whether A counts as singular depends on the units of equations and unknowns, and nothing is rounded.
    """

    ordering = "dense"

    def __init__(self, matrix: np.ndarray) -> None:
        self._norm = float(np.abs(matrix).sum(axis=0).max())
        self._rows = powers_of_two(np.abs(matrix).max(axis=1))
        matrix *= self._rows[:, None]
        self._columns = powers_of_two(np.abs(matrix).max(axis=0))
        matrix *= self._columns
        norm = float(np.abs(matrix).sum(axis=0).max())
        lu, pivots, info = dgetrf(matrix, overwrite_a=True)
        if info > 0:
            raise SolveError(Status.SINGULAR_TANGENT, f"LAPACK: pivot {info} of {len(lu)} is exactly zero")
        self._factors = lu, pivots
        reciprocal, _ = dgecon(lu, norm)
        if not reciprocal > np.finfo(float).eps:
            raise SolveError(Status.SINGULAR_TANGENT, f"LAPACK: the reciprocal condition number is {reciprocal:.1e}")
        self.fill = lu.size

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with A x = rhs by one pair of triangular solves."""
        return self._solved(rhs)

    def condition(self) -> float:
        """‖A‖₁ times an estimate of ‖A⁻¹‖₁ from the factors (Hager 1984)."""
        inverse = scipy.sparse.linalg.LinearOperator(
            self._factors[0].shape,
            matvec=lambda rhs: self._solved(rhs.ravel()),
            rmatvec=lambda rhs: self._solved(rhs.ravel(), transposed=True),
        )
        return self._norm * float(scipy.sparse.linalg.onenormest(inverse, t=1))

    def _solved(self, rhs: np.ndarray, transposed: bool = False) -> np.ndarray:
        """A⁻¹ rhs, or A⁻ᵀ rhs."""
        first, last = (self._columns, self._rows) if transposed else (self._rows, self._columns)
        x, _ = dgetrs(*self._factors, (first * rhs.T).T, trans=int(transposed))  # an eighth of lu_solve's time for 20
        return (last * x.T).T


class Lapack(LinearSolver):
    """LU with partial pivoting (Anderson et al. 1999). A reciprocal condition below rounding is a singular tangent."""

    kind: Literal["lapack"] = "lapack"

    def factorize(self, matrix: Any, previous: Factors | None = None) -> DenseFactors:
        """Dense factors of a sparse matrix; `previous` is not used."""
        if not np.isfinite(matrix.data).all():
            raise SolveError(Status.NON_FINITE, "a tangent holds numbers that are not finite")
        unknowns = matrix.shape[0]
        if unknowns > LARGEST:
            raise SolveError(
                Status.NOT_APPLICABLE,
                f"dense factors of {unknowns} unknowns take {8e-9 * unknowns**2:.0f} GB: choose a sparse linear solver",
            )
        return DenseFactors(matrix.toarray(order="F"))
