"""P A = L U with dense factors by LAPACK: for small systems, and for systems whose matrix is dense."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status

LARGEST = 20_000  # unknowns: above it the factors take more than 3 GB, and sparse ones a fraction of that


class DenseFactors(Factors):
    """L and U of one matrix of U unknowns, U² entries."""

    ordering = "dense"

    def __init__(self, matrix: np.ndarray) -> None:
        norm = float(np.abs(matrix).sum(axis=0).max())
        lu, pivots, info = dgetrf(matrix, overwrite_a=True)
        if info > 0:
            raise SolveError(Status.SINGULAR_TANGENT, f"LAPACK: pivot {info} of {len(lu)} is exactly zero")
        self._factors = lu, pivots
        self._reciprocal, _ = dgecon(lu, norm)
        if not self._reciprocal > np.finfo(float).eps:
            raise SolveError(
                Status.SINGULAR_TANGENT, f"LAPACK: the reciprocal condition number is {self._reciprocal:.1e}"
            )
        self.fill = lu.size

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with A x = rhs by one pair of triangular solves."""
        x, _ = dgetrs(*self._factors, rhs)  # an eighth of what scipy.linalg.lu_solve takes for 20 unknowns
        return x

    def condition(self) -> float:
        """An estimate of ‖A‖₁ ‖A⁻¹‖₁ from the factors (Higham 1988)."""
        return 1.0 / float(self._reciprocal)


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
