"""A u + sinh u = b : a problem small enough to try any method on, and LAPACK to solve its linear systems."""

from __future__ import annotations

from collections import Counter
from typing import Any, ClassVar

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, Series


class DenseLU(LinearSolver):
    """A = P L U by LAPACK, for small problems. `asked` counts the work asked of all instances, without a ledger."""

    asked: ClassVar[Counter[str]] = Counter()

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        """The dense factors of a sparse matrix (U, U). Raises SolveError for one that is singular or not finite."""
        self.asked["factorization"] += 1
        dense = matrix.toarray()
        if not np.isfinite(dense).all():
            raise SolveError(Status.NON_FINITE, "the matrix is not finite")
        if not 1.0 / np.linalg.cond(dense, 1) > np.finfo(float).eps:
            raise SolveError(Status.SINGULAR_TANGENT, "the matrix is singular to working precision")
        return _DenseFactors(dense)


class _DenseFactors(Factors):
    def __init__(self, matrix: Array) -> None:
        self._lu = scipy.linalg.lu_factor(matrix)

    def solve(self, rhs: Array) -> Array:
        DenseLU.asked["triangular_solve"] += 1
        return scipy.linalg.lu_solve(self._lu, rhs)


class ToyProblem(NonlinearProblem):
    """A u + sinh u = A u* + sinh u*, tridiagonal A: one solution u*, `solution`, which any method should find."""

    solution = np.sin(np.arange(1.0, 13.0))
    matrix = sp.diags_array([-np.ones(11), 4.0 * np.ones(12), -np.ones(11)], offsets=[-1, 0, 1], format="csr")

    def residual(self, u: Any) -> Any:
        """R(u), (U,)."""
        return self.matrix @ u + np.sinh(u) - (self.matrix @ self.solution + np.sinh(self.solution))

    def scale(self, u: Array) -> float:
        """1, the size of the right-hand side."""
        return 1.0

    def jacobian(self, u: Array) -> Any:
        """J(u) = A + diag(cosh u), sparse (U, U)."""
        DenseLU.asked["jacobian"] += 1
        return (self.matrix + sp.diags_array(np.cosh(u))).tocsr()

    def secant(self, u: Array) -> Any:
        """A + diag(sinh(u)/u), sparse (U, U), whose product with u is A u + sinh u."""
        DenseLU.asked["jacobian"] += 1
        ratio = np.divide(np.sinh(u), u, out=np.ones_like(u), where=u != 0.0)
        return (self.matrix + sp.diags_array(ratio)).tocsr()

    def expand(self, u: Array) -> Expansion:
        """The expansion of R along a path that begins at u (U,)."""
        path = Series(u)
        return Expansion(path, self.residual(path))
