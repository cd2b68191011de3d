"""R(u) = 0 with all that is asked of it counted and timed: the problem as a method receives it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, NoSeries
from nlsolve.solving.counted_matrix import CountedMatrix, counted
from nlsolve.solving.ledger import Ledger


class CountedExpansion(Expansion):
    """Each new order is a `series_order`, and j series terms, for order j convolves j earlier ones."""

    def __init__(self, expansion: Expansion, ledger: Ledger) -> None:
        self._expansion, self._ledger = expansion, ledger
        self._known = 1  # R_0 is the residual, counted where the expansion was made

    def coefficient(self, j: int) -> Array:
        """R_j. Orders that are skipped over are computed and counted too; an order asked for again is not."""
        while self._known <= j:
            with self._ledger.entry("series_order"):
                self._expansion.coefficient(self._known)
            self._ledger.counts["series_term"] += self._known
            self._known += 1
        return self._expansion.coefficient(j)

    def remainder(self, j: int) -> Array:
        """Q_j, which costs an order of its own: the coefficient R_j is not known by it."""
        self.coefficient(j - 1)
        with self._ledger.entry("series_order"):
            return self._expansion.remainder(j)

    def append(self, coefficient: Array) -> None:
        self._expansion.append(coefficient)

    def path(self, a: float) -> Array:
        return self._expansion.path(a)


class CountedProblem(NonlinearProblem):
    """A problem whose residuals, Jacobians, products with them and series are entered in a ledger.

    The driver, which checks what a method did, asks for `uncounted_residual` and `uncounted_scale`.
    """

    def __init__(self, problem: NonlinearProblem, ledger: Ledger) -> None:
        self._problem, self._ledger = problem, ledger
        self._last: tuple[Array, Array] | None = None
        self._scales: dict[bytes, float] = {}
        self.is_gradient = problem.is_gradient

    @property
    def has_series(self) -> bool:
        return self._problem.has_series

    def residual(self, u: Array) -> Array:
        with self._ledger.entry("residual"):
            residual = self._problem.residual(u)
        self._last = u.copy(), residual.copy()  # a method may go on working in its arrays
        return residual

    def jacobian(self, u: Array) -> CountedMatrix:
        return self._assembled(self._problem.jacobian, u)

    def secant(self, u: Array) -> CountedMatrix:
        """A(u), which is assembled like a Jacobian and counted as one."""
        return self._assembled(self._problem.secant, u)

    def _assembled(self, assemble: Callable[[Array], Any], u: Array) -> CountedMatrix:
        way_out = "define its method `jacobian`"
        with self._ledger.entry("jacobian"), self._not_applicable_without_series(way_out):
            matrix = assemble(u)
        return counted(matrix, self._ledger)

    def expand(self, u: Array) -> Expansion:
        way_out = "choose a method that needs no series, such as newton or anderson"
        with self._ledger.entry("residual"), self._not_applicable_without_series(way_out):
            expansion = self._problem.expand(u)
            expansion.coefficient(0)
        self._ledger.counts["expansion"] += 1
        return CountedExpansion(expansion, self._ledger)

    @contextmanager
    def _not_applicable_without_series(self, way_out: str) -> Iterator[None]:
        """Turn a formula's refusal of series into the ending of a method that needs one."""
        try:
            yield
        except NoSeries as refusal:
            name = type(self._problem).__name__
            raise SolveError(
                Status.NOT_APPLICABLE, f"the formula of {name} has no Taylor series: {refusal}; or {way_out}"
            ) from refusal

    def blame(self, u: Array, residual: Array) -> Mapping[str, float]:
        return self._problem.blame(u, residual)

    def scale(self, u: Array) -> float:
        """What ‖R‖ is compared with. Where the driver has asked for it a method may read it for nothing, as it may read
        its tolerance; elsewhere it costs what a residual costs.
        """
        if u.tobytes() in self._scales:
            return self._scales[u.tobytes()]
        with self._ledger.entry("residual"):
            return self._problem.scale(u)

    def uncounted_scale(self, u: Array) -> float:
        """What ‖R‖ is compared with, off the clock."""
        scale = self._scales[u.tobytes()] = self._problem.scale(u)
        return scale

    def uncounted_residual(self, u: Array) -> Array:
        """R(u), off the clock; not evaluated again where the method has just evaluated it at this very state."""
        if self._last is not None and np.array_equal(u, self._last[0]):
            return self._last[1]
        return self._problem.residual(u)
