"""The tangent K*, kept until a refresh rule asks for a new one; it may serve many increments."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.nonlinear_solver import KeptTangent
from nlsolve.contracts.rules.refresh import RefreshRule, TangentHistory
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array
from nlsolve.solving.matrices import CheckedOperator, why_singular
from nlsolve.solving.work.counted_matrix import CountedMatrix, counted, plain
from nlsolve.solving.work.ledger import Ledger

SMALLEST = 1e-16  # a smaller contraction is rounding, and counts as this one
WAY_OUT = "choose the solver robust, which gets away from such a state, or another start"
RECENT = 10.0  # solves after which an earlier rate weighs 1/e


class Tangent(KeptTangent):
    """The tangent K* of one case: its factors, its history and its refresh rule.

    rule : when K* is renewed; None: at every iteration.
    pattern : factors of a matrix with a similar pattern, whose ordering may be used again.
    linear : the linear solver of the case.
    operator : what K* is made of, where that is not the tangent.
    renewals : how often K* has been renewed.
    withheld : how often the rule has asked for a new K* when the operator had no other.
    """

    def __init__(
        self,
        linear: LinearSolver,
        rule: RefreshRule | None,
        ledger: Ledger,
        pattern: Factors | None = None,
        operator: CheckedOperator | None = None,
    ) -> None:
        self.linear, self._rule, self._ledger, self._pattern = linear, rule, ledger, pattern
        self.operator = operator
        self._matrix: CountedMatrix | None = None
        self.factors: Factors | None = None
        self.renewals = self.withheld = 0
        self._forget()

    def _forget(self) -> None:
        """Nothing has been observed of this K* yet."""
        self._uses = self._solves = 0
        self._contraction: float | None = None
        self._range: float | None = None
        self._digits = 0.0
        self._rate: float | None = None
        self._accounted = 0  # solves whose digits are known
        self._told = False  # whether the method has reported a contraction since the last step, with this K*

    @property
    def history(self) -> TangentHistory:
        """What has been observed of this K* since it was factorised."""
        return TangentHistory(self._uses, self._contraction, self._range, self._solves, self._digits, self._rate)

    def refresh_if_due(self, assemble: Callable[[], Any]) -> bool:
        """See `KeptTangent`; the factorisation is entered in the ledger."""
        due = self.factors is None or self._rule is None or self._rule.due(self.history)
        if due and self.factors is not None and self.operator is not None and not self.operator.renewable:
            due = False
            self.withheld += 1
        if due:
            self._matrix = counted(assemble(), self._ledger)
            self.factors = self._factorized(self._matrix)
            self._forget()
            self.renewals += 1
        self._uses += 1
        return due

    def _factorized(self, matrix: CountedMatrix) -> Factors:
        try:
            with self._ledger.entry("factorization"):
                factors = self.linear.factorize(plain(matrix), self.factors or self._pattern)
        except SolveError as error:
            why = error.detail
            if error.status is Status.SINGULAR_TANGENT and self.operator is None:
                why = f"{why_singular(plain(matrix))} ({why}); {WAY_OUT}"
            raise self._blamed(error.status, why) from error
        self._ledger.counts["factorization"] += factors.attempts - 1
        return factors

    def solve(self, rhs: Array) -> Array:
        """x = K*⁻¹ rhs, (U,), then `refinement` steps x += K*⁻¹ (rhs − K* x) as the linear solver declares.

        Raises SolveError when the right-hand side (non-finite) or the answer (singular tangent) is not finite, and
        TypeError when there is no K* yet.
        """
        if self.factors is None or self._matrix is None:
            raise TypeError("there is no tangent yet: call refresh_if_due before solve")
        if self.operator is not None and len(rhs) != self._matrix.shape[0]:
            why = f"keeps a K* of {self._matrix.shape[0]} unknowns, and the problem has {len(rhs)} now"
            raise self.operator.refusal(Status.NOT_APPLICABLE, why)
        if not np.isfinite(rhs).all():
            raise SolveError(Status.NON_FINITE, "a right-hand side for the tangent was not finite")
        x = self._solved(self.factors, rhs)
        for _ in range(self.linear.refinement):
            x = x + self._solved(self.factors, rhs - self._matrix @ x)
        self._solves += 1
        if not np.isfinite(x).all():
            why = "a solve with the tangent gave no finite answer"
            if self.operator is None:
                why = f"{why}: {why_singular(plain(self._matrix))}; {WAY_OUT}"
            raise self._blamed(Status.SINGULAR_TANGENT, why)
        return x

    def _blamed(self, status: Status, why: str) -> SolveError:
        """The error, which names the operator where K* is not the tangent."""
        if self.operator is None:
            return SolveError(status, why)
        return self.operator.refusal(status, f"gave a K* that cannot be used ({why or status.sentence})")

    def _solved(self, factors: Factors, rhs: Array) -> Array:
        """One `solve` of the factors. The solves and products that they report are counted, also when it fails."""
        with self._ledger.entry("triangular_solve"):
            try:
                return factors.solve(rhs)
            finally:
                self._ledger.counts["triangular_solve"] += factors.solves - 1
                self._ledger.counts["matrix_product"] += factors.products

    def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
        """See `KeptTangent`."""
        if contraction is not None:
            self._told = True
            solves, self._accounted = self._solves - self._accounted, self._solves
            rate, before = -math.log10(max(contraction, SMALLEST)), self._rate
            self._digits += solves * rate
            if before is not None:
                rate = before + (rate - before) * (1.0 - math.exp(-solves / RECENT))
            self._contraction, self._rate = contraction, rate
        if range is not None:
            self._range = range

    def step_taken(self, contraction: float | None) -> None:
        """Give the refresh rule the contraction of a step, unless the method has reported one itself.

        contraction : ‖R_new‖/‖R_old‖ as the driver has measured it; None at the start of a solve.
        """
        if contraction is not None and not self._told:
            self.observe(contraction=contraction)
        self._told = False

    def facts(self) -> dict[str, Any]:
        """Choice, ordering, fill and condition of the last factors, by the names in `nlsolve.results.columns.RUNS`."""
        factors = self.factors
        return {
            "linear_chosen": factors.chosen if factors else None,
            "ordering": factors.ordering if factors else None,
            "fill": factors.fill if factors else None,
            "condition": factors.condition() if factors else None,
        }
