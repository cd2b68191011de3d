"""A linear system has two verbs: `factorize`, then `solve`. The contract of linear solvers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.series import Array


class Factors(ABC):
    """A factorised matrix A, with the cost of the factorisation and of the last `solve`."""

    ordering: str = "none"
    """Name of the column ordering that was used."""
    fill: int = 0
    """Entries stored in the factors."""
    chosen: str | None = None
    """Kind of the linear solver that made them, where one chooses among several."""
    lends: bool = True
    """Whether later factorisations are cheaper with these as `previous`."""
    attempts: int = 1
    """Factorisations carried out to obtain these factors, including trials of orderings; all of them are counted."""
    solves: int = 1
    """Pairs of triangular solves that the last `solve` carried out: 1 for a direct solver, more for an iteration."""
    products: int = 0
    """Products with the matrix that the last `solve` carried out."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """x with A x = rhs, both of shape (U,). Costs as many pairs of triangular solves as `solves` says afterwards.

        Raises SolveError (unsolved tangent) when an iterative solver does not reach its accuracy.
        """

    def condition(self) -> float | None:
        """An estimate of ‖A‖₁ ‖A⁻¹‖₁, which is not timed; None when the library gives no transposed solves."""
        return None


class LinearSolver(Component, ABC):
    """Factorises sparse matrices. The tangent K* carries out and counts the `refinement` that is declared here."""

    noun: ClassVar[str] = "linear"
    default_kind: ClassVar[str | None] = "auto"

    refinement: int = Field(default=0, ge=0, description="steps of iterative refinement after each triangular solve")

    @abstractmethod
    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        """The factors of a sparse (U, U) matrix.

        previous : factors of a matrix with a similar pattern, whose ordering or symbolic analysis may be used again.
        Raises SolveError: singular tangent when the matrix is singular to working precision, non-finite when an entry
        is not a finite number.
        """

    def for_one_matrix(self) -> LinearSolver:
        """The same solver for a matrix that is factorised once, without trials that only later ones would repay."""
        return self
