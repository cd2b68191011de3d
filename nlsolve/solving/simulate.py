"""One case from its components to its record: the problems of its scene's simulation, solved under the driver."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pandas as pd

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Entry, Simulation, Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.results.columns import REPORTED, run_columns
from nlsolve.results.frames import steps_frame
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent


class Method(Protocol):
    """The components of every case: what solves its problems, and when that stops."""

    @property
    def linear(self) -> LinearSolver: ...
    @property
    def solver(self) -> NonlinearSolver: ...
    @property
    def refresh(self) -> RefreshRule: ...
    @property
    def stop(self) -> StoppingTest: ...
    @property
    def budget(self) -> Budget: ...


@dataclass(frozen=True)
class Progress:
    """What a listener is told after every increment."""

    increment: int
    increments: int
    tangents: int
    factorizations: int


@dataclass(frozen=True)
class Record:
    """What one case leaves: its row of `runs`, its rows of `steps`, its `fields` (a row a node and recorded time).

    outcome : how the case ended; of a single solve, all there is to say of it.
    problem, state : the last that was solved, None before the first; for measuring what work on them costs.
    """

    summary: dict[str, Any]
    outcome: Outcome
    steps: pd.DataFrame
    fields: pd.DataFrame = field(default_factory=pd.DataFrame)
    problem: NonlinearProblem | None = None
    state: Array | None = None


def run_case(
    parts: Any,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
    watch: Callable[[Simulation], None] | None = None,
) -> Record:
    """Run the case of these components, by the names of their sections, `scene` among them; see `simulate`."""
    return simulate(lambda entry: parts.scene.simulation(parts, entry), parts, listen, clock, watch)


@np.errstate(all="ignore")  # what is not finite becomes a status, a doubt or a NaN
def simulate(
    build: Callable[[Entry], Simulation],
    method: Method,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
    watch: Callable[[Simulation], None] | None = None,
) -> Record:
    """Solve the problems of a simulation; every ending, failure included, is in the record.

    build : makes the simulation, whose work outside the method is entered in the books it is handed.
    listen : is told how far the case is after every problem its method has solved.
    clock : what seconds are told by.
    watch : is shown the simulation whenever it has kept a state.
    """
    nothing: Callable[[Any], None] = lambda told: None  # noqa: E731
    return _Run(build, method, listen or nothing, clock, watch or nothing).record()


class _Run:
    """One case on its way: its simulation, the books of its own solves, and those of the way to the first state."""

    def __init__(
        self,
        build: Callable[[Entry], Simulation],
        method: Method,
        listen: Callable[[Progress], None],
        clock: Callable[[], float],
        watch: Callable[[Simulation], None],
    ) -> None:
        self.method, self.listen, self.watch = method, listen, watch
        self.ledger, self.start_ledger = Ledger(clock), Ledger(clock)
        self.tangent = Tangent(method.linear, method.refresh, self.ledger)
        self.start_tangent = Tangent(method.linear, None, self.start_ledger)
        self.simulation = build(self.ledger.entry)
        self.rows: list[dict[str, Any]] = []
        self.increments = self.iterations = 0
        self.time = 0.0
        self.validity_time: float | None = None
        self.residual_norm = float("nan")
        self.false_convergence = self.false_failure = 0
        self.blame: Mapping[str, float] = {}
        self.kept: tuple[NonlinearProblem, Array] | None = None

    def record(self) -> Record:
        outcome = self.outcome()
        summary = self.summary(outcome)
        problem, state = self.kept or (None, None)
        return Record(summary, outcome, steps_frame(self.rows), self.simulation.fields(), problem, state)

    def outcome(self) -> Outcome:
        """Solve the problems of the simulation one after the other; how the case ended."""
        solves = self.simulation.solves()
        try:
            task = next(solves)
            while True:
                outcome = self.prepared(task) if task.preparation is not None else self.solved(task)
                task = solves.send(outcome)
        except StopIteration as end:
            return end.value
        except SolveError as error:
            return Outcome(error.status, error.detail, np.zeros(0), np.nan, ())

    def prepared(self, task: Solve) -> Outcome:
        """A solve on the way to the first state, whose work is counted apart."""
        assert task.preparation is not None
        stop = StoppingTest(kind="residual", tolerance=task.preparation.tolerance)
        budget = Budget(iterations=task.preparation.iterations)
        with self.start_ledger.entry("stage"):
            outcome = solve(
                task.problem, task.preparation.solver, self.start_tangent, task.start, stop, budget, self.start_ledger
            )
        self.blame = outcome.blame
        if outcome.status is Status.CONVERGED:
            self.keep(task, outcome)
        return outcome

    def solved(self, task: Solve) -> Outcome:
        """The case's own method on one problem; its rows, counts and largest residual are kept."""
        method, k = self.method, task.increment
        if not self.tangent.renewals:  # in the ordering that the way to the first state settled on
            self.tangent = Tangent(method.linear, method.refresh, self.ledger, self.start_tangent.factors)
        outcome = solve(task.problem, method.solver, self.tangent, task.start, method.stop, method.budget, self.ledger)
        self.iterations += outcome.iterations
        self.false_convergence += outcome.claimed_wrongly
        self.false_failure += outcome.denied_wrongly
        self.blame = outcome.blame
        self.rows += [{"increment": k, "time": task.time, "accepted": False, **row} for row in outcome.rows]
        if self.validity_time is None and self.simulation.increments and self.tangent.renewals > 1:
            self.validity_time = self.time
        before = self.residual_norm if k else np.nan  # of a steady state the last solve counts: a start may repeat it
        self.residual_norm = float(np.fmax(before, outcome.residual_norm))
        if outcome.status is Status.CONVERGED:
            self.increments, self.time = max(k, 1), task.time
            self.rows[-1] |= {"accepted": True, **self.keep(task, outcome)}
        self.listen(
            Progress(
                max(k, self.increments),
                max(self.simulation.increments, 1),
                self.tangent.renewals,
                self.ledger.counts["factorization"],
            )
        )
        return outcome

    def keep(self, task: Solve, outcome: Outcome) -> Mapping[str, float]:
        """A state that solves its problem; returns columns of its last step."""
        self.kept = task.problem, outcome.state
        columns = self.simulation.keep(task, outcome.state)
        self.watch(self.simulation)
        return columns

    def summary(self, outcome: Outcome) -> dict[str, Any]:
        """The row of the case; what the simulation measures is of the last state that was kept."""
        ledger, start = self.ledger, self.start_ledger
        place = self.simulation.place(self.blame)
        validity = self.validity_time
        if validity is None and self.simulation.increments and self.increments:
            validity = self.time  # the first tangent served to the end
        preparation = {
            "start_factorizations": start.counts["factorization"],
            "start_triangular_solves": start.counts["triangular_solve"],
            "start_residuals": start.counts["residual"],
            "seconds_start": start.seconds["stage"],
        }
        return {
            "status": outcome.status.word,
            "message": "; ".join(filter(None, (outcome.message, place))),
            "false_convergence": self.false_convergence,
            "false_failure": self.false_failure,
            **self.blame,
            "increments": self.increments,
            "iterations": self.iterations,
            "tangents": self.tangent.renewals,
            "validity_time": validity,
            **ledger.work(),
            **reported(self.rows),
            **(preparation if self.simulation.prepares else {}),
            "seconds_operators": ledger.seconds["operators"],
            "seconds_all": ledger.seconds["method"] + ledger.seconds["operators"] + start.seconds["stage"],
            **self.tangent.facts(),
            "residual_norm": self.residual_norm,
            **run_columns({**self.simulation.sizes, **self.simulation.measured(outcome)}),
        }


def crashed(error: Exception) -> dict[str, Any]:
    """The row of a case that ended in an error of the program or of a plugin: what it said, and where."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    message = f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})"
    return {"status": Status.CRASHED.word, "message": message}


def reported(rows: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """What the method's library says it did, over all rows of `steps`; None where it says nothing."""
    said = {name: [row[name] for row in rows if name in row] for name in REPORTED}
    return {name: sum(numbers) if numbers else None for name, numbers in said.items()}
