"""min ‖b − A x‖ over Krylov spaces of (L U)⁻¹ A, with L U ≈ A incomplete: less memory for more solves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import scipy.sparse.linalg
from pydantic import Field
from scipy.sparse.linalg import LinearOperator

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status

# The diagonal is preferred as pivot, in the ordering of Aᵀ + A, because the patterns of flows are nearly symmetric.
PIVOTING: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 1e-3,
    "options": {"SymmetricMode": True},
}

Map = Callable[[np.ndarray], np.ndarray]


class Counted:
    """A linear map that counts how often it is applied."""

    def __init__(self, apply: Map) -> None:
        self._apply, self.count = apply, 0

    def __call__(self, vector: np.ndarray) -> np.ndarray:
        self.count += 1
        return self._apply(vector)


class IncompleteFactors(Factors):
    """L and U with small entries left out, and the matrix itself."""

    ordering = "mmd-at-plus-a, incomplete"

    def __init__(self, columns: Any, solver: IluGmres) -> None:
        try:
            self._factors = scipy.sparse.linalg.spilu(
                columns, drop_tol=solver.drop_tolerance, fill_factor=solver.fill_factor, **PIVOTING
            )
        except RuntimeError as error:  # SuperLU's one way to say that a pivot vanished
            raise SolveError(Status.SINGULAR_TANGENT, f"incomplete SuperLU: {error}") from error
        self._rows, self._solver = columns.tocsr(), solver
        self.fill = int(self._factors.nnz)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with ‖rhs − A x‖ ≤ tolerance ‖rhs‖ by GMRES (Saad & Schultz 1986), preconditioned on the left, restarted.

        Raises SolveError when the restarts allowed do not reach it.
        """
        precondition, multiply = Counted(self._factors.solve), Counted(self._rows.__matmul__)
        tolerance, shape = self._solver.tolerance, self._rows.shape
        try:
            with np.errstate(all="ignore"):  # a poor preconditioner overflows: GMRES then fails, and says so
                x, failed = scipy.sparse.linalg.gmres(
                    LinearOperator(shape, matvec=multiply, dtype=float),
                    rhs.copy(),
                    M=LinearOperator(shape, matvec=precondition, dtype=float),
                    rtol=tolerance,
                    restart=self._solver.dimension,
                    maxiter=self._solver.restarts + 1,
                )
                left = np.linalg.norm(rhs - multiply(x)) / np.linalg.norm(rhs) if failed else 0.0
        finally:
            self.solves, self.products = precondition.count, multiply.count
        if failed:
            raise SolveError(
                Status.UNSOLVED_TANGENT,
                f"GMRES left {left:.1e} of the right-hand side after {self.solves} solves with the incomplete factors: "
                "lower drop_tolerance, raise fill_factor or dimension, or choose a direct solver",
            )
        return x


class IluGmres(LinearSolver):
    """Incomplete LU with thresholds (Li & Shao 2011) as preconditioner of GMRES. The ledger counts every
    triangular solve and every product inside a `solve`.
    """

    kind: Literal["ilu-gmres"] = "ilu-gmres"
    drop_tolerance: float = Field(
        1e-4, ge=0, lt=1, description="entries below this fraction of their column are left out"
    )
    fill_factor: float = Field(
        10.0, ge=1, description="most entries of the factors, in multiples of those of the matrix"
    )
    tolerance: float = Field(1e-10, gt=0, lt=1, description="‖rhs − A x‖/‖rhs‖ at which a solve ends")
    dimension: int = Field(40, gt=0, description="largest dimension of the Krylov space")
    restarts: int = Field(5, ge=0, description="most restarts of a solve, each with an empty Krylov space")

    def factorize(self, matrix: Any, previous: Factors | None = None) -> IncompleteFactors:
        """Incomplete factors of a sparse matrix; `previous` is not used."""
        if not np.isfinite(matrix.data).all():
            raise SolveError(Status.NON_FINITE, "a tangent holds numbers that are not finite")
        return IncompleteFactors(matrix.tocsc(), self)
