"""Solvers, linear solvers and rules that each break one promise of their contract."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp
from nlsolve_linear import SuperLU
from nlsolve_rules import FullSteps
from nlsolve_rules.operators import TangentHere
from nlsolve_rules.predictors import Polynomial
from nlsolve_rules.refresh import EveryM
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy.forms import NewtonForm
from nlsolve_solvers.homotopy.ranges import Ratio

from nlsolve.plugin import (
    Factors,
    Globalization,
    HomotopyForm,
    IterationOperator,
    LinearSolver,
    NonlinearSolver,
    Predictor,
    Range,
    RangeRule,
    RefreshRule,
    SolveError,
    Status,
    Step,
)


class PlantedSolver(NonlinearSolver):
    """Newton's method that breaks one promise."""

    kind: Literal["planted"] = "planted"
    breaks: str
    used: ClassVar[list[bool]] = []

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start + 0.1 if self.breaks == "start" else start
        number = 0
        self.used.append(True)
        length = 1.0 - 1e-5 * len(self.used) if self.breaks == "determinism" else 1.0
        while True:
            yield Step(
                {"states": state.astype(complex), "integers": np.rint(state).astype(int)}.get(self.breaks, state)
            )
            number += 1
            if self.breaks == "counted work" and number % 2:
                state = state * (1.0 + 1e-14) + 1e-16
                continue
            if self.breaks == "kept tangent":
                state = state - np.linalg.solve(problem.jacobian(state).toarray(), problem.residual(state))
                continue
            if self.breaks == "singular" and np.linalg.cond(problem.jacobian(state).toarray()) > 1e12:
                raise ZeroDivisionError("by a plugin")
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            change = (0.5 if self.breaks == "solves" and number > 3 else length) * tangent.solve(
                problem.residual(state)
            )
            if self.breaks == "solves" and number > 3:
                return
            if self.breaks == "no mutation":
                state -= change
            else:
                state = state - change
            here = "overflow" if (start < 0.0).all() else "not a number"
            if self.breaks == here and not np.isfinite(problem.residual(state)).all():
                raise ZeroDivisionError("by a plugin")


class Boasting(PlantedSolver):
    """Says that it uses the operator, and does not."""

    kind: Literal["boasting"] = "boasting"  # type: ignore[assignment]
    uses_operator: ClassVar[bool] = True


class PlantedFactors(Factors):
    def __init__(self, breaks: str, factors: Factors, matrix: Any, calls: list[int]) -> None:
        self._breaks, self._factors, self._matrix, self._calls = breaks, factors, matrix, calls
        self.ordering = "" if breaks == "ordering and fill" else factors.ordering
        self.fill = factors.fill
        self.solves = 0 if breaks == "counts" else 1

    def solve(self, rhs: Any) -> Any:
        if self._breaks == "lent factors" and self._calls[-1] != id(self):
            return np.zeros_like(rhs)
        x = self._factors.solve(rhs)
        if self._breaks == "zero":
            return x + 1e-13
        if self._breaks == "solves":
            return x * (1.0 + 1e-6)
        if self._breaks == "complex":
            return x + 0.0j
        if self._breaks == "determinism":
            self._calls.append(0)
            return x * (1.0 + 1e-14 * len(self._calls))
        if self._breaks == "no mutation":
            rhs[0] += 1.0
        return x


class PlantedLinear(LinearSolver):
    """SuperLU that breaks one promise."""

    kind: Literal["planted"] = "planted"
    breaks: str
    calls: ClassVar[list[int]] = []

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        given = matrix
        if self.breaks == "zero diagonal" and not matrix.diagonal().all():
            raise SolveError(Status.SINGULAR_TANGENT, "a pivot is zero")
        if self.breaks == "singular" and np.isfinite(matrix.data).all():
            dense = matrix.toarray()
            empty = ~dense.any(axis=0) | ~dense.any(axis=1)
            given = sp.csr_array(dense + np.diag(empty * 1.0))
        if self.breaks == "not finite":
            given = matrix.copy()
            given.data = np.nan_to_num(given.data, posinf=1.0)
        if self.breaks == "one unknown" and matrix.shape[0] == 1:
            raise IndexError("index 1 is out of bounds")
        if self.breaks == "mutates":
            matrix.data *= 1.0 + 1e-15
        factors = PlantedFactors(self.breaks, SuperLU().factorize(given), matrix, self.calls)
        if self.breaks != "determinism":
            self.calls.append(id(factors))
        return factors


class PlantedRefresh(RefreshRule):
    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def due(self, history: Any) -> Any:
        if self.breaks == "answer":
            return history.contraction > 0.5 if history.contraction is not None else None
        self.asked.append(1)
        return len(self.asked) % 2 == 0


class PlantedOperator(IterationOperator):
    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def matrix(self, problem: Any, u: Any) -> Any:
        if self.breaks == "usable":
            return np.zeros((3, len(u)))
        if self.breaks == "determinism":
            self.asked.append(1)
            return float(len(self.asked)) * problem.jacobian(u)
        if self.breaks == "no mutation":
            u *= 1.0 + 1e-12
        return 1.1 * problem.jacobian(u)


