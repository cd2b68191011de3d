"""The matrices of one case: K* as its iteration operator makes it, checked, and J(u), kept while u stays the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array

RANKED = 300  # unknowns up to which the rank of a matrix is counted


def why_singular(matrix: Any) -> str:
    """Why a sparse (U, U) matrix, taken for J, is singular: by its first column or row of zeros, or by its rank."""
    sizes = abs(sp.csr_array(matrix))
    columns, rows = (np.flatnonzero(sizes.max(axis=axis).toarray() == 0.0) for axis in (0, 1))
    size = matrix.shape[0]
    if len(columns) == size:
        return "J = 0, so that R does not change with any unknown to first order"
    if len(columns):
        return f"R does not change with u[{columns[0]}]{_and_others(columns)} to first order"
    if len(rows):
        return f"R[{rows[0]}]{_and_others(rows)} does not change with any unknown to first order"
    if size <= RANKED:
        rank = int(np.linalg.matrix_rank(matrix.toarray()))
        if rank < size:
            return f"the rank of J is {rank} of {size}, so that some equations repeat others to first order"
    return "some equations repeat others to first order, to working precision"


def _and_others(found: NDArray[np.intp]) -> str:
    return f" and {len(found) - 1} more" if len(found) > 1 else ""


class CheckedOperator:
    """The assembly of one march of an operator that is not the tangent."""

    def __init__(self, operator: IterationOperator) -> None:
        self.name = f"the operator {operator.kind_name()!r}"
        self._assembly = operator.begin()

    @property
    def renewable(self) -> bool:
        """See `Assembly`."""
        return self._assembly.renewable

    def solved(self, problem: NonlinearProblem, u: Array) -> None:
        """See `Assembly`."""
        self._assembly.solved(problem, u)

    def matrix(self, problem: NonlinearProblem, u: Array) -> Any:
        """K*, sparse (U, U). Raises SolveError when what the operator gave is no square matrix (U, U) (not applicable)
        or not finite (non-finite).
        """
        matrix, size = self._assembly.matrix(problem, u), len(u)
        shape = getattr(matrix, "shape", None)
        if not (isinstance(matrix, np.ndarray) or sp.issparse(matrix)) or shape is None or len(shape) != 2:
            raise self.refusal(Status.NOT_APPLICABLE, f"gave a {type(matrix).__name__}, which is no matrix")
        if shape[0] != shape[1]:
            raise self.refusal(Status.NOT_APPLICABLE, f"gave a K* of shape {shape}, which is not square")
        if shape[0] != size:
            raise self.refusal(Status.NOT_APPLICABLE, f"gave a K* of {shape[0]} unknowns for a problem of {size}")
        rows = sp.csr_array(matrix)
        if not np.isfinite(rows.data).all():
            raise self.refusal(Status.NON_FINITE, "gave a K* with numbers that are not finite")
        return rows

    def refusal(self, status: Status, why: str) -> SolveError:
        """The error that names the operator, what is wrong with its K*, and the way out."""
        kind = IterationOperator.default_kind
        return SolveError(status, f'{self.name} {why}: correct it, or leave `operator` at its default, "{kind}"')


def checked(operator: IterationOperator) -> CheckedOperator | None:
    """The operator for one march; None when K* is J(u), which needs neither memory nor check."""
    return None if operator.is_tangent else CheckedOperator(operator)


class CachedJacobian:
    """u -> J(u), sparse (U, U), which keeps the last J.

    For a method that both factorises J into K* and multiplies with it at the same u (U,).
    """

    def __init__(self, problem: NonlinearProblem) -> None:
        self._problem = problem
        self._last: tuple[Array, Any] | None = None

    def __call__(self, u: Array) -> Any:
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), self._problem.jacobian(u)
        return self._last[1]

    def operator(self, u: Array) -> Any:
        """What K* is made of at u, sparse (U, U): the J that is kept, unless the case has another operator."""
        return self(u) if self._problem.operator_is_jacobian else self._problem.operator(u)


def cached_jacobian(problem: NonlinearProblem) -> CachedJacobian:
    """J of a problem, kept while u stays the same."""
    return CachedJacobian(problem)
