"""The linear solver by the size of the matrix and by what is installed."""

from __future__ import annotations

from typing import Any, Literal

from nlsolve.plugin import Factors, LinearSolver, SolveError, Status
from nlsolve_linear.pardiso import Pardiso
from nlsolve_linear.rslab import Rslab
from nlsolve_linear.superlu import SuperLU

SMALL = 400
"""Unknowns up to which SuperLU serves."""

FASTEST: tuple[type[LinearSolver], ...] = (Pardiso, Rslab, SuperLU)
"""For larger matrices, the fastest first."""


class Auto(LinearSolver):
    """SuperLU for a small matrix; for a larger one the first that is installed of PARDISO, rslab and SuperLU.

    Where that finds the matrix singular, the next one is asked: those with pivots in supernodes give up earlier than
    SuperLU, which has the last word. No orderings are tried, so that factorisations are counted alike whatever is
    installed. The column `linear_chosen` says which it was.
    """

    kind: Literal["auto"] = "auto"

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        """Factors by the first linear solver that can; what has been tried is counted."""
        candidates = self.of_size(matrix.shape[0])
        for tried, linear in enumerate(candidates, start=1):
            try:
                factors = linear.factorize(matrix, previous)
            except SolveError as error:
                if error.status is not Status.SINGULAR_TANGENT or linear is candidates[-1]:
                    raise
            else:
                factors.chosen = linear.called()
                factors.attempts += tried - 1
                return factors
        raise AssertionError("SuperLU is always there")

    def of_size(self, unknowns: int) -> list[LinearSolver]:
        """The linear solvers for a matrix of so many unknowns, the first choice first."""
        if unknowns <= SMALL:
            return [SuperLU(ordering="colamd")]
        return [kind().for_one_matrix() for kind in FASTEST if kind.absent is None]