class FalseTangent(PlantedOperator):
    kind: Literal["false-tangent"] = "false-tangent"  # type: ignore[assignment]
    is_tangent: ClassVar[bool] = True


class PlantedPredictor(Predictor):
    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    @property
    def depth(self) -> int:
        return 0 if self.breaks == "depth" else 1

    def guess(self, past: Any) -> Any:
        if self.breaks == "shape":
            return past[0].ravel()
        if self.breaks == "steady":
            return 1.01 * past[0]
        if self.breaks == "no mutation":
            past[0] *= 1.0 + 1e-13
        self.asked.append(1)
        return past[0] * (1.0 + (1e-14 * len(self.asked) if self.breaks == "determinism" else 0.0))


class PlantedSearch:
    def __init__(self, breaks: str, asked: list[int]) -> None:
        self._breaks, self._asked = breaks, asked

    def length(self, problem: Any, state: Any, residual: Any, direction: Any, predicted: float = 1.0) -> Any:
        self._asked.append(1)
        t = {"length": -1.0, "full step": 0.5, "determinism": 0.5 ** len(self._asked)}.get(self._breaks, 1.0)
        found = problem.residual(state + (0.5 if self._breaks == "residual" else t) * direction)
        if self._breaks == "no mutation":
            state += direction
        return t, found


class PlantedGlobalization(Globalization):
    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def search(self, problem: Any) -> Any:
        return PlantedSearch(self.breaks, self.asked)


class PlantedRange(RangeRule):
    kind: Literal["planted"] = "planted"
    breaks: str
    asked: ClassVar[list[int]] = []

    def limit(self, branch: Any, tolerance: float, used: bool) -> Range:
        self.asked.append(1)
        found = Ratio().limit(branch, tolerance, used).a_max
        if self.breaks == "no mutation":
            branch.terms[0] *= 1.0 + 1e-12
        broken = {
            "range": -1.0,
            "determinism": found * (1.0 + 1e-12 * len(self.asked)),
            "unused": found if used else 1e9,
            "growth": 1.0 / found,
        }
        return Range(broken.get(self.breaks, found))


class PlantedRecurrence:
    def __init__(self, breaks: str, inner: Any, state: Any) -> None:
        self._breaks, self._inner, self._state, self._asked = breaks, inner, state, 0

    def right_hand_side(self) -> Any:
        self._asked += 1
        if self._breaks == "no mutation":
            self._state *= 1.0 + 1e-13
        r = self._inner.right_hand_side()
        if self._breaks == "again":
            return r * (1.0 + 1e-14 * self._asked)
        return -r if self._breaks == "first" else r

    def append(self, w: Any) -> None:
        self._inner.append(2.0 * w if self._breaks == "order" else w)

    def miss(self, *arguments: Any) -> Any:
        return self._inner.miss(*arguments)


class PlantedForm(HomotopyForm):
    kind: Literal["planted"] = "planted"
    breaks: str

    def recurrence(self, problem: Any, state: Any) -> Any:
        return PlantedRecurrence(self.breaks, NewtonForm().recurrence(problem, state), state)


SOLVERS = {
    **{
        (check, check): PlantedSolver(breaks=check)
        for check in (
            "states",
            "solves",
            "start",
            "no mutation",
            "kept tangent",
            "counted work",
            "determinism",
            "singular",
            "not a number",
            "overflow",
        )
    },
    ("states", "integers"): PlantedSolver(breaks="integers"),
    ("operator", "boasting"): Boasting(breaks="operator"),
}
LINEAR = {
    **{
        (check, check): PlantedLinear(breaks=check)
        for check in (
            "solves",
            "zero diagonal",
            "lent factors",
            "no mutation",
            "ordering and fill",
            "counts",
            "zero",
            "determinism",
            "one unknown",
            "singular",
            "not finite",
        )
    },
    ("solves", "complex"): PlantedLinear(breaks="complex"),
    ("no mutation", "mutates"): PlantedLinear(breaks="mutates"),
}
RULES = {
    **{("refresh", check): PlantedRefresh(breaks=check) for check in ("answer", "determinism")},
    **{("operator", check): PlantedOperator(breaks=check) for check in ("usable", "determinism", "no mutation")},
    ("operator", "tangent"): FalseTangent(breaks="tangent"),
    **{
        ("predictor", check): PlantedPredictor(breaks=check)
        for check in ("depth", "shape", "steady", "no mutation", "determinism")
    },
    **{
        ("globalization", check): PlantedGlobalization(breaks=check)
        for check in ("length", "residual", "no mutation", "full step", "determinism")
    },
    **{
        ("range", check): PlantedRange(breaks=check)
        for check in ("range", "determinism", "unused", "growth", "no mutation")
    },
    **{("form", check): PlantedForm(breaks=check) for check in ("first", "again", "order", "no mutation")},
}
SOUND = (Newton(), SuperLU(), EveryM(m=2), TangentHere(), Polynomial(), FullSteps(), Ratio(), NewtonForm())
