"""K*: a factorised tangent, kept until a refresh rule asks for a new one. It outlives the increment it was made in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.nonlinear_solver import KeptTangent
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import Evidence, RefreshRule
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array
from nlsolve.solving.ledger import Ledger, SealedMatrix, factorize_counted, solve_counted

SMALLEST = 1e-16  # contraction by which digits are counted: beyond it lies rounding
RECENT = 10.0  # solves whose digits weigh most in their recent rate


class Tangent:
    """The kept tangent of one march: its factors, what has been observed of it, and its refresh rule.

    Without a rule it is renewed at every iteration. `pattern` are factors of a like matrix, which may lend their
    ordering. Methods see it through `view` only.
    """

    def __init__(
        self, linear: LinearSolver, rule: RefreshRule | None, ledger: Ledger, pattern: Factors | None = None
    ) -> None:
        self._linear, self._rule, self._ledger, self._pattern = linear, rule, ledger, pattern
        self._matrix: SealedMatrix | None = None
        self.factors: Factors | None = None
        self.evidence = Evidence()
        self.branches = 0
        self._observed = 0  # solves that `digits` accounts for
        self.view: KeptTangent = _view(self)

    def refresh_if_due(self, problem: NonlinearProblem, state: Array) -> bool:
        """Factorise J(state) when there is no tangent yet or the rule says so; True when that happened."""
        due = self.factors is None or self._rule is None or self._rule.due(self.evidence)
        if due:
            self._matrix = problem.jacobian(state)
            self.factors = factorize_counted(self._linear, self._matrix, self.factors or self._pattern, self._ledger)
            self.evidence, self._observed = Evidence(), 0
            self.branches += 1
        self.evidence = replace(self.evidence, uses=self.evidence.uses + 1)
        return due

    def solve(self, rhs: Array) -> Array:
        """K*⁻¹ rhs. Raises SolveError when the tangent or the right-hand side gives no finite answer."""
        if self.factors is None or self._matrix is None:
            raise TypeError("there is no tangent yet: call refresh_if_due before solve")
        if not np.isfinite(rhs).all():
            raise SolveError(Status.NON_FINITE, "a right-hand side for the tangent was not finite")
        x = solve_counted(self.factors, self._matrix, rhs, self._linear.refinement, self._ledger)
        self.evidence = replace(self.evidence, solves=self.evidence.solves + 1)
        if not np.isfinite(x).all():
            raise SolveError(Status.SINGULAR_TANGENT, "a solve with the tangent gave no finite answer")
        return x

    def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
        """Note what the refresh rule should know about the last step."""
        if contraction is not None:
            solves, self._observed = self.evidence.solves - self._observed, self.evidence.solves
            rate, before = -float(np.log10(max(contraction, SMALLEST))), self.evidence.rate
            digits = self.evidence.digits + solves * rate
            if before is not None:
                rate = before + (rate - before) * (1.0 - np.exp(-solves / RECENT))
            self.evidence = replace(self.evidence, contraction=contraction, digits=digits, rate=rate)
        if range is not None:
            self.evidence = replace(self.evidence, range=range)

    def facts(self) -> dict[str, Any]:
        """What the last factors know of themselves, under the names of `nlsolve.results.columns.RUNS`."""
        factors = self.factors
        return {
            "ordering": factors.ordering if factors else None,
            "fill": factors.fill if factors else None,
            "condition": factors.condition() if factors else None,
        }


def _view(tangent: Tangent) -> KeptTangent:
    """The three verbs a method may use; the tangent lives in this closure, not in an attribute."""

    class View:
        def refresh_if_due(self, problem: NonlinearProblem, state: Array) -> bool:
            return tangent.refresh_if_due(problem, state)

        def solve(self, rhs: Array) -> Array:
            return tangent.solve(rhs)

        def observe(self, *, contraction: float | None = None, range: float | None = None) -> None:
            tangent.observe(contraction=contraction, range=range)

    return View()
