"""Supernodal LU, and LDLᵀ for symmetric tangents, by rslab: an extra, nlsolve[rslab].

The analysis of a pattern (ordering, supernodes) is taken from the previous factors as long as the pattern is the same.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from pydantic import Field

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status
from nlsolve_linear.equilibrium import is_symmetric

try:
    import rslab
except ImportError:  # an extra: nlsolve[rslab]
    rslab = None
else:
    rslab.set_log_level("error")  # of a singular matrix it warns on standard error, and raises as well

ABSENT = "needs the library rslab: pip install 'nlsolve[rslab]'"


class RslabFactors(Factors):
    """L and U, or L and D, of one matrix (compressed columns; of a symmetric one the lower triangle)."""

    def __init__(self, columns: Any, path: Literal["lu", "ldlt"], norm: float, previous: Factors | None) -> None:
        self.path, self._norm = path, norm
        self._pattern = columns.indptr, columns.indices
        kept = previous if isinstance(previous, RslabFactors) and self._like(previous) else None
        try:
            # One thread, as for every method that is compared; rslab's own pool does not obey threadpoolctl.
            self._analysis: Any = rslab.analyze(columns, path=path, threads=1) if kept is None else kept._analysis
            self._factors = self._analysis.factor(columns.data)
        except RuntimeError as error:  # rslab's way to say that a pivot vanished
            raise SolveError(Status.SINGULAR_TANGENT, f"rslab: {error}") from error
        used = self._factors.diagnostics()["decisions"]["ordering_used"]
        self.ordering = f"{used}, {path}".lower()
        self.fill = int(self._factors.factor_nnz)

    def _like(self, other: RslabFactors) -> bool:
        """Whether both are factors of the same kind, of matrices with the same stored entries."""
        return self.path == other.path and all(map(np.array_equal, self._pattern, other._pattern))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with A x = rhs by one pair of triangular solves, without rslab's refinement: the ledger refines."""
        return self._factors.solve(np.ascontiguousarray(rhs, dtype=float), refine=0)

    def condition(self) -> float:
        """‖A‖₁ times an estimate of ‖A⁻¹‖₁ (Hager 1984; Higham & Tisseur 2000 with one column: nothing random)."""
        inverse = scipy.sparse.linalg.LinearOperator(
            (self._factors.n, self._factors.n),
            matvec=lambda rhs: self.solve(rhs.ravel()),
            rmatvec=lambda rhs: self._factors.solve_transpose(np.ascontiguousarray(rhs.ravel())),
        )
        return self._norm * float(scipy.sparse.linalg.onenormest(inverse, t=1))


class Rslab(LinearSolver):
    """LU with threshold pivoting, two-sided scaling and the sparsest of several orderings; Bunch & Kaufman (1977) for a
    symmetric matrix, at half the entries.

    Pivots are searched within a supernode only. That is enough for the tangents of flows (residuals at rounding), but
    not for entries spread at random over eight decades: ‖b − A x‖ is then 1e-9 of its terms, and `refinement` = 1
    brings it back to rounding.
    """

    kind: Literal["rslab"] = "rslab"
    symmetric: Literal["detect", "never"] = Field(
        "detect", description="LDLᵀ for a matrix found symmetric to 1e-12, the tangent of a conservative form; or never"
    )
    absent: ClassVar[str | None] = ABSENT if rslab is None else None

    def factorize(self, matrix: Any, previous: Factors | None = None) -> RslabFactors:
        """Factors of a sparse matrix, by the analysis of `previous` if that has the same pattern."""
        if rslab is None:
            raise SolveError(Status.NOT_APPLICABLE, f"the linear solver 'rslab' {ABSENT}")
        if not np.isfinite(matrix.data).all():
            raise SolveError(Status.NON_FINITE, "a tangent holds numbers that are not finite")
        columns = matrix.tocsc(copy=True)  # sorted below; the caller's matrix stays as it is
        columns.sum_duplicates()
        norm = float(abs(columns).sum(axis=0).max())
        if self.symmetric == "detect" and is_symmetric(columns):
            return RslabFactors(sp.tril(columns, format="csc"), "ldlt", norm, previous)
        return RslabFactors(columns, "lu", norm, previous)
