"""u_0, u_1, … → u* : the check of nonlinear solvers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np

from nlsolve.contracts.nonlinear_solver import KeptTangent, NonlinearSolver, Step
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import Status
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.matrices import CheckedOperator
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing.promises import require, same
from nlsolve.testing.toy_problem import DenseLU, ToyProblem


def check_solver(solver: NonlinearSolver, rule: RefreshRule | None = None) -> None:
    """Check a method on a toy problem under the driver.

    The start is yielded first; neither it nor a state yielded later is changed; the problem is solved to 1e-10; all
    work asked of the linear solver and the problem is in the ledger; K* is made of the case's iteration operator if and
    only if the method says so (`uses_operator`). Raises AssertionError.

    rule : the refresh rule of K*; without one K* is renewed at every iteration.
    """
    problem, ledger, asked_before = ToyProblem(), Ledger(), DenseLU.asked.copy()
    tangent = Tangent(DenseLU(), rule, ledger)
    start = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
    kept = start.copy()
    seen: list[tuple[Array, Array]] = []

    class Watched(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
            for step in solver.steps(problem, tangent, start):
                seen.append((step.state, step.state.copy()))
                yield step

    outcome = solve(problem, Watched(), tangent, start, StoppingTest(tolerance=1e-11), Budget(), ledger)
    require(
        outcome.status is Status.CONVERGED,
        f"the toy problem was not solved: {outcome.detail}",
    )
    same(outcome.state, ToyProblem.solution, 1.0, "the solution of the toy problem")
    require(np.array_equal(seen[0][1], kept), "the first state yielded must be the start itself")
    require(np.array_equal(start, kept), "the method changed the array it was given as its start")
    require(all(np.array_equal(a, b) for a, b in seen), "the method changed a state after it had yielded it")
    counts = ledger.counts
    require(counts["triangular_solve"] > 0, "the method never used K*: tangent.solve is where its work shows")
    require(counts["residual"] + counts["series_order"] > 0, "the method asked for no residual and no coefficient")
    for kind, asked in (DenseLU.asked - asked_before).items():
        require(counts[kind] == asked, f"{asked} of kind {kind} were asked for and {counts[kind]} are in the ledger")
    _check_operator(solver, rule, kept)


class _Doubled(IterationOperator):
    """2 J(u), with which every step is half of Newton's; counts how often it is asked for."""

    kind: Literal["doubled"] = "doubled"
    asked: ClassVar[Counter[str]] = Counter()

    def matrix(self, problem: NonlinearProblem, u: Array) -> Any:
        self.asked["matrix"] += 1
        return 2.0 * problem.jacobian(u)


def _check_operator(solver: NonlinearSolver, rule: RefreshRule | None, start: Array) -> None:
    """Whether the method asks for another iteration operator, or makes K* of a matrix of its own, as it declares."""
    before = _Doubled.asked["matrix"]
    ledger = Ledger()
    tangent = Tangent(DenseLU(), rule, ledger, operator=CheckedOperator(_Doubled()))
    outcome = solve(ToyProblem(), solver, tangent, start, StoppingTest(tolerance=1e-6), Budget(), ledger)
    if solver.uses_operator:
        asked = _Doubled.asked["matrix"] - before
        require(asked, "the method says that it uses the iteration operator, and never asked: problem.operator(state)")
        renewals = tangent.renewals
        require(asked == renewals, f"K* was renewed {renewals} times, and the operator was asked {asked} times")
    else:
        status = outcome.status
        require(status is Status.NOT_APPLICABLE, f"an operator that the method ignores ended as {status.word!r}")
