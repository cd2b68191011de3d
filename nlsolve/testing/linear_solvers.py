"""A x = b : the check of linear solvers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import require, same, shaped


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
    kept, factors, last = rhs.copy(), None, matrix
    turned = matrix[random.permutation(60)]
    rows = {
        "an unsymmetric matrix": matrix,
        "another matrix of its pattern": like,
        "the first matrix again": matrix,
        "a symmetric matrix": (matrix + matrix.T).tocsr(),
        "the first matrix with its rows in another order, which has zeros on its diagonal,": turned,
        "the first matrix, after all others,": matrix,
    }
    for told, A in rows.items():
        lent, entries = factors, A.data.copy()
        name = "zero diagonal" if A is turned else "solves"
        meaning = {
            "zero diagonal": "a matrix with zeros on its diagonal is solved with: the contract promises every square "
            "matrix that is not singular, so choose pivots",
            "solves": "A x = b to 1e-10 for matrices of equal and of other patterns",
        }[name]
        with promise(name, meaning):
            try:
                factors = linear.factorize(A, lent)
                x = factors.solve(rhs)
            except SolveError as error:
                raise AssertionError(f"{told} is not singular, and was refused: {error}") from error
            shaped(x, (60,), "x")
            require(x.dtype.kind == "f", f"x of {x.dtype} numbers, which should be real")
            same(A @ x, kept, 1.0, f"A x against b, {told.rstrip(',')}")
        if lent is not None:
            with promise("lent factors", "factors stay usable when they are lent as `previous`"):
                same(last @ lent.solve(rhs), kept, 1.0, "A x against b, by factors that were lent since")
        with promise("no mutation", "neither the matrix nor the right-hand side is changed"):
            require(np.array_equal(rhs, kept), "solve changed its right-hand side")
            require(np.array_equal(A.data, entries), "factorize changed the matrix it was given")
        if factors is not None:
            _check_told(factors, rhs)
        last = A
    with promise("determinism", "the same matrix and right-hand side give the same x"):
        first, second = (linear.factorize(matrix).solve(rhs) for _ in range(2))
        require(np.array_equal(first, second), "x is another when the same system is solved again")
    with promise("one unknown", "a matrix of one row is solved with"):
        same(linear.factorize(sp.csr_array([[4.0]])).solve(np.array([2.0])), 0.5, 1.0, "x of 4 x = 2")
    _check_refused(linear, matrix)


def _check_told(factors: Factors, rhs: Array) -> None:
    with promise("ordering and fill", "the factors name their ordering and tell their fill"):
        require(factors.ordering not in ("", "none"), "the ordering of the factors has no name")
        require(factors.fill > 0, "fill must tell how many entries the factors hold")
    with promise("counts", "the factors tell their factorisations, triangular solves and products"):
        factors.solve(rhs)
        require(factors.attempts >= 1, "attempts must count every factorisation carried out")
        require(factors.solves >= 1, "solves must count every pair of triangular solves carried out")
        require(factors.products >= factors.solves - 1, "each further solve of an iteration follows a product")
    with promise("zero", "A x = 0 is solved by x = 0"):
        require(not factors.solve(np.zeros(60)).any(), "A x = 0 was not solved by x = 0")


def _check_refused(linear: LinearSolver, matrix: Any) -> None:
    """A matrix that is singular or not finite must end in SolveError with the status that says so."""
    row, column, not_finite = matrix.toarray(), matrix.toarray(), matrix.copy()
    row[7] = 0.0
    column[:, 7] = 0.0
    for what, dense in (("row", row), ("column", column)):
        with promise("singular", "a singular matrix ends in SolveError(Status.SINGULAR_TANGENT)"):
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
        with promise("not finite", "a matrix with NaN or inf ends in SolveError(Status.NON_FINITE)"):
            try:
                linear.factorize(not_finite)
            except SolveError as error:
                require(error.status is Status.NON_FINITE, f"a matrix with {value} ended as {error.status.word!r}")
            else:
                raise AssertionError(f"a matrix with {value} was factorised: raise SolveError(Status.NON_FINITE)")
