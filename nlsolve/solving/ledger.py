"""Counts and times all work a method asks for, outside the method.

A method is handed a view of its problem and of the kept tangent K*. The views offer residuals, Jacobians, expansions
and solves, each entered here; a Jacobian is handed out sealed, so that it can be multiplied with (counted) and
factorised (counted) but not read. No attribute of a view leads to the uncounted problem, matrix or factors behind it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.series import Array

COUNTED = {
    "factorizations": "factorization",
    "triangular_solves": "triangular_solve",
    "jacobians": "jacobian",
    "residuals": "residual",
    "series_orders": "series_order",
}
"""Columns of `nlsolve.results.columns.RUNS`, and the kinds of work that they count."""

COUNTED_BESIDES = {"expansions": "expansion", "series_terms": "series_term", "matrix_products": "matrix_product"}
"""The same of what a cost model wants to know besides."""

KINDS = ("residual", "jacobian", "matrix_product", "factorization", "triangular_solve", "series_order")


@dataclass
class Ledger:
    """Counts and seconds by kind of work; the kind "method" holds the time spent inside a method, all included.

    clock : seconds since some moment; those the processor worked for this process, which other programs do not
        lengthen, or those that passed.
    """

    clock: Callable[[], float] = time.process_time
    counts: Counter[str] = field(default_factory=Counter)
    seconds: Counter[str] = field(default_factory=Counter)

    @contextmanager
    def entry(self, kind: str) -> Iterator[None]:
        """Count one piece of work of this kind and the time it takes, even if it fails."""
        begun = self.clock()
        try:
            yield
        finally:
            self.seconds[kind] += self.clock() - begun  # type: ignore[assignment]
            self.counts[kind] += 1

    def work(self) -> dict[str, float]:
        """What a method has asked for, and the seconds it took, under the names of `nlsolve.results.columns.RUNS`."""
        return {
            **{column: self.counts[kind] for column, kind in COUNTED.items()},
            "seconds": self.seconds["method"],
            "seconds_factorization": self.seconds["factorization"],
            "seconds_triangular_solve": self.seconds["triangular_solve"],
            "seconds_jacobian": self.seconds["jacobian"],
            "seconds_residual": self.seconds["residual"],
            "seconds_series": self.seconds["series_order"],
            **self.details(),
            "factor_solve_ratio": self.each("factorization") / self.each("triangular_solve"),
        }

    def each(self, kind: str) -> float:
        """Mean seconds of one piece of work of this kind; NaN when there was none."""
        return self.seconds[kind] / self.counts[kind] if self.counts[kind] else float("nan")

    def details(self) -> dict[str, float]:
        """What a cost model wants to know besides the counts and seconds by kind, by the names of columns."""
        asked_for = sum(self.seconds[kind] for kind in KINDS)
        return {
            **{column: self.counts[kind] for column, kind in COUNTED_BESIDES.items()},
            "seconds_own": self.seconds["method"] - asked_for,
        }

    def copy(self) -> Ledger:
        """The books as they are now."""
        return Ledger(self.clock, self.counts.copy(), self.seconds.copy())

    def since(self, before: Ledger) -> Ledger:
        """What has been entered since `before`, a copy of these books, was made."""
        spent = self.copy()
        spent.counts.subtract(before.counts)
        spent.seconds.subtract(before.seconds)
        return spent

    def counted(self) -> dict[str, int]:
        """How often each kind of work was done, by the names of columns."""
        return {column: self.counts[kind] for column, kind in (COUNTED | COUNTED_BESIDES).items()}

    def timed(self) -> dict[str, float]:
        """Seconds by kind of work, "own" for what a method did by itself; together the seconds inside the method."""
        return {kind: self.seconds[kind] for kind in KINDS} | {"own": self.details()["seconds_own"]}


class SealedMatrix:
    """A Jacobian as a method sees it: a shape, products that are counted, a heavier diagonal."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape

    def __matmul__(self, vector: Array) -> Array:
        return _contents[self](vector)

    def transposed_product(self, vector: Array) -> Array:
        """Aᵀ vector, counted as a product."""
        return _contents[self](vector, transposed=True)

    def damped(self, shift: float) -> SealedMatrix:
        """A + shift · diag(A_ii), sealed like A: each A_ii grows in its own direction, and cannot be cancelled."""
        contents = _contents[self]
        heavier = sp.diags_array(shift * contents.matrix.diagonal())
        return _seal(contents.matrix + heavier, contents.ledger)

    def augmented(self, shift: float) -> SealedMatrix:
        """(I, A; Aᵀ/α, −shift D/α) of shape (2 U, 2 U), sealed like A, with D = diag(‖A e_j‖²), α = min_j ‖A e_j‖.

        (I, A; Aᵀ/α, −shift D/α) (r; w) = (b; 0) has w = argmin ‖b − A w‖² + shift ‖D^½ w‖² and r = b − A w: the normal
        equations without AᵀA, whose condition is the square of A's (Björck 1996, 1.6). α makes rows of one size.
        """
        contents = _contents[self]
        columns = sp.linalg.norm(contents.matrix, axis=0)
        alpha = float(columns.min()) or 1.0
        rows = [
            [sp.eye_array(self.shape[0]), contents.matrix],
            [contents.matrix.T / alpha, -sp.diags_array(shift * columns**2 / alpha)],
        ]
        return _seal(sp.block_array(rows, format="csr"), contents.ledger)


