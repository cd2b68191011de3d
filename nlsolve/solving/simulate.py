"""One case from its components to its record: the driver solves the problems of its simulation."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pandas as pd
import scipy

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Entry, Simulation, Solve
from nlsolve.contracts.status import STOPPED, CaseStopped, SolveError, Status
from nlsolve.results.columns import REPORTED, run_columns
from nlsolve.results.frames import iterates_frame, steps_frame
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.matrices import checked
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.way import Walk, Way
from nlsolve.solving.work.ledger import Ledger

LOADED_WHEN_ASKED_FOR = ("interpolate", "optimize", "spatial", "special")
"""Packages of scipy that cases use, which scipy imports when they are first asked for."""


class Method(Protocol):
    """The components that every case has: linear solver, solver, refresh rule, operator, stopping test and budget."""

    @property
    def linear(self) -> LinearSolver: ...
    @property
    def solver(self) -> NonlinearSolver: ...
    @property
    def refresh(self) -> RefreshRule: ...
    @property
    def operator(self) -> IterationOperator: ...
    @property
    def stop(self) -> StoppingTest: ...
    @property
    def budget(self) -> Budget: ...


@dataclass(frozen=True)
class Progress:
    """How far a case is; given to a listener after each solve by the method of the case.

    increment, increments : number of the last increment, and of all increments; a steady state has one.
    tangents, factorizations : tangents K* and matrices factorised so far.
    """

    increment: int
    increments: int
    tangents: int
    factorizations: int


@dataclass(frozen=True)
class Record:
    """The results of one case.

    summary : its row of `runs`.
    outcome : how the case ended; in a case of one solve, the outcome of that solve.
    steps : its rows of `steps`.
    fields : its rows of `fields`, one for each node and recorded time.
    iterates : the state of each row of `steps`, where they are recorded; see `iterates_frame`.
    problem, state : the problem solved last and its solution (U,), on which the cost of work can be timed; None when
        no problem was solved.
    """

    summary: dict[str, Any]
    outcome: Outcome
    steps: pd.DataFrame
    fields: pd.DataFrame = field(default_factory=pd.DataFrame)
    iterates: pd.DataFrame = field(default_factory=pd.DataFrame)
    problem: NonlinearProblem | None = None
    state: Array | None = None


def run_case(
    parts: Any,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
    watch: Callable[[Simulation], None] | None = None,
    way: Way | None = None,
    share: Callable[[Way], None] | None = None,
) -> Record:
    """Run one case.

    parts : has the component of each section as an attribute of that name.
    listen, clock, watch, way, share : see `simulate`.
    """
    iterates = parts.record.iterates
    return simulate(lambda entry: simulation_of(parts, entry), parts, listen, clock, watch, way, share, iterates)


@np.errstate(all="ignore")  # what is not finite becomes a status, a doubt or a NaN
def simulate(
    build: Callable[[Entry], Simulation],
    method: Method,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
    watch: Callable[[Simulation], None] | None = None,
    way: Way | None = None,
    share: Callable[[Way], None] | None = None,
    iterates: bool = False,
) -> Record:
    """Solve the problems of a simulation. A solve that fails becomes the status of the record, not an error.

    build : makes the simulation from the ledger's `entry`, which times its work outside the method.
    listen : called with a `Progress` after each solve by the method of the case.
    clock : returns the seconds by which work is timed.
    watch : called with the simulation whenever it has kept a state.
    way : the way to the first state as another case has solved it, whose outcomes are taken as far as they serve.
    share : called with the way to the first state when it is solved, or has failed; not when it was taken whole.
    iterates : whether the state of each row of `steps` is recorded.
    """
    for name in LOADED_WHEN_ASKED_FOR:  # before a clock runs: importing them is no work of the method
        getattr(scipy, name)
    nothing: Callable[[Any], None] = lambda told: None  # noqa: E731
    run = _Run(build, method, listen or nothing, clock, watch or nothing, way or Way(()), share or nothing)
    run.iterates = [] if iterates else None
    return run.record()


class _Refused(Simulation):
    """A simulation that could not be built: the case ends with what its scene raised."""

    def __init__(self, refusal: SolveError) -> None:
        self._refusal = refusal

    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        raise self._refusal
        yield

    def sample(self) -> tuple[NonlinearProblem, Array]:
        raise self._refusal

    def diagnostics(self) -> list[dict[str, Any]]:
        raise self._refusal


def simulation_of(parts: Any, entry: Entry) -> Simulation:
    """The simulation of these components; where the scene raises SolveError, one that ends with it."""
    try:
        return parts.scene.simulation(parts, entry)
    except SolveError as refusal:
        return _Refused(refusal)


class _Run:
    """One case while it runs: its simulation, the ledger of its method, and that of the way to the first state."""

    def __init__(
        self,
        build: Callable[[Entry], Simulation],
        method: Method,
        listen: Callable[[Progress], None],
        clock: Callable[[], float],
        watch: Callable[[Simulation], None],
        way: Way,
        share: Callable[[Way], None],
    ) -> None:
        self.method, self.listen, self.watch = method, listen, watch
        self.ledger = Ledger(clock)
        self.walk = Walk(method.linear, Ledger(clock), way, share)
        self.operator = checked(method.operator)
        self.tangent = Tangent(method.linear, method.refresh, self.ledger, operator=self.operator)
        self.simulation = build(self.ledger.entry)
        self.rows: list[dict[str, Any]] = []
        self.iterates: list[Array] | None = None
        self.increments = self.iterations = self.idle = 0
        self.time = 0.0
        self.validity_time: float | None = None
        self.residual_norm = self.residual_absolute = self.newton_correction = float("nan")
        self.false_convergence = self.false_failure = 0
        self.blame: Mapping[str, float] = {}
        self.kept: tuple[NonlinearProblem, Array] | None = None

    def record(self) -> Record:
        """Run the case."""
        outcome = self.outcome()
        summary = self.summary(outcome)
        problem, state = self.kept or (None, None)
        iterates = iterates_frame(self.iterates or [])
        return Record(summary, outcome, steps_frame(self.rows), self.simulation.fields(), iterates, problem, state)

    def outcome(self) -> Outcome:
        """Solve the problems of the simulation one after another; returns the outcome of the case."""
        solves = self.simulation.solves()
        try:
            task = next(solves)
            while True:
                outcome = self.prepared(task) if task.preparation is not None else self.solved(task)
                if outcome.status in STOPPED:
                    return outcome  # a simulation might try again
                task = solves.send(outcome)
        except StopIteration as end:
            self.walk.end()
            return end.value
        except (SolveError, CaseStopped) as error:
            return Outcome(error.status, error.detail, np.zeros(0), np.nan, ())

    def prepared(self, task: Solve) -> Outcome:
        """Solve a problem on the way to the first state; its work is counted apart."""
        outcome = self.walk.outcome(task)
        self.blame = outcome.blame
        if outcome.status is Status.CONVERGED:
            self.keep(task, outcome)
        return outcome

    def solved(self, task: Solve) -> Outcome:
        """Solve a problem by the method of the case; its rows, counts and largest residual are kept."""
        method, k = self.method, task.increment
        self.walk.end()
        if not self.tangent.renewals:  # reuses the ordering of the way to the first state
            self.tangent = Tangent(method.linear, method.refresh, self.ledger, self.walk.ordered(), self.operator)
        keep = None if self.iterates is None else self.iterates.append
        outcome = solve(
            task.problem, method.solver, self.tangent, task.start, method.stop, method.budget, self.ledger, keep
        )
        self.iterations += outcome.iterations
        self.idle += outcome.idle
        self.false_convergence += outcome.claimed_wrongly
        self.false_failure += outcome.denied_wrongly
        self.blame = outcome.blame
        self.rows += [{"increment": k, "time": task.time, "accepted": False, **row} for row in outcome.rows]
        if self.validity_time is None and self.simulation.increments and self.tangent.renewals > 1:
            self.validity_time = self.time
        if not k:  # a steady state may be solved again: its last solve counts
            self.residual_norm = self.residual_absolute = np.nan
        self.residual_norm = float(np.fmax(self.residual_norm, outcome.residual_norm))
        self.residual_absolute = float(np.fmax(self.residual_absolute, outcome.residual_absolute))
        self.newton_correction = float(np.fmax(self.newton_correction, outcome.newton_correction))
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
        """Keep a state that solves its problem; returns columns of `steps` for its last step."""
        self.kept = task.problem, outcome.state
        if self.operator is not None:
            self.operator.solved(task.problem, outcome.state)
        columns = self.simulation.keep(task, outcome.state)
        self.watch(self.simulation)
        return columns

    def summary(self, outcome: Outcome) -> dict[str, Any]:
        """The row of `runs`; the simulation measures its columns on the last state that was kept."""
        ledger, start = self.ledger, self.walk.ledger
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
            **({"seconds_estimate": ledger.seconds["estimate"]} if ledger.counts["estimate"] else {}),
            "seconds_all": start.seconds["stage"] + sum(ledger.seconds[k] for k in ("method", "operators", "estimate")),
            **self.tangent.facts(),
            "residual_norm": self.residual_norm,
            "residual_absolute": self.residual_absolute,
            **({} if np.isnan(self.newton_correction) else {"newton_correction": self.newton_correction}),
            **self.columns(outcome),
        }

    def columns(self, outcome: Outcome) -> dict[str, Any]:
        """What the simulation measures; work that the ledger cannot see is a reason for doubt."""
        found = run_columns({**self.simulation.sizes, **self.simulation.measured(outcome)})
        if not self.idle:
            return found
        reason = (
            f"the solver {self.method.solver.called()!r} took {self.idle} of {self.iterations} steps with no counted "
            "work (residuals, Jacobians, solves, coefficients), so that its counts tell less than it did: ask "
            "`problem` and `tangent` for all of it"
        )
        return found | {"doubt": "; ".join(filter(None, (found.get("doubt"), reason)))}


def crashed(error: BaseException) -> dict[str, Any]:
    """The row of `runs` for a case that an error of the program or of a plugin has ended: its message and its place."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    message = f"{said} ({place.filename}:{place.lineno})"
    return {"status": Status.CRASHED.word, "message": message}


def reported(rows: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Sums over `rows` of the work that the method's library reports itself; None for what it does not report."""
    said = {name: [row[name] for row in rows if name in row] for name in REPORTED}
    return {name: sum(numbers) if numbers else None for name, numbers in said.items()}
