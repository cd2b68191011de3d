"""A x = b by GMRES over Krylov spaces of A K⁻¹, K⁻¹ the factors of an earlier matrix or those of a coarser cloud."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.flow.accuracy.two_grids import TwoGrids
from nlsolve.series import Array

ACCURATE = 1e-3
"""‖b − A x‖/‖b‖ that GMRES is asked for."""

POOR = 0.1
"""What is left by it above which A is factorised."""

DIMENSION = 20
"""Largest dimension of the Krylov space."""


class KeptFactors(LinearSolver):
    """Factorises the first matrix of a solve, and a later one only where GMRES fails with the factors so far; none,
    as long as it does not fail, where the tangent on a coarser cloud has been factorised.

    For a few Newton steps that need not be exact, on a matrix too large to be factorised at each (Saad & Schultz 1986,
    preconditioned on the right, so that what GMRES tests is the true residual).

    linear : the linear solver that factorises.
    coarser : the tangent on a coarser cloud (`Coarser`); None without one.
    """

    kind: Literal["kept-factors"] = "kept-factors"
    linear: Any
    coarser: Any = None

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Preconditioned:
        """The matrix with its own factors, or with those that `previous` has."""
        earlier = previous.factors if isinstance(previous, Preconditioned) else None
        if self.coarser is not None and (earlier is None or isinstance(earlier, TwoGrids)):
            earlier = TwoGrids(matrix, self.coarser)
        return Preconditioned(matrix, self.linear, earlier)


class Preconditioned(Factors):
    """A matrix (U, U), and the factors of it, of an earlier one, or two grids.

    factors : those that precondition the next solve.
    """

    def __init__(self, matrix: Any, linear: LinearSolver, earlier: Factors | None) -> None:
        self._matrix, self._linear = matrix, linear
        self._own = earlier is None
        self.factors = linear.factorize(matrix) if earlier is None else earlier

    def solve(self, rhs: Array) -> Array:
        """x with A x = rhs to `ACCURATE`, exactly where A has been factorised. Raises what the factorisation raises."""
        if not self._own:
            x = self._by_gmres(rhs)
            if np.linalg.norm(rhs - self._matrix @ x) <= POOR * np.linalg.norm(rhs):
                return x
            self._renew()
        return self.factors.solve(rhs)

    def _renew(self) -> None:
        """Factorise A; earlier factors that do not help give up their memory first."""
        earlier = self.factors if self.factors.lends else None
        del self.factors
        self.factors, self._own = self._linear.factorize(self._matrix, earlier), True

    def _by_gmres(self, rhs: Array) -> Array:
        product = scipy.sparse.linalg.LinearOperator(
            self._matrix.shape, matvec=lambda v: self._matrix @ self.factors.solve(v), dtype=float
        )
        found, _ = scipy.sparse.linalg.gmres(product, rhs, rtol=ACCURATE, restart=DIMENSION, maxiter=1)
        return self.factors.solve(found)
