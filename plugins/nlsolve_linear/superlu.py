"""P A Q = L U by SciPy's SuperLU; the column ordering Q is chosen by trying several on the first matrix."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse.linalg
from pydantic import Field

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status

# Columns of AᵀA for unsymmetric patterns, of Aᵀ + A (with symmetric mode and weak pivoting) for nearly symmetric ones.
ORDERINGS: dict[str, dict[str, Any]] = {
    "mmd-ata": {"permc_spec": "MMD_ATA"},
    "colamd": {"permc_spec": "COLAMD"},
    "mmd-at-plus-a": {
        "permc_spec": "MMD_AT_PLUS_A",
        "diag_pivot_thresh": 1e-3,
        "options": {"SymmetricMode": True},
    },
    "natural": {"permc_spec": "NATURAL"},
}
CANDIDATES = ("mmd-ata", "colamd", "mmd-at-plus-a")
REUSED = ("mmd-ata", "colamd")  # they cost a fifth to a half of a factorisation; ordering Aᵀ + A costs next to nothing


class SuperLUFactors(Factors):
    """L and U of one matrix A (compressed columns), or of A[:, order] with the order of an earlier, equal pattern."""

    def __init__(self, matrix: Any, ordering: str, previous: SuperLUFactors | None = None) -> None:
        self.ordering, self._pattern = ordering, (matrix.indptr, matrix.indices)
        self.lends = ordering in REUSED
        earlier = previous if previous is not None and ordering in REUSED and previous._like(self) else None
        # A[:, columns] is factorised, and x = y[places] of its solution y.
        self._columns: Any = slice(None) if earlier is None else earlier._order
        self._places: Any = slice(None) if earlier is None else earlier._inverse
        try:
            if earlier is None:
                self._factors = scipy.sparse.linalg.splu(matrix, **ORDERINGS[ordering])
            else:
                self._factors = scipy.sparse.linalg.splu(matrix[:, self._columns], permc_spec="NATURAL")
        except MemoryError as error:
            raise SolveError(Status.OUT_OF_MEMORY, "SuperLU has no memory for the factors") from error
        except RuntimeError as error:  # SuperLU's one way to say that a pivot vanished, or that it got no memory
            status = Status.OUT_OF_MEMORY if "MALLOC" in str(error) else Status.SINGULAR_TANGENT
            raise SolveError(status, f"SuperLU: {error}") from error
        self._inverse: np.ndarray = self._factors.perm_c if earlier is None else earlier._inverse
        self._order: np.ndarray = np.argsort(self._inverse) if earlier is None else earlier._order
        self.fill = int(self._factors.nnz)
        self._norm = float(abs(matrix).sum(axis=0).max())

    def _like(self, other: SuperLUFactors) -> bool:
        """Whether both have the same ordering, of matrices with the same stored entries."""
        return self.ordering == other.ordering and all(map(np.array_equal, self._pattern, other._pattern))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with A x = rhs by one pair of triangular solves."""
        return self._factors.solve(rhs)[self._places]

    def condition(self) -> float:
        """‖A‖₁ times an estimate of ‖A⁻¹‖₁ (Hager 1984; Higham & Tisseur 2000 with one column: nothing random)."""
        inverse = scipy.sparse.linalg.LinearOperator(
            self._factors.shape,
            matvec=lambda rhs: self.solve(rhs.ravel()),
            rmatvec=lambda rhs: self._factors.solve(rhs.ravel()[self._columns], "T"),
        )
        return self._norm * float(scipy.sparse.linalg.onenormest(inverse, t=1))


class SuperLU(LinearSolver):
    """LU with partial pivoting (Li 2005). `auto` factorises the first matrix with each candidate ordering and keeps the
    one with the fewest entries in the factors, so that the choice is the same on every machine.
    """

    kind: Literal["superlu"] = "superlu"
    ordering: Literal["auto", "mmd-ata", "colamd", "mmd-at-plus-a", "natural"] = Field(
        "auto", description="column ordering; auto tries three on the first matrix and keeps the sparsest factors"
    )

    def for_one_matrix(self) -> SuperLU:
        """With the ordering for nearly symmetric patterns, which those of flows are, where it would be tried for."""
        return self.model_copy(update={"ordering": "mmd-at-plus-a"}) if self.ordering == "auto" else self

    def factorize(self, matrix: Any, previous: Factors | None = None) -> SuperLUFactors:
        """Factors of a sparse matrix. With `previous` the ordering chosen there is kept, and with it the order of the
        columns as long as the pattern is the same.
        """
        if not np.isfinite(matrix.data).all():
            raise SolveError(Status.NON_FINITE, "a tangent holds numbers that are not finite")
        columns = matrix.tocsc()
        kept = previous if isinstance(previous, SuperLUFactors) else None
        if self.ordering != "auto":
            return SuperLUFactors(columns, self.ordering, kept)
        if kept is not None:
            return SuperLUFactors(columns, kept.ordering, kept)
        sparsest = min((SuperLUFactors(columns, name) for name in CANDIDATES), key=lambda factors: factors.fill)
        sparsest.attempts = len(CANDIDATES)
        return sparsest
