"""First state, then increment after increment: one case from its components to its record."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve import driver
from nlsolve.columns import STEPS
from nlsolve.component import Component
from nlsolve.discretizers import Discretizer, Operators
from nlsolve.driver import Budget, Outcome, StoppingTest
from nlsolve.flow import Flow, Inertia
from nlsolve.laws import ConstitutiveLaw, rate_squared
from nlsolve.ledger import Ledger
from nlsolve.linear import LinearSolver
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

    by: str = Field("index", description="field of the law that is varied: index (from 1) or regularization (from large)")
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
    stop: StoppingTest = StoppingTest()
    start: Start = Start()
    budget: Budget = Budget()
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
    """What one case leaves: its row of `runs`, its rows of `steps`, and its `fields` (a row a node and recorded time)."""

    summary: dict[str, Any]
    steps: pd.DataFrame
    fields: pd.DataFrame = field(default_factory=pd.DataFrame)


def march(setup: Setup, listen: Callable[[Progress], None] | None = None) -> Record:
    """Run one case; every ending, failure included, is in the record."""
    return _March(setup, listen or (lambda progress: None)).run()


class _March:
    """The state of one case on its way: cloud, operators, velocity, and the books of the start and of the march."""

    def __init__(self, setup: Setup, listen: Callable[[Progress], None]) -> None:
        self.setup, self.scene, self.listen = setup, setup.scene, listen
        self.start_ledger, self.ledger = Ledger(), Ledger()
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
        self.flow: Flow | None = None

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
        self.initial = self.cloud = self.scene.cloud()
        self.build_operators()
        self.velocity = np.zeros_like(self.cloud.nodes)
        self.before: Array | None = None  # velocity one increment earlier, for the second-order motion of nodes
        probe = self.scene.probe
        inside = self.cloud.interior
        self.probe = (
            None if probe is None else int(inside[np.linalg.norm(self.cloud.nodes[inside] - probe, axis=1).argmin()])
        )

    def first_state(self) -> Outcome:
        """Quasi-static state at t = 0 by continuation of the law; a steady scene's last stage is the case's own."""
        *easier, target = self.setup.law.continuation(self.setup.start.by, self.setup.start.values)
        begun = time.perf_counter()
        outcome = None
        for law in easier if self.scene.increments == 0 else [*easier, target]:
            outcome = self.start_stage(law)
            if outcome.status is not Status.CONVERGED:
                break
        self.seconds_start = time.perf_counter() - begun
        self.tangent = Tangent(self.setup.linear, self.setup.refresh, self.ledger, self.start_tangent.factors)
        if outcome is not None and outcome.status is not Status.CONVERGED:
            detail = f"on the way to the first state: {outcome.detail}"
            return Outcome(outcome.status, detail, outcome.state, outcome.residual_norm, ())
        if self.scene.increments == 0:
            outcome = self.solve_increment(0, self.flow_of(target))
        assert outcome is not None
        if outcome.status is Status.CONVERGED:
            self.snapshot_if_due()
        return outcome

    def start_stage(self, law: ConstitutiveLaw) -> Outcome:
        setup = self.setup
        flow = self.flow_of(law)
        outcome = driver.solve(
            flow,
            setup.starter,
            self.start_tangent,
            flow.unknowns(self.velocity),
            StoppingTest(kind="residual", tolerance=setup.start.tolerance),
            setup.budget,
            self.start_ledger,
        )
        if outcome.status is Status.CONVERGED:
            self.velocity = flow.velocity(outcome.state)
        return outcome

    def advance(self, k: int) -> Outcome:
        """One time step: move the nodes if the scene moves them, then solve the balance at its end."""
        self.time = k * self.scene.increment
        if self.scene.motion_of_nodes == "lagrangian":
            self.move_nodes()
            self.build_operators()
        previous = self.velocity
        inertia = None
        if self.scene.inertia:
            inertia = Inertia(self.scene.density / self.scene.increment, previous)
        outcome = self.solve_increment(k, self.flow_of(self.setup.law, inertia))
        self.before = previous
        if outcome.status is Status.CONVERGED:
            self.snapshot_if_due()
        return outcome

    def move_nodes(self) -> None:
        """x_{k+1} = x_k + Δt (3/2 v_k − 1/2 v_{k−1}) inside (Adams-Bashforth); boundary nodes by their exact motion."""
        step = self.velocity if self.before is None else 1.5 * self.velocity - 0.5 * self.before
        nodes = self.cloud.nodes + self.scene.increment * step
        nodes[self.initial.boundary] = self.scene.boundary_position(self.initial, self.time)
        self.cloud = self.cloud.moved_to(nodes)

    def build_operators(self) -> None:
        with self.ledger.entry("operators"):
            self.operators: Operators = self.setup.discretizer.operators(self.cloud, self.volumetric)

    def flow_of(self, law: ConstitutiveLaw, inertia: Inertia | None = None) -> Flow:
        return Flow(
            self.cloud,
            self.operators,
            law,
            self.scene.boundary_velocity(self.cloud, law, self.time),
            self.scene.penalty_modulus(law) if self.volumetric else 0.0,
            inertia,
            self.scene.body_force(self.cloud.nodes[self.cloud.interior], law),
        )

    def solve_increment(self, k: int, flow: Flow) -> Outcome:
        """The case's own method on one increment; its rows, counts and largest residual are kept."""
        setup, branches = self.setup, self.tangent.branches
        outcome = driver.solve(
            flow, setup.solver, self.tangent, flow.unknowns(self.velocity), setup.stop, setup.budget, self.ledger
        )
        solved = outcome.status is Status.CONVERGED
        self.iterations += max(0, len(outcome.steps) - 1)
        self.rows += [{"increment": k, "time": self.time, "accepted": False, **row} for row in outcome.steps]
        if self.validity_time is None and branches >= 1 and self.tangent.branches > 1:
            self.validity_time = (k - 1) * self.scene.increment
        self.residual_norm = float(np.fmax(self.residual_norm, outcome.residual_norm))
        if solved:
            self.flow = flow
            self.velocity = flow.velocity(outcome.state)
            self.increments += 1
            self.rows[-1]["accepted"] = True
            if self.probe is not None:
                places = zip(("x", "y", "u", "v"), (*self.cloud.nodes[self.probe], *self.velocity[self.probe]), strict=True)
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

    # What is left behind.

    def snapshot_if_due(self) -> None:
        """Record the fields when this time, to half an increment, is one of those asked for, or the last."""
        asked = (*self.setup.record, self.scene.horizon or 0.0)
        half = 0.5 * self.scene.increment
        if any(abs(self.time - moment) < half for moment in asked):
            self.snapshots.append(self.snapshot())

    def snapshot(self) -> pd.DataFrame:
        nodes, cloud = self.cloud.nodes, self.cloud
        flow = self.flow or self.flow_of(self.setup.law)
        values = self.setup.discretizer.values(self.operators.strain_points, nodes)
        strain_rate = (self.operators.strain @ self.velocity.ravel()).reshape(3, -1)
        at_nodes = np.stack([values @ component for component in strain_rate])
        exact = self.scene.exact(flow.law, nodes, self.time)
        names = np.full(len(nodes), "", dtype=object)
        for name, group in cloud.boundaries.items():
            names[group] = name
        return pd.DataFrame(
            {
                "time": self.time,
                "node": np.arange(len(nodes)),
                "boundary": names,
                "x0": self.initial.nodes[:, 0],
                "y0": self.initial.nodes[:, 1],
                "x": nodes[:, 0],
                "y": nodes[:, 1],
                "u": self.velocity[:, 0],
                "v": self.velocity[:, 1],
                "exx": at_nodes[0],
                "eyy": at_nodes[1],
                "exy": at_nodes[2],
                "rate": np.sqrt(rate_squared(at_nodes)),
                "exact_u": exact.velocity[:, 0] if exact else np.nan,
                "exact_v": exact.velocity[:, 1] if exact else np.nan,
            }
        )

    def record(self, status: Status, detail: str) -> Record:
        ledger, start = self.ledger, self.start_ledger
        factors = self.tangent.factors
        validity = self.validity_time
        if validity is None and self.increments:
            validity = self.time if self.scene.increments else None
        summary: dict[str, Any] = {
            "status": status.word,
            "message": detail if status is Status.CONVERGED else f"{status.sentence}; {detail}" if detail != status.sentence else detail,
            "increments": self.increments,
            "time": self.time,
            "iterations": self.iterations,
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
            "ordering": factors.ordering if factors else None,
            "fill": factors.fill if factors else None,
            "factor_solve_ratio": ledger.each("factorization") / ledger.each("triangular_solve"),
            "residual_norm": self.residual_norm,
        }
        if hasattr(self, "cloud"):
            summary |= {"nodes": len(self.cloud.nodes), "unknowns": 2 * len(self.cloud.interior)}
        if self.flow is not None:
            summary |= self.errors(self.flow) | self.wall_reaction(self.flow)
        steps = pd.DataFrame(self.rows, columns=[name for name in STEPS if name != "case"])
        fields = pd.concat(self.snapshots, ignore_index=True) if self.snapshots else pd.DataFrame()
        return Record(summary, steps, fields)

    def errors(self, flow: Flow) -> dict[str, float]:
        """Relative ℓ² error of the velocities at the last solved increment, where the scene has an exact solution."""
        exact = self.scene.exact(flow.law, flow.cloud.nodes, self.time)
        if exact is None:
            return {}
        return {"velocity_error": float(np.linalg.norm(self.velocity - exact.velocity) / np.linalg.norm(exact.velocity))}

    def wall_reaction(self, flow: Flow) -> dict[str, float]:
        """Force −∮ σ n ds and torque −∮ x × σ n ds of the moving wall on the material, over the scene's contour."""
        contour = self.scene.contour()
        if contour is None:
            return {}
        edges = np.roll(contour, -1, axis=0) - contour
        middles = contour + 0.5 * edges
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)  # outward of a counter-clockwise contour, times length
        u = flow.unknowns(self.velocity)
        values = self.setup.discretizer.values(flow.operators.strain_points, middles)
        xx, yy, xy = (values @ component for component in flow.stress_at_points(u))
        pressure = flow.pressure_stress(u)
        if pressure is not None and flow.operators.volume_points is not None:
            volumetric = self.setup.discretizer.values(flow.operators.volume_points, middles) @ pressure
            xx, yy = xx + volumetric, yy + volumetric
        traction = np.stack([xx * normals[:, 0] + xy * normals[:, 1], xy * normals[:, 0] + yy * normals[:, 1]], axis=1)
        moment = middles[:, 0] * traction[:, 1] - middles[:, 1] * traction[:, 0]
        reaction = {
            "force_x": -float(traction[:, 0].sum()),
            "force_y": -float(traction[:, 1].sum()),
            "torque": -float(moment.sum()),
        }
        exact = self.scene.exact(flow.law, flow.cloud.nodes, self.time)
        if exact is not None and "torque" in exact.quantities:
            reaction["torque_error"] = abs(reaction["torque"] / exact.quantities["torque"] - 1.0)
        return reaction
