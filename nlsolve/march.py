"""First state, then increment after increment: one case from its components to its record."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import Field
from scipy.spatial import cKDTree

from nlsolve.audit import audit
from nlsolve.columns import STEPS
from nlsolve.component import Component
from nlsolve.discretizers import Discretizer, Operators
from nlsolve.driver import Budget, Outcome, StoppingTest, solve
from nlsolve.flow import Convection, Flow, Inertia
from nlsolve.laws import ConstitutiveLaw, rate_squared
from nlsolve.ledger import Ledger
from nlsolve.linear import LinearSolver
from nlsolve.measures import divergence, nodal_fields, velocity_error, wall_reaction
from nlsolve.motion import Markers, MovingNodes
from nlsolve.pressure import Mixing
from nlsolve.scenes import Scene
from nlsolve.series import Array
from nlsolve.solvers import NonlinearSolver, RefreshRule
from nlsolve.status import SolveError, Status
from nlsolve.tangent import Tangent


class Start(Component):
    """How the first state is reached from rest, where no series and no Newton step has a useful range: continuation.

    The law is solved with its field `by` at each of `values` larger than the target, then at the target, by the
    starting method with a new tangent each iteration. The work is counted apart from the march (columns `start_…`).
    """

    noun: ClassVar[str] = "start"

    by: str = Field(
        "index", description="field of the law that is varied: index (from 1) or regularization (from large)"
    )
    values: tuple[float, ...] = Field((1.0, 0.5, 0.3, 0.2), description="its values on the way, in order")
    tolerance: float = Field(1e-10, gt=0, description="relative residual of the first state")


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
    stop: StoppingTest = field(default_factory=StoppingTest)
    start: Start = field(default_factory=Start)
    budget: Budget = field(default_factory=Budget)
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
    problem: Flow | None = None
    state: Array | None = None


def march(
    setup: Setup,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Record:
    """Run one case; every ending, failure included, is in the record. `clock` is what its seconds are told by."""
    return _March(setup, listen or (lambda progress: None), clock).run()


def sample(setup: Setup, clock: Callable[[], float] = time.perf_counter) -> tuple[Flow, Array, Ledger]:
    """The balance of a case at t = 0, a state for it, and the books of its operators; nothing is iterated.

    The state is one Newton step away from rest under the easiest law of the way to the first state: where that law is
    Newtonian, the flow of a Newtonian material. Raises SolveError.
    """
    case = _March(setup, lambda progress: None, clock)
    case.begin()
    easiest = case.flow_of(setup.law.continuation(setup.start.by, setup.start.values)[0])
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
        self.seconds_start = 0.0
        self.volumetric = bool(self.scene.penalty)
        self.rows: list[dict[str, Any]] = []
        self.snapshots: list[pd.DataFrame] = []
        self.time = 0.0
        self.increments = self.iterations = 0
        self.validity_time: float | None = None
        self.residual_norm = float("nan")
        self.pressure: Array | None = None  # at the volume points, iterated where the scene asks for a divergence
        self.pressure_iterations = 0
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
        self.velocity = np.zeros_like(self.cloud.nodes)
        self.before: Array | None = None  # velocity one increment earlier
        probe = self.scene.probe
        inside = self.cloud.interior
        self.probe = (
            None if probe is None else int(inside[np.linalg.norm(self.cloud.nodes[inside] - probe, axis=1).argmin()])
        )

    def first_state(self) -> Outcome:
        """Quasi-static state at t = 0 by continuation of the law; a steady scene's last stage is the case's own."""
        *easier, target = self.setup.law.continuation(self.setup.start.by, self.setup.start.values)
        begun = self.clock()
        outcome, law = None, target
        for law in easier:
            outcome = self.start_stage(law)
            if outcome.status is not Status.CONVERGED:
                break
        if self.scene.increments and (outcome is None or outcome.status is Status.CONVERGED):
            law = target
            outcome = self.iterate_pressure(lambda: self.start_stage(target))
        self.seconds_start = self.clock() - begun
        self.tangent = Tangent(self.setup.linear, self.setup.refresh, self.ledger, self.start_tangent.factors)
        if outcome is not None and outcome.status is not Status.CONVERGED:
            by = self.setup.start.by
            detail = f"on the way to the first state, at {by} = {getattr(law, by):g}: {outcome.detail}"
            return Outcome(outcome.status, detail, outcome.state, outcome.residual_norm, ())
        if self.scene.increments == 0:
            outcome = self.iterate_pressure(lambda: self.solve_increment(0, self.flow_of(target)))
        assert outcome is not None
        if outcome.status is Status.CONVERGED:
            if self.scene.markers or self.scene.shifting:
                self.markers = Markers(self.scene, self.setup.discretizer, self.initial, self.velocity)
            self.record_fields_if_due()
        return outcome

    def start_stage(self, law: ConstitutiveLaw) -> Outcome:
        setup = self.setup
        flow = self.flow_of(law)
        outcome = solve(
            flow,
            setup.starter,
            self.start_tangent,
            flow.unknowns(self.velocity),
            StoppingTest(kind="residual", tolerance=setup.start.tolerance),
            setup.budget,
            self.start_ledger,
        )
        if outcome.status is Status.CONVERGED:
            self.keep(flow, outcome.state)
        return outcome

    def advance(self, k: int) -> Outcome:
        """One time step: move the nodes if the scene moves them, then solve the balance at its end."""
        self.time = k * self.scene.increment
        if self.moving is not None:
            self.move_nodes(self.moving)
        previous = self.velocity
        inertia = None
        if self.scene.inertia:
            inertia = Inertia(self.scene.density / self.scene.increment, previous)
        outcome = self.iterate_pressure(lambda: self.solve_increment(k, self.flow_of(self.setup.law, inertia)))
        if outcome.status is Status.CONVERGED:
            self.before = previous
            if self.markers is not None:
                self.markers.advance(self.cloud, self.velocity, self.time)
            self.record_fields_if_due()
        return outcome

    def move_nodes(self, moving: MovingNodes) -> None:
        """The cloud and its operators at the end of the increment; velocities come along to shifted nodes."""
        self.cloud, carry = moving.move(self.cloud, self.velocity, self.before, self.time)
        self.build_operators()
        if carry is not None:
            self.velocity = self.velocity + carry @ self.velocity

    def build_operators(self) -> None:
        before = self.operators.volume_points if self.pressure is not None else None
        with self.ledger.entry("operators"):
            if self.moving is None:
                self.operators = self.setup.discretizer.operators(self.cloud, self.volumetric)
            else:
                self.operators = self.moving.operators(self.cloud, self.volumetric)
            self.gradient = self.setup.discretizer.gradient(self.cloud) if self.scene.convection else None
        if before is not None:
            assert self.operators.volume_points is not None
            self.pressure = self.setup.discretizer.values(before, self.operators.volume_points) @ self.pressure

    def flow_of(self, law: ConstitutiveLaw, inertia: Inertia | None = None) -> Flow:
        return Flow(
            self.cloud,
            self.operators,
            law,
            self.scene.boundary_velocity(self.cloud, law, self.time),
            self.scene.penalty_modulus(law, self.rate_squared_at_volume_points()) if self.volumetric else 0.0,
            self.pressure,
            inertia,
            Convection(self.scene.density, self.gradient) if self.gradient is not None else None,
            self.scene.body_force(self.cloud.nodes[self.cloud.interior], law),
        )

    def rate_squared_at_volume_points(self) -> Array:
        """ε̄² of the velocity so far, taken at the strain point nearest to each volume point, shape (L,)."""
        nearest = cKDTree(self.operators.strain_points).query(self.operators.volume_points)[1]
        return rate_squared((self.operators.strain @ self.velocity.ravel()).reshape(3, -1)[:, nearest])

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
        outcome = solve(
            flow, setup.solver, self.tangent, flow.unknowns(self.velocity), setup.stop, setup.budget, self.ledger
        )
        solved = outcome.status is Status.CONVERGED
        self.iterations += max(0, len(outcome.steps) - 1)
        self.rows += [{"increment": k, "time": self.time, "accepted": False, **row} for row in outcome.steps]
        if self.validity_time is None and self.scene.increments and self.tangent.branches > 1:
            self.validity_time = (k - 1) * self.scene.increment
        self.residual_norm = float(np.fmax(self.residual_norm, outcome.residual_norm))
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
        self.velocity = flow.velocity(unknowns)

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
        factors = self.tangent.factors
        reached = self.increments * self.scene.increment if self.scene.increments else 0.0
        validity = self.validity_time
        if validity is None and self.scene.increments and self.increments:
            validity = reached  # the first tangent served to the end
        message = detail if detail == status.sentence or status is Status.CONVERGED else f"{status.sentence}; {detail}"
        summary: dict[str, Any] = {
            "status": status.word,
            "message": message,
            **self.sizes,
            "cloud_quality": None if self.moving is None else self.moving.quality,
            "increments": self.increments,
            "time": reached,
            "iterations": self.iterations,
            "pressure_iterations": self.pressure_iterations if self.scene.divergence else None,
            "branches": self.tangent.branches,
            "validity_time": validity,
            "factorizations": ledger.counts["factorization"],
            "triangular_solves": ledger.counts["triangular_solve"],
            "jacobians": ledger.counts["jacobian"],
            "residuals": ledger.counts["residual"],
            "series_orders": ledger.counts["series_order"],
            "start_factorizations": start.counts["factorization"],
            "start_triangular_solves": start.counts["triangular_solve"],
            "start_residuals": start.counts["residual"],
            "seconds": ledger.seconds["method"],
            "seconds_factorization": ledger.seconds["factorization"],
            "seconds_triangular_solve": ledger.seconds["triangular_solve"],
            "seconds_jacobian": ledger.seconds["jacobian"],
            "seconds_residual": ledger.seconds["residual"],
            "seconds_series": ledger.seconds["series_order"],
            "seconds_operators": ledger.seconds["operators"],
            "seconds_start": self.seconds_start,
            "seconds_all": ledger.seconds["method"] + ledger.seconds["operators"] + self.seconds_start,
            **ledger.details(),
            "ordering": factors.ordering if factors else None,
            "fill": factors.fill if factors else None,
            "factor_solve_ratio": ledger.each("factorization") / ledger.each("triangular_solve"),
            "condition": factors.condition() if factors else None,
            "residual_norm": self.residual_norm,
        }
        if self.flow is not None:
            flow, velocity, discretizer = self.flow, self.flow.velocity(self.unknowns), self.setup.discretizer
            change = None if self.before is None else (velocity - self.before) / self.scene.increment
            summary["divergence"] = divergence(flow, velocity)
            summary |= velocity_error(self.scene, flow, velocity, reached)
            summary |= wall_reaction(self.scene, discretizer, flow, velocity, reached)
            summary |= audit(self.scene, discretizer, flow, velocity, change, reached)
        steps = pd.DataFrame(self.rows, columns=[name for name in STEPS if name != "case"])
        fields = pd.concat(self.snapshots, ignore_index=True) if self.snapshots else pd.DataFrame()
        return Record(summary, steps, fields, self.flow, None if self.flow is None else self.unknowns)
