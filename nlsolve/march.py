"""First state, then increment after increment: one case from its components to its record."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from nlsolve.audit import audit
from nlsolve.columns import REPORTED, STEPS
from nlsolve.discretizers import Discretizer, Operators
from nlsolve.driver import Budget, Outcome, StoppingTest, solve
from nlsolve.estimate import discretization_error
from nlsolve.flow import Convection, Flow, Inertia
from nlsolve.laws import ConstitutiveLaw, rate_squared
from nlsolve.ledger import Ledger
from nlsolve.linear import LinearSolver
from nlsolve.measures import divergence, nodal_fields, velocity_error, wall_reaction
from nlsolve.motion import Markers, MovingNodes
from nlsolve.predictors import Predictor
from nlsolve.pressure import Mixing
from nlsolve.problems import NonlinearProblem
from nlsolve.scenes import Scene
from nlsolve.series import Array
from nlsolve.solvers import NonlinearSolver, RefreshRule
from nlsolve.start import Stage, Start, walk
from nlsolve.status import SolveError, Status
from nlsolve.tangent import Tangent


@dataclass(frozen=True)
class Setup:
    """The components of one case. `starter` is the method that reaches the first state, the same for every strategy."""

    scene: Scene
    law: ConstitutiveLaw
    discretizer: Discretizer
    linear: LinearSolver
    solver: NonlinearSolver
    refresh: RefreshRule
    starter: NonlinearSolver
    predictor: Predictor
    stop: StoppingTest = field(default_factory=StoppingTest)
    start: Start = field(default_factory=Start)
    budget: Budget = field(default_factory=Budget)
    counterpart: Discretizer | None = None
    """Discretises the solved flow once more, for an estimate of its error."""
    record: tuple[float, ...] = ()
    """Times [s] at which the fields are recorded, besides the last."""


@dataclass(frozen=True)
class Progress:
    """What a listener is told after every increment."""

    increment: int
    increments: int
    branches: int
    factorizations: int


@dataclass(frozen=True)
class Record:
    """What one case leaves: its row of `runs`, its rows of `steps`, its `fields` (a row a node and recorded time).

    problem, state : the last that was solved, None before the first; for measuring what work on them costs.
    """

    summary: dict[str, Any]
    steps: pd.DataFrame
    fields: pd.DataFrame = field(default_factory=pd.DataFrame)
    problem: NonlinearProblem | None = None
    state: Array | None = None


def reported(rows: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """What the method's library says it did, over all rows of `steps`; None where it says nothing."""
    said = {name: [row[name] for row in rows if name in row] for name in REPORTED}
    return {name: sum(numbers) if numbers else None for name, numbers in said.items()}


def march(
    setup: Setup,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
) -> Record:
    """Run one case; every ending, failure included, is in the record. `clock` is what its seconds are told by."""
    return _March(setup, listen or (lambda progress: None), clock).run()


def sample(setup: Setup, clock: Callable[[], float] = time.process_time) -> tuple[Flow, Array, Ledger]:
    """The balance of a case at t = 0, a state for it, and the books of its operators; nothing is iterated.

    The state is one Newton step away from rest under the easiest law of the way to the first state: where that law is
    Newtonian, the flow of a Newtonian material. Raises SolveError.
    """
    case = _March(setup, lambda progress: None, clock)
    case.begin()
    first = setup.start.stages(setup.law)[0]
    easiest = case.flow_of(first.law, load=first.load)
    rest = easiest.unknowns(case.velocity)
    factors = setup.linear.factorize(easiest.jacobian(rest))
    state = rest - factors.solve(easiest.residual(rest))
    case.keep(easiest, state)
    return case.flow_of(setup.law), state, case.ledger


