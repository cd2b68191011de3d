"""The way to a first state, which many cases share: solved by one of them, and taken by the others.

A case takes a recorded outcome instead of solving when its problem begins at the same start, is prepared in the same
manner, and has the same residual at the recorded state. Whatever else differs, it solves for itself from there on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Preparation, Solve
from nlsolve.contracts.status import STOPPED, SolveError, Status
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger

ROUNDING = 1e-8
"""Largest change of a relative residual, solved to a tolerance as loose as may be, that another machine explains."""


@dataclass(frozen=True)
class Stretch:
    """One solve on the way: how it ended, and its work.

    start : digest of the state that it began with and of how it was prepared.
    outcome : its steps are counted, but empty.
    counts, seconds : its work by kind, as in a ledger.
    """

    start: str
    outcome: Outcome
    counts: Mapping[str, int]
    seconds: Mapping[str, float]

    @classmethod
    def of(cls, task: Solve, outcome: Outcome, work: Ledger) -> Stretch:
        """The stretch that a task was solved by."""
        steps: tuple[dict[str, Any], ...] = ({},) * len(outcome.rows)
        return cls(_digest(task), replace(outcome, rows=steps), dict(work.counts), dict(work.seconds))

    def serves(self, task: Solve) -> bool:
        """Whether this is how `task` would end. Evaluates one residual, which is not counted."""
        assert task.preparation is not None
        if self.start != _digest(task):
            return False
        if self.outcome.status is not Status.CONVERGED:
            return True
        norm = float(np.linalg.norm(task.problem.residual(self.outcome.state))) / task.problem.scale(task.start)
        recorded = self.outcome.residual_norm
        return abs(norm - recorded) <= min(max(task.preparation.tolerance, recorded), ROUNDING)


@dataclass(frozen=True)
class Way:
    """The stretches of a way, in order; the last may have failed."""

    stretches: tuple[Stretch, ...]


class Walk:
    """A case on its way to its first state: it takes what another case has solved as far as that serves, then solves.

    ledger : the work of the way, apart from that of the case's method.
    way : as another case has solved it.
    share : is called with the way when it has ended, if some of it was solved here.
    """

    def __init__(self, linear: LinearSolver, ledger: Ledger, way: Way, share: Callable[[Way], None]) -> None:
        self.ledger, self._linear, self._share = ledger, linear, share
        self._kept_for: tuple[RefreshRule | None, int] = (None, 0)
        self._tangent = Tangent(linear, None, ledger)
        self._known, self._walked, self._is_news = way.stretches, list[Stretch](), False
        self._last: Solve | None = None

    def outcome(self, task: Solve) -> Outcome:
        """How a problem on the way ends."""
        number = len(self._walked)
        if number < len(self._known) and self._known[number].serves(task):
            stretch = self._known[number]
            self.ledger.add(stretch.counts, stretch.seconds)
            self._walked.append(stretch)
        else:
            self._known = ()
            stretch = self._solved(task)
        self._last = replace(task, start=stretch.outcome.state)
        return stretch.outcome

    def _solved(self, task: Solve) -> Stretch:
        assert task.preparation is not None
        stop = StoppingTest(kind="residual", tolerance=task.preparation.tolerance)
        budget = Budget(iterations=task.preparation.iterations)
        self._keep_for(task.preparation.refresh, len(task.start))
        begun = self.ledger.copy()
        with self.ledger.entry("stage"):
            outcome = solve(task.problem, task.preparation.solver, self._tangent, task.start, stop, budget, self.ledger)
        stretch = Stretch.of(task, outcome, self.ledger.since(begun))
        if outcome.status not in STOPPED:
            self._walked.append(stretch)
            self._is_news = True
        return stretch

    def _keep_for(self, rule: RefreshRule | None, size: int) -> None:
        """Keep K* as long as the rule and the number of unknowns stay; with another rule no ordering is taken over."""
        before = self._kept_for
        self._kept_for = rule, 0 if rule is None else size
        if self._kept_for != before:
            pattern = self._tangent.factors if rule == before[0] else None
            self._tangent = Tangent(self._linear, rule, self.ledger, pattern)

    def end(self) -> None:
        """The way has ended, at the first state or before it."""
        if self._is_news:
            self._share(Way(tuple(self._walked)))
            self._is_news = False

    def ordered(self) -> Factors | None:
        """Factors on the way, whose ordering may be used again; of a way that was taken whole, they are not counted."""
        if self._tangent.factors is None and self._last is not None:
            with suppress(SolveError):  # a tangent that cannot be factorised has no ordering to give
                return self._linear.factorize(self._last.problem.jacobian(self._last.start))
        return self._tangent.factors


def _digest(task: Solve) -> str:
    assert task.preparation is not None
    return hashlib.sha256(_bytes(task.start) + _words(task.preparation).encode()).hexdigest()


def _bytes(state: Array) -> bytes:
    return np.ascontiguousarray(state, dtype=float).tobytes()


def _words(preparation: Preparation) -> str:
    solver = preparation.solver
    rule = "" if preparation.refresh is None else preparation.refresh.model_dump_json()
    said = f"{type(solver).__qualname__} {solver.model_dump_json()} {preparation.tolerance} {preparation.iterations}"
    return f"{said} {rule}"