class _Contents:
    """What is inside one sealed matrix."""

    def __init__(self, matrix: Any, ledger: Ledger) -> None:
        self.matrix, self.ledger = matrix, ledger

    def __call__(self, vector: Array, transposed: bool = False) -> Array:
        with self.ledger.entry("matrix_product"):
            return (self.matrix.T if transposed else self.matrix) @ vector


_contents: WeakKeyDictionary[SealedMatrix, _Contents] = WeakKeyDictionary()


def _seal(matrix: Any, ledger: Ledger) -> SealedMatrix:
    sealed = SealedMatrix(matrix.shape)
    _contents[sealed] = _Contents(matrix, ledger)
    return sealed


def factorize_counted(linear: LinearSolver, sealed: SealedMatrix, previous: Factors | None, ledger: Ledger) -> Factors:
    """Open a sealed matrix and factorise what is inside; TypeError for a matrix that no ledger has sealed."""
    if not isinstance(sealed, SealedMatrix):
        raise TypeError("only a Jacobian handed out by the problem can be factorised, so that the work is counted")
    with ledger.entry("factorization"):
        factors = linear.factorize(_contents[sealed].matrix, previous)
    ledger.counts["factorization"] += factors.attempts - 1
    return factors


def solve_counted(factors: Factors, sealed: SealedMatrix, rhs: Array, refinement: int, ledger: Ledger) -> Array:
    """x with A x = rhs, and `refinement` steps x += A⁻¹ (rhs − A x), every solve and product counted."""
    x = _solve_entered(factors, rhs, ledger)
    for _ in range(refinement):
        x = x + _solve_entered(factors, rhs - sealed @ x, ledger)
    return x


def _solve_entered(factors: Factors, rhs: Array, ledger: Ledger) -> Array:
    """One `solve` with everything that it says it took, also when it fails."""
    with ledger.entry("triangular_solve"):
        try:
            return factors.solve(rhs)
        finally:
            ledger.counts["triangular_solve"] += factors.solves - 1
            ledger.counts["matrix_product"] += factors.products


class Audited:
    """A problem under audit: `view` for the method, `residual` for whoever checks the method, off the clock."""

    def __init__(self, problem: NonlinearProblem, ledger: Ledger) -> None:
        self._problem = problem
        self._last: tuple[Array, Array] | None = None
        self._scales: dict[bytes, float] = {}
        self.view = _view(problem, ledger, self._remember, self._scales)

    def _remember(self, u: Array, residual: Array) -> None:
        self._last = (u.copy(), residual.copy())

    def scale(self, u: Array) -> float:
        """What ‖R‖ is compared with, uncounted. A method may read it at this u for nothing, as it may its tolerance."""
        self._scales[u.tobytes()] = self._problem.scale(u)
        return self._scales[u.tobytes()]

    def residual(self, u: Array) -> Array:
        """R(u), uncounted; not evaluated again where the method has just evaluated it at this very state."""
        if self._last is not None and np.array_equal(u, self._last[0]):
            return self._last[1]
        return self._problem.residual(u)


def _view(problem: NonlinearProblem, ledger: Ledger, remember: Any, scales: Mapping[bytes, float]) -> NonlinearProblem:
    """The problem as a method sees it. What is behind it lives in these closures, not in attributes."""

    class CountedExpansion(Expansion):
        def __init__(self, expansion: Expansion) -> None:
            known = 1  # the residual itself was computed, and counted, where the expansion was made

            def coefficient(j: int) -> Array:
                nonlocal known
                while known <= j:  # orders that are skipped over are work too; an order asked for again is not
                    with ledger.entry("series_order"):
                        expansion.coefficient(known)
                    ledger.counts["series_term"] += known  # order j convolves j earlier terms
                    known += 1
                return expansion.coefficient(j)

            def remainder(j: int) -> Array:
                coefficient(j - 1)
                with ledger.entry("series_order"):
                    return expansion.remainder(j)

            # Functions, not bound methods: a bound method gives its owner away.
            self._coefficient, self._remainder = coefficient, remainder
            self._append = lambda term: expansion.append(term)
            self._sum = lambda a: expansion.path(a)

        def coefficient(self, j: int) -> Array:
            return self._coefficient(j)

        def remainder(self, j: int) -> Array:
            return self._remainder(j)

        def append(self, coefficient: Array) -> None:
            self._append(coefficient)

        def path(self, a: float) -> Array:
            return self._sum(a)

    def assembled(assemble: Callable[[Array], Any], u: Array) -> SealedMatrix:
        with ledger.entry("jacobian"):
            matrix = assemble(u)
        return _seal(matrix, ledger)

    class CountedProblem(NonlinearProblem):
        def residual(self, u: Array) -> Array:
            with ledger.entry("residual"):
                residual = problem.residual(u)
            remember(u, residual)
            return residual

        def jacobian(self, u: Array) -> SealedMatrix:
            return assembled(problem.jacobian, u)

        def secant(self, u: Array) -> SealedMatrix:
            return assembled(problem.secant, u)  # assembled like a Jacobian, and counted as one

        def expand(self, u: Array) -> Expansion:
            with ledger.entry("residual"):
                expansion = problem.expand(u)
                expansion.coefficient(0)
            ledger.counts["expansion"] += 1
            return CountedExpansion(expansion)

        def scale(self, u: Array) -> float:
            if u.tobytes() in scales:
                return scales[u.tobytes()]
            with ledger.entry("residual"):  # it costs what a residual costs
                return problem.scale(u)

    view = CountedProblem()
    view.is_gradient = problem.is_gradient
    return view
