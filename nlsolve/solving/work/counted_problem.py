"""The problem as a method receives it: R(u) = 0 with its work counted and timed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from nlsolve.algebra.measure import Measure
from nlsolve.contracts.problem import Expansion, NonlinearProblem, norm
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, NoSeries, NoSeriesHere
from nlsolve.solving.matrices import CheckedOperator
from nlsolve.solving.work.counted_matrix import CountedMatrix, counted
from nlsolve.solving.work.ledger import Ledger


@contextmanager
def refused_here() -> Iterator[None]:
    """Turn NoSeriesHere, which a formula raises at some states, into SolveError (non-finite)."""
    try:
        yield
    except NoSeriesHere as refusal:
        raise SolveError(Status.NON_FINITE, str(refusal)) from refusal


class CountedExpansion(Expansion):
    """An expansion whose order j counts as one `series_order` and j `series_term`: it convolves j earlier orders."""

    def __init__(self, expansion: Expansion, ledger: Ledger) -> None:
        self._expansion, self._ledger = expansion, ledger
        self._known = 1  # R_0 is the residual, counted where the expansion was made

    def coefficient(self, j: int) -> Array:
        """R_j, (U,). Unknown orders up to j are computed and counted; a known order costs nothing."""
        while self._known <= j:
            with self._ledger.entry("series_order"), refused_here():
                self._expansion.coefficient(self._known)
            self._ledger.counts["series_term"] += self._known
            self._known += 1
        return self._expansion.coefficient(j)

    def remainder(self, j: int) -> Array:
        """Q_j, (U,), counted as one order. R_j is not known from it and counts when it is asked for."""
        self.coefficient(j - 1)
        with self._ledger.entry("series_order"), refused_here():
            return self._expansion.remainder(j)

    def append(self, coefficient: Array) -> None:
        """Push u_j, (U,), which is not counted."""
        self._expansion.append(coefficient)

    def path(self, a: float) -> Array:
        """u(a), (U,), which is not counted."""
        return self._expansion.path(a)


class CountedProblem(NonlinearProblem):
    """A problem whose residuals, Jacobians, products with them and series are entered in a ledger.

    operator : what K* is made of; None: J(u).

    The driver judges the states of a method by `uncounted_residual` and by the `measure` of the solve.
    """

    def __init__(self, problem: NonlinearProblem, ledger: Ledger, operator: CheckedOperator | None = None) -> None:
        self._problem, self._ledger, self._operator = problem, ledger, operator
        self.operator_is_jacobian = operator is None
        self._last: tuple[Array, Array] | None = None  # of the method
        self._judged: tuple[Array, Array] | None = None  # of the driver
        self._scales: dict[bytes, float] = {}
        self.measure: Measure | None = None
        self.is_gradient = problem.is_gradient
        self.has_other_discretizations = problem.has_other_discretizations

    @property
    def has_series(self) -> bool:
        """See `NonlinearProblem`."""
        return self._problem.has_series

    @property
    def has_scale(self) -> bool:
        """See `NonlinearProblem`."""
        return self._problem.has_scale

    def residual(self, u: Array) -> Array:
        """R(u), (U,), counted as a residual."""
        with self._ledger.entry("residual"):
            residual = self._problem.residual(u)
        self._last = u.copy(), residual.copy()  # a method may overwrite its arrays later
        return residual

    def jacobian(self, u: Array) -> CountedMatrix:
        """J(u), (U, U), counted as a Jacobian. Raises SolveError (not applicable) when the problem has none."""
        return self._assembled(self._problem.jacobian, u)

    def secant(self, u: Array) -> CountedMatrix:
        """A(u), (U, U), counted as a Jacobian. Raises SolveError (not applicable) when the problem has none."""
        return self._assembled(self._problem.secant, u)

    def operator(self, u: Array) -> CountedMatrix:
        """The matrix that K* is made of at u, (U, U), counted as a Jacobian.

        Raises SolveError when the problem or the operator has none, or one that cannot be used.
        """
        operator = self._operator
        return self.jacobian(u) if operator is None else self._assembled(lambda u: operator.matrix(self._problem, u), u)

    def newtonian(self, u: Array, rate: float | None) -> CountedMatrix:
        """See `NonlinearProblem`; counted as a Jacobian."""
        return self._assembled(lambda u: self._problem.newtonian(u, rate), u)

    def jacobian_by(self, discretizer: Any, u: Array) -> CountedMatrix:
        """See `NonlinearProblem`; counted as a Jacobian."""
        return self._assembled(lambda u: self._problem.jacobian_by(discretizer, u), u)

    def _assembled(self, assemble: Callable[[Array], Any], u: Array) -> CountedMatrix:
        way_out = "define its method `jacobian`"
        with self._ledger.entry("jacobian"), self._not_applicable_without_series(way_out):
            matrix = assemble(u)
        return counted(matrix, self._ledger)

    def expand(self, u: Array) -> Expansion:
        """The expansion around u (U,), counted as an expansion and a residual, which is its R_0.

        Raises SolveError (not applicable) when the problem has none.
        """
        way_out = "choose a method that needs no series, such as newton or anderson"
        with self._ledger.entry("residual"), self._not_applicable_without_series(way_out):
            expansion = self._problem.expand(u)
            expansion.coefficient(0)
        self._ledger.counts["expansion"] += 1
        return CountedExpansion(expansion, self._ledger)

    @contextmanager
    def _not_applicable_without_series(self, way_out: str) -> Iterator[None]:
        """Turn NoSeries, which a formula raises, into SolveError (not applicable; non-finite where it is a matter of
        the state).
        """
        try:
            with refused_here():
                yield
        except NoSeries as refusal:
            name = type(self._problem).__name__
            raise SolveError(
                Status.NOT_APPLICABLE, f"the formula of {name} has no Taylor series: {refusal}; or {way_out}"
            ) from refusal

    def undefined(self, u: Array) -> str:
        """See `NonlinearProblem`; not counted."""
        return self._problem.undefined(u)

    def blame(self, u: Array, residual: Array) -> Mapping[str, float]:
        """See `NonlinearProblem`; not counted."""
        return self._problem.blame(u, residual)

    def scale(self, u: Array) -> float:
        """The size that ‖R(u)‖ is divided by. At a state where the driver knows it, a method reads it at no cost;
        elsewhere it is counted as a residual.
        """
        if u.tobytes() in self._scales:
            return self._scales[u.tobytes()]
        with self._ledger.entry("residual"):
            return self._problem.scale(u)

    def size(self, residual: Array) -> float:
        """See `NonlinearProblem`; by the measure of the solve, at no cost."""
        return norm(self.weighted(residual))

    def weighted(self, residual: Array) -> Array:
        """See `NonlinearProblem`."""
        return residual if self.measure is None else self.measure.weighted(residual)

    def first_residual(self, u: Array) -> Array:
        """R(u) (U,) of a problem without a scale, not counted or timed; nothing is asked of one with a scale."""
        return np.zeros_like(u) if self.has_scale else self._problem.residual(u)

    def judged_by(self, measure: Measure, start: Array) -> None:
        """Compare residuals by `measure` from now on; the scale at `start` (U,) is its own, at no cost."""
        self.measure, self._scales[start.tobytes()] = measure, measure.absolute

    def uncounted_residual(self, u: Array) -> Array:
        """R(u), (U,), not counted and not timed; not evaluated where the method or the driver has asked for it last."""
        for known in (self._last, self._judged):
            if known is not None and np.array_equal(u, known[0]):
                return known[1]
        residual = self._problem.residual(u)
        self._judged = u.copy(), residual
        return residual
