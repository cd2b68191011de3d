"""A x = b : the check of linear solvers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.status import SolveError, Status
from nlsolve.testing.promises import require, same


def check_linear_solver(linear: LinearSolver) -> None:
    """Check A x = b to 1e-10 on matrices of equal and of other patterns, one symmetric, one with zeros on its diagonal.

    Each matrix is factorised with the factors of the one before as `previous`, which must stay usable. The factors must
    name their ordering, and tell their fill and the work of each solve. A matrix that is singular or not finite must
    end in SolveError. Raises AssertionError.
    """
    random = np.random.default_rng(0)
    matrix = sp.random_array((60, 60), density=0.1, rng=random, format="csr")
    matrix = (matrix + sp.diags_array(1.0 + abs(matrix).sum(axis=1))).tocsr()
    like = matrix.copy()
    like.data *= 1.0 + 0.5 * random.random(like.nnz)
    rhs = random.standard_normal(60)
    kept = rhs.copy()
    factors, last = None, matrix
    for A in (matrix, like, matrix, (matrix + matrix.T).tocsr(), matrix[random.permutation(60)], matrix):
        lent, factors = factors, linear.factorize(A, factors)
        same(A @ factors.solve(rhs), kept, 1.0, "A x against b")
        if lent is not None:
            same(last @ lent.solve(rhs), kept, 1.0, "A x against b, by factors that were lent since")
        require(np.array_equal(rhs, kept), "solve changed its right-hand side")
        require(factors.ordering not in ("", "none"), "the ordering of the factors has no name")
        require(factors.fill > 0, "fill must tell how many entries the factors hold")
        require(factors.attempts >= 1, "attempts must count every factorisation carried out")
        require(factors.solves >= 1, "solves must count every pair of triangular solves carried out")
        require(factors.products >= factors.solves - 1, "each further solve of an iteration follows a product")
        require(not factors.solve(np.zeros(60)).any(), "A x = 0 was not solved by x = 0")
        last = A
    _check_refused(linear, matrix)


def _check_refused(linear: LinearSolver, matrix: Any) -> None:
    """A matrix that is singular or not finite must end in SolveError with the status that says so."""
    row, column, not_finite = matrix.toarray(), matrix.toarray(), matrix.copy()
    row[7] = 0.0
    column[:, 7] = 0.0
    for what, dense in (("row", row), ("column", column)):
        try:
            linear.factorize(sp.csr_array(dense)).solve(np.ones(60))
        except SolveError as error:
            refused = error.status in (Status.SINGULAR_TANGENT, Status.UNSOLVED_TANGENT)
            require(refused, f"a singular matrix ended as {error.status.word!r}")
        else:
            raise AssertionError(
                f"a matrix with a {what} of zeros was factorised and solved with without a word: "
                "raise SolveError(Status.SINGULAR_TANGENT)"
            )
    for value in (np.nan, np.inf):
        not_finite.data[5] = value
        try:
            linear.factorize(not_finite)
        except SolveError as error:
            require(error.status is Status.NON_FINITE, f"a matrix with {value} ended as {error.status.word!r}")
        else:
            raise AssertionError(f"a matrix with {value} was factorised: raise SolveError(Status.NON_FINITE)")