class _March:
    """The state of one case on its way: cloud, operators, velocity, and the books of the start and of the march."""

    def __init__(self, setup: Setup, listen: Callable[[Progress], None], clock: Callable[[], float]) -> None:
        self.setup, self.scene, self.listen, self.clock = setup, setup.scene, listen, clock
        self.start_ledger, self.ledger = Ledger(clock), Ledger(clock)
        self.start_tangent = Tangent(setup.linear, None, self.start_ledger)
        self.tangent = Tangent(setup.linear, setup.refresh, self.ledger)
        self.volumetric = bool(self.scene.penalty)
        self.rows: list[dict[str, Any]] = []
        self.snapshots: list[pd.DataFrame] = []
        self.time = 0.0
        self.increments = self.iterations = 0
        self.validity_time: float | None = None
        self.residual_norm = float("nan")
        self.pressure: Array | None = None  # at the volume points, iterated where the scene asks for a divergence
        self.pressure_iterations = 0
        self.claimed_wrongly = self.denied_wrongly = 0
        self.blame: Mapping[str, float] = {}
        self.sizes: dict[str, float | None] = {"nodes": None, "unknowns": None, "smallest_spacing": None}
        self.moving: MovingNodes | None = None
        self.markers: Markers | None = None
        self.operators: Operators
        self.flow: Flow | None = None  # of the last solved increment, with its unknowns
        self.unknowns: Array

    def run(self) -> Record:
        status, detail = Status.CONVERGED, Status.CONVERGED.sentence
        try:
            self.begin()
            outcome = self.first_state()
            for k in range(1, self.scene.increments + 1):
                if outcome.status is not Status.CONVERGED:
                    break
                outcome = self.advance(k)
            status, detail = outcome.status, outcome.detail
        except SolveError as error:
            status, detail = error.status, error.detail
        return self.record(status, detail)

    # The parts of a march.

    def begin(self) -> None:
        """The cloud at t = 0, its operators, and rest inside."""
        self.initial = self.cloud = self.scene.cloud(self.setup.law)
        self.sizes = {
            "nodes": len(self.cloud.nodes),
            "unknowns": 2 * len(self.cloud.interior),
            "smallest_spacing": float(self.cloud.nearest_distance.min()),
        }
        if self.scene.motion_of_nodes == "lagrangian":
            self.moving = MovingNodes(self.scene, self.setup.discretizer, self.initial)
        self.build_operators()
        self.velocity = self.guess = np.zeros_like(self.cloud.nodes)
        self.past: list[Array] = []  # velocities of the same nodes at the ends of the increments, latest first
        self.before: Array | None = None  # velocity one increment earlier
        probe = self.scene.probe
        inside = self.cloud.interior
        self.probe = (
            None if probe is None else int(inside[np.linalg.norm(self.cloud.nodes[inside] - probe, axis=1).argmin()])
        )

    def first_state(self) -> Outcome:
        """Quasi-static state at t = 0 by continuation; a steady scene's last stage is the case's own."""
        steady, start = not self.scene.increments, self.setup.start

        def solve_stage(stage: Stage, last: bool) -> Outcome:
            if not last:
                return self.start_stage(stage)
            if not steady:
                return self.iterate_pressure(lambda: self.start_stage(stage))
            self.take_over()
            return self.iterate_pressure(lambda: self.solve_increment(0, self.flow_of(stage.law)))

        outcome, stage = walk(start, self.setup.law, solve_stage)
        self.take_over()
        if outcome.status is Status.CONVERGED:
            if self.scene.markers or self.scene.shifting:
                self.markers = Markers(self.scene, self.setup.discretizer, self.initial, self.velocity)
            self.record_fields_if_due()
        elif not steady or stage.load < 1.0 or stage.law is not self.setup.law:
            detail = f"on the way to the first state, at {start.by} = {stage.value:g}: {outcome.detail}"
            return Outcome(outcome.status, detail, outcome.state, outcome.residual_norm, ())
        return outcome

    def take_over(self) -> None:
        """The case's own tangent, in the ordering that the start settled on, unless it is there already."""
        if not self.tangent.branches:
            self.tangent = Tangent(self.setup.linear, self.setup.refresh, self.ledger, self.start_tangent.factors)

    def start_stage(self, stage: Stage) -> Outcome:
        """The starting method on one stage; a state it converges to is kept."""
        setup = self.setup
        with self.start_ledger.entry("stage"):
            flow = self.flow_of(stage.law, load=stage.load)
            outcome = solve(
                flow,
                setup.starter,
                self.start_tangent,
                flow.unknowns(self.guess),
                StoppingTest(kind="residual", tolerance=setup.start.tolerance),
                setup.start.budget(setup.budget),
                self.start_ledger,
            )
        self.blame = outcome.blame
        if outcome.status is Status.CONVERGED:
            self.keep(flow, outcome.state)
        return outcome

    def advance(self, k: int) -> Outcome:
        """One time step: move the nodes if the scene moves them, then solve the balance at its end."""
        self.time = k * self.scene.increment
        if self.moving is not None:
            self.move_nodes(self.moving)
        previous = self.velocity
        self.past = [previous, *self.past][: self.setup.predictor.depth]
        self.guess = self.setup.predictor.guess(self.past)
        inertia = self.inertia_from(previous)
        outcome = self.iterate_pressure(lambda: self.solve_increment(k, self.flow_of(self.setup.law, inertia)))
        if outcome.status is Status.CONVERGED:
            self.before = previous
            if self.markers is not None:
                self.markers.advance(self.cloud, self.velocity, self.time)
            self.record_fields_if_due()
        return outcome

    def inertia_from(self, before: Array | None) -> Inertia | None:
        """ρ (V − V_k)/Δt with V_k = `before`, where the scene keeps it."""
        if before is None or not self.scene.inertia:
            return None
        return Inertia(self.scene.density / self.scene.increment, before)

    def move_nodes(self, moving: MovingNodes) -> None:
        """The cloud and its operators at the end of the increment; velocities come along to shifted nodes."""
        self.cloud, carry = moving.move(self.cloud, self.velocity, self.before, self.time)
        self.build_operators()
        if carry is not None:
            self.velocity = self.velocity + carry @ self.velocity
            self.past = [velocity + carry @ velocity for velocity in self.past]

    def build_operators(self) -> None:
        before = self.operators if self.pressure is not None else None
        with self.ledger.entry("operators"):
            if self.moving is None:
                self.operators = self.setup.discretizer.operators(self.cloud, self.volumetric)
            else:
                self.operators = self.moving.operators(self.cloud, self.volumetric)
            self.gradient = self.setup.discretizer.gradient(self.cloud) if self.scene.convection else None
        if before is not None:
            self.pressure = self.between_volume_points(before, self.operators) @ self.pressure

    def flow_of(
        self,
        law: ConstitutiveLaw,
        inertia: Inertia | None = None,
        load: float = 1.0,
        others: Operators | None = None,
    ) -> Flow:
        """The balance now, by the operators of the march or by `others` of the same cloud."""
        operators = others or self.operators
        pressure = self.pressure
        if others is not None and pressure is not None:
            pressure = self.between_volume_points(self.operators, others) @ pressure
        body_force = self.scene.body_force(self.cloud.nodes[self.cloud.interior], law)
        return Flow(
            self.cloud,
            operators,
            law,
            load * self.scene.boundary_velocity(self.cloud, law, self.time),
            self.scene.penalty_modulus(law, self.rate_squared_at_volume_points(operators)) if self.volumetric else 0.0,
            pressure,
            inertia,
            Convection(self.scene.density, self.gradient) if self.gradient is not None else None,
            None if body_force is None else load * body_force,
        )

    def rate_squared_at_volume_points(self, operators: Operators) -> Array:
        """ε̄² of the velocity so far, taken at the strain point nearest to each volume point, shape (L,)."""
        nearest = cKDTree(operators.strain_points).query(operators.volume_points)[1]
        return rate_squared((operators.strain @ self.velocity.ravel()).reshape(3, -1)[:, nearest])

    def between_volume_points(self, here: Operators, there: Operators) -> Any:
        """The matrix that takes pressures from the volume points of some operators to those of others."""
        assert here.volume_points is not None
        assert there.volume_points is not None
        return self.setup.discretizer.values(here.volume_points, there.volume_points)

    def iterate_pressure(self, solve_once: Callable[[], Outcome]) -> Outcome:
        """Solve, and iterate the pressure until ‖div v‖ ≤ divergence · ‖ε̄‖ where the scene asks for that."""
        asked, most, mixing = self.scene.divergence, self.setup.budget.pressures, Mixing()
        outcome = solve_once()
        if asked is None:
            return outcome
        for _ in range(most):
            if outcome.status is not Status.CONVERGED:
                return outcome
            assert self.flow is not None
            if divergence(self.flow, self.velocity) <= asked:
                return outcome
            image = self.flow.pressure(outcome.state)
            assert image is not None
            self.pressure = mixing.next(np.zeros_like(image) if self.pressure is None else self.pressure, image)
            self.pressure_iterations += 1
            outcome = solve_once()
        reached = divergence(self.flow, self.velocity) if self.flow is not None else np.nan
        if outcome.status is not Status.CONVERGED or reached <= asked:
            return outcome
        detail = (
            f"‖div V‖/‖ε̄‖ = {reached:.1e} after {most} iterations of the pressure, {asked:g} was asked for: "
            "raise the penalty, tighten stop.tolerance, or take the dilatation in another form"
        )
        return replace(outcome, status=Status.BUDGET_SPENT, detail=detail)

    def solve_increment(self, k: int, flow: Flow) -> Outcome:
        """The case's own method on one increment; its rows, counts and largest residual are kept."""
        setup = self.setup
        guess = setup.start.disturbed(flow, flow.unknowns(self.guess), k)
        outcome = solve(flow, setup.solver, self.tangent, guess, setup.stop, setup.budget, self.ledger)
        solved = outcome.status is Status.CONVERGED
        self.iterations += max(0, len(outcome.steps) - 1)
        self.claimed_wrongly += outcome.claimed_wrongly
        self.denied_wrongly += outcome.denied_wrongly
        self.blame = outcome.blame
        self.rows += [{"increment": k, "time": self.time, "accepted": False, **row} for row in outcome.steps]
        if self.validity_time is None and self.scene.increments and self.tangent.branches > 1:
            self.validity_time = (k - 1) * self.scene.increment
        before = self.residual_norm if k else np.nan  # of a steady scene the last solve counts: a start may repeat it
        self.residual_norm = float(np.fmax(before, outcome.residual_norm))
        if solved:
            self.keep(flow, outcome.state)
            self.increments = max(k, 1)
            self.rows[-1]["accepted"] = True
            if self.probe is not None:
                places = zip(
                    ("x", "y", "u", "v"), (*self.cloud.nodes[self.probe], *self.velocity[self.probe]), strict=True
                )
                self.rows[-1] |= {f"probe_{name}": value for name, value in places}
        self.listen(
            Progress(
                max(k, self.increments),
                max(self.scene.increments, 1),
                self.tangent.branches,
                self.ledger.counts["factorization"],
            )
        )
        return outcome

    def keep(self, flow: Flow, unknowns: Array) -> None:
        """A solved state: what is measured, and where the next solve begins."""
        self.flow, self.unknowns = flow, unknowns
        self.velocity = self.guess = flow.velocity(unknowns)

    def error_estimate(self, velocity: Array) -> float:
        """By the counterpart, of the last increment; NaN without one."""
        if self.setup.counterpart is None:
            return float("nan")
        others = self.setup.counterpart.operators(self.cloud, self.volumetric)
        flow = self.flow_of(self.setup.law, self.inertia_from(self.before), others=others)
        return discretization_error(flow, velocity, self.setup.linear)

    # What is left behind.

    def record_fields_if_due(self) -> None:
        """Keep the fields when this time, to half an increment, is one of those asked for, or the last."""
        asked = (*self.setup.record, self.scene.horizon or 0.0)
        if any(abs(self.time - moment) < 0.5 * self.scene.increment for moment in asked):
            assert self.flow is not None
            fields = nodal_fields(self.scene, self.setup.discretizer, self.flow, self.velocity, self.initial, self.time)
            places = np.full_like(self.initial.nodes, np.nan) if self.markers is None else self.markers.places
            self.snapshots.append(fields.assign(marker_x=places[:, 0], marker_y=places[:, 1]))

    def record(self, status: Status, detail: str) -> Record:
        """The row of the case, whatever its ending; what is measured on fields is of the last solved increment."""
        ledger, start = self.ledger, self.start_ledger
        reached = self.increments * self.scene.increment if self.scene.increments else 0.0
        validity = self.validity_time
        if validity is None and self.scene.increments and self.increments:
            validity = reached  # the first tangent served to the end
        message = detail if detail == status.sentence or status is Status.CONVERGED else f"{status.sentence}; {detail}"
        if "blame_x" in self.blame:
            x, y, rate = (self.blame[f"blame_{name}"] for name in ("x", "y", "rate"))
            message += f"; the residual is largest at ({x:.3g}, {y:.3g}), where ε̄ = {rate:.2g} 1/s"
        summary: dict[str, Any] = {
            "status": status.word,
            "message": message,
            "said_converged_but_is_not": self.claimed_wrongly,
            "said_failed_but_is": self.denied_wrongly,
            **self.blame,
            **self.sizes,
            "cloud_quality": None if self.moving is None else self.moving.quality,
            "increments": self.increments,
            "time": reached,
            "iterations": self.iterations,
            "pressure_iterations": self.pressure_iterations if self.scene.divergence else None,
            "branches": self.tangent.branches,
            "validity_time": validity,
            **ledger.work(),
            **reported(self.rows),
            "start_factorizations": start.counts["factorization"],
            "start_triangular_solves": start.counts["triangular_solve"],
            "start_residuals": start.counts["residual"],
            "seconds_start": start.seconds["stage"],
            "seconds_all": ledger.seconds["method"] + ledger.seconds["operators"] + start.seconds["stage"],
            **self.tangent.facts(),
            "residual_norm": self.residual_norm,
        }
        if self.flow is not None:
            flow, velocity, discretizer = self.flow, self.flow.velocity(self.unknowns), self.setup.discretizer
            change = None if self.before is None else (velocity - self.before) / self.scene.increment
            summary["divergence"] = divergence(flow, velocity)
            summary |= velocity_error(self.scene, flow, velocity, reached)
            summary |= wall_reaction(self.scene, discretizer, flow, velocity, reached)
            estimates = {"estimate": lambda: self.error_estimate(velocity)} if status is Status.CONVERGED else {}
            summary |= audit(self.scene, discretizer, flow, velocity, change, reached, **estimates)
        steps = pd.DataFrame(self.rows, columns=[name for name in STEPS if name != "case"])
        fields = pd.concat(self.snapshots, ignore_index=True) if self.snapshots else pd.DataFrame()
        return Record(summary, steps, fields, self.flow, None if self.flow is None else self.unknowns)
