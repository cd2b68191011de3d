"""A linear system has two verbs: `factorize`, then `solve`. The contract of linear solvers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.series import Array


class Factors(ABC):
    """A factorised matrix."""

    ordering: str = "none"
    """Name of the column ordering that was used."""
    fill: int = 0
    """Entries stored in the factors."""
    attempts: int = 1
    """Factorisations carried out to obtain these factors, trials of orderings included: all are counted."""
    solves: int = 1
    """Pairs of triangular solves that the last `solve` carried out: one, but for an iteration."""
    products: int = 0
    """Products with the matrix that the last `solve` carried out."""

    @abstractmethod
    def solve(self, rhs: Array) -> Array:
        """x with A x = rhs: one forward and one backward triangular solve, or as many as `solves` owns up to.

        Raises SolveError when an iteration does not reach the accuracy it was asked for.
        """

    def condition(self) -> float | None:
        """An estimate of ‖A‖₁ ‖A⁻¹‖₁, asked for off the clock; None when the library gives no transposed solves."""
        return None


class LinearSolver(Component, ABC):
    """Factorises sparse matrices. Iterative refinement is asked for here and carried out, and counted, outside."""

    noun: ClassVar[str] = "linear"
    default_kind: ClassVar[str | None] = "superlu"

    refinement: int = Field(0, ge=0, description="steps of iterative refinement after each triangular solve")

    @abstractmethod
    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        """Factors of a sparse matrix; `previous` ones of a like pattern may lend their ordering or their analysis.

        Raises SolveError: singular tangent, when the matrix is singular to working precision; non-finite.
        """
