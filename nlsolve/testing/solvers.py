"""u_0, u_1, … → u* : the check of nonlinear solvers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np

from nlsolve.contracts.nonlinear_solver import KeptTangent, NonlinearSolver, Step
from nlsolve.contracts.outcome import Outcome
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
from nlsolve.testing.kit.odd_problems import ODD, OddProblem
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import require, same
from nlsolve.testing.toy_problem import DenseLU, ToyProblem


def check_solver(solver: NonlinearSolver, rule: RefreshRule | None = None) -> None:
    """Check a method on a toy problem under the driver, and on problems that no method can solve.

    The start is yielded first; states are real arrays of its shape; neither it nor a state yielded later is changed;
    the problem is solved to 1e-10, twice by the same states; all work asked of the linear solver and the problem is in
    the ledger; K* is made of the case's iteration operator if and only if the method says so (`uses_operator`); a
    singular, an undefined and an overflowing problem end in a status. Raises AssertionError.

    rule : the refresh rule of K*; without one K* is renewed at every iteration.
    """
    with promise("states", "every state is a real array of the shape of the start"):
        run = _OnToy(solver, rule)
    with promise("solves", "A u + sinh u = b is solved to 1e-10"):
        status = run.outcome.status
        require(status is Status.CONVERGED, f"the toy problem was not solved: {run.outcome.detail}")
        same(run.outcome.state, ToyProblem.solution, 1.0, "the solution of the toy problem")
    with promise("start", "the first state yielded is the start itself"):
        require(run.seen, "no state was yielded")
        require(np.array_equal(run.seen[0][1], run.kept), "the first state yielded must be the start itself")
    with promise("no mutation", "neither the start nor a state that was yielded is changed"):
        require(np.array_equal(run.start, run.kept), "the method changed the array it was given as its start")
        unchanged = all(np.array_equal(a, b) for a, b in run.seen)
        require(unchanged, "the method changed a state after it had yielded it")
    with promise("kept tangent", "linear systems are solved by K*, and every solve and factorisation is counted"):
        counts = run.ledger.counts
        require(counts["triangular_solve"] > 0, "the method never used K*: tangent.solve is where its work shows")
        require(counts["residual"] + counts["series_order"] > 0, "the method asked for no residual and no coefficient")
        for kind, asked in run.asked.items():
            told = f"{asked} of kind {kind} were asked for and {counts[kind]} are in the ledger"
            require(counts[kind] == asked, told)
    with promise("counted work", "no step leads to another state without work that is counted"):
        idle = run.outcome.idle
        require(not idle, f"{idle} of {run.outcome.iterations} steps without a residual, Jacobian, solve or order")
    with promise("operator", "K* is problem.operator(state) if the class says uses_operator, and only then"):
        _check_operator(solver, rule, run.kept)
    with promise("determinism", "a second solve yields the same states: what is kept is of one solve"):
        again = _OnToy(solver, rule)
        alike = len(again.seen) == len(run.seen)
        alike = alike and all(np.array_equal(a[1], b[1]) for a, b in zip(run.seen, again.seen, strict=True))
        require(alike, "a second solve of the same problem yielded other states")
    for odd in ODD:
        with promise(odd.name, odd.meaning):
            _check_odd(solver, rule, odd)


class _OnToy:
    """One solve of the toy problem. seen : the states yielded, as they were given and as they were then."""

    def __init__(self, solver: NonlinearSolver, rule: RefreshRule | None) -> None:
        self.ledger = Ledger()
        self.start = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
        self.kept = self.start.copy()
        self.seen: list[tuple[Array, Array]] = []
        asked_before, tangent, seen = DenseLU.asked.copy(), Tangent(DenseLU(), rule, self.ledger), self.seen

        class Watched(NonlinearSolver):
            uses_operator: ClassVar[bool] = solver.uses_operator

            @classmethod
            def called(cls) -> str:
                return solver.called()

            def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
                for step in solver.steps(problem, tangent, start):
                    if isinstance(step, Step) and isinstance(step.state, np.ndarray):
                        seen.append((step.state, step.state.copy()))
                    yield step

        stop = StoppingTest(tolerance=1e-11)
        try:
            self.outcome: Outcome = solve(ToyProblem(), Watched(), tangent, self.start, stop, Budget(), self.ledger)
        except TypeError as error:
            raise AssertionError(str(error)) from error
        self.asked = DenseLU.asked - asked_before


def _check_odd(solver: NonlinearSolver, rule: RefreshRule | None, odd: OddProblem) -> None:
    """A problem that cannot be solved ends in a status that does not claim a solution; nothing is raised."""
    ledger = Ledger()
    tangent = Tangent(DenseLU(), rule, ledger)
    try:
        outcome = solve(odd.problem(), solver, tangent, odd.start.copy(), StoppingTest(), Budget(iterations=60), ledger)
    except Exception as error:  # a stranger's method may raise anything
        raise AssertionError(
            f"raised {type(error).__name__}: {error}: let what K* and the problem raise pass, or raise SolveError"
        ) from error
    far = outcome.status is Status.CONVERGED and not odd.is_root(outcome.state)
    require(not far, f"{outcome.state} was reported as a solution")


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
