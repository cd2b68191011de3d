"""The simulation of a flow: its first state, then increment after increment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.scene import Entry, Simulation, Solve, Workload
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.adaptation import Adaptation
from nlsolve.flow.accuracy.enrichment import interpolation
from nlsolve.flow.accuracy.estimate import NOTHING_TO_COMPARE, Comparison, compared
from nlsolve.flow.claims.units import SMALL, WAY_OUT
from nlsolve.flow.continuation import REST, Solves, Stage
from nlsolve.flow.first_state.first_state import FirstState
from nlsolve.flow.incompressibility import iterate_pressure
from nlsolve.flow.momentum import Flow
from nlsolve.flow.motion.markers import Markers
from nlsolve.flow.observables import divergence, nodal_fields, rate_drift, velocity_error, wall_reaction
from nlsolve.flow.state import FlowParts, FlowState
from nlsolve.flow.validity import audit
from nlsolve.series import Array

UNSOLVED = (Status.BUDGET_SPENT, Status.STAGNATED, Status.DIVERGED)
"""Of iterations that have not arrived."""


class FlowSimulation(Simulation):
    """The flow of one case: a quasi-static first state reached by continuation, or rest, then time steps by implicit
    Euler.

    A steady flow is its first state; the last stage of the continuation is then solved by the method of the case.
    Adaptive nodes are made on the way there, and the method of the case solves the flow on the last of their clouds.
    """

    prepares = True

    def __init__(self, parts: FlowParts, entry: Entry) -> None:
        self.parts, self.increments = parts, parts.time.increments
        self.state = FlowState(parts, entry)
        self.snapshots: list[pd.DataFrame] = []
        self.sizes = {"nodes": None, "unknowns": None, "smallest_spacing": None}
        self.markers: Markers | None = None
        self.past: list[Array] = []  # velocities of the same nodes at the ends of the increments, latest first
        self.before: Array | None = None  # velocity one increment earlier
        self.reached = 0.0  # time of the last solved increment
        self.probe: int | None = None
        self.rest: Array | None = None  # velocity at t = 0 of a march that begins at rest
        self.adaptation = None if parts.scene.adaptive is None else Adaptation(parts.scene.adaptive)
        self.way = FirstState(
            self.state, self.adaptation, not self.increments, lambda flow: self.increment(0, flow), self.settle
        )

    def solves(self) -> Solves:
        """Yields the problems of the first state and of each increment, until one fails. May raise SolveError."""
        self.begin()
        if self.parts.start.at == REST:
            done, outcome = 1, (yield from self.first_increment_from_rest())
        else:
            done, outcome = 0, (yield from self.first_state())
        for k in range(done + 1, self.increments + 1):
            if outcome.status is not Status.CONVERGED:
                break
            outcome = yield from self.advance(k)
        return self.advised(outcome)

    def advised(self, outcome: Outcome) -> Outcome:
        """The outcome, with the advice of the discretizer where no iteration has arrived."""
        if outcome.status not in UNSOLVED:
            return outcome
        advice = self.parts.discretizer.advice(self.parts.law, self.parts.scene.reference_rate)
        if not advice:
            return outcome
        said = outcome.detail == outcome.status.sentence
        return replace(outcome, detail=advice if said else f"{outcome.detail}; {advice}")

    def keep(self, solve: Solve, state: Array) -> Mapping[str, float]:
        """Keep a solved state (2F,); returns the drift of accumulated strain rates, and place and velocity of the
        probe, when there are such."""
        assert isinstance(solve.problem, Flow)
        self.state.keep(solve.problem, state)
        if solve.preparation is not None:
            return {}
        self.reached = solve.time
        measures = {"rate_drift": rate_drift(solve.problem, state)} if self.parts.motion.accumulates else {}
        if self.probe is None:
            return measures
        place, velocity = self.state.cloud.nodes[self.probe], self.state.velocity[self.probe]
        probed = {f"probe_{name}": float(value) for name, value in zip("xyuv", (*place, *velocity), strict=True)}
        return measures | probed

    # The parts of a march.

    def begin(self) -> None:
        """Build the cloud at t = 0 and its operators. May raise SolveError."""
        cloud = self.cloud()
        self.settle(cloud)
        self.state.begin(cloud)
        if self.parts.start.stored is not None:
            nodes, velocity = self.parts.start.stored.velocity()
            moved = nodes.shape != cloud.nodes.shape or not np.allclose(nodes, cloud.nodes)
            if moved:
                velocity = interpolation(Cloud(nodes, {}), cloud.nodes) @ velocity
            self.state.guess = self.state.velocity = velocity

    def settle(self, cloud: Cloud) -> None:
        """Take `cloud` as that of t = 0, and find the node of the probe."""
        self.initial = cloud
        self.sizes = {
            "compiled_by": self.state.discretizer.compiled_by(),
            "nodes": len(cloud.nodes),
            "unknowns": 2 * len(cloud.interior),
            "smallest_spacing": float(cloud.nearest_distance.min()),
        }
        probe, inside = self.parts.record.probe, cloud.interior
        if probe is not None:
            self.probe = int(inside[np.linalg.norm(cloud.nodes[inside] - probe, axis=1).argmin()])

    def cloud(self) -> Cloud:
        """The nodes at t = 0. Raises SolveError (bad cloud) when none of them is inside."""
        given = self.parts.scene.cloud(self.parts.law)
        cloud = self.parts.discretizer.completed(given)
        if self.adaptation is not None:
            self.adaptation.added = len(cloud.nodes) / len(given.nodes)
        if not len(cloud.interior):
            extent = float(np.ptp(cloud.nodes, axis=0).max())
            raise SolveError(
                Status.BAD_CLOUD,
                f"all {len(cloud.nodes)} nodes lie on the boundary and none inside, so that nothing is left to solve "
                "for: choose a finer spacing, or a file with inner nodes"
                + (f"; the scene is {extent:.3g} mm wide: are its lengths in m? {WAY_OUT}" if extent < SMALL else ""),
            )
        return cloud

    def first_state(self) -> Solves:
        """Solve the quasi-static problem at t = 0; the method of the case solves a steady one."""
        parts, state = self.parts, self.state
        outcome, stage = yield from self.way.solves()
        if outcome.status is Status.CONVERGED:
            assert state.flow is not None
            self.record_beginning(state.flow)
        elif self.increments or stage.load < 1.0 or stage.law is not parts.law:
            detail = f"on the way to the first state, at {parts.start.by} = {stage.value:g}: {outcome.detail}"
            return replace(outcome, detail=detail)
        return outcome

    def first_increment_from_rest(self) -> Solves:
        """V(t = 0) = 0 inside, and what is prescribed on the boundary; the method of the case solves increment 1.

        Within it V grows linearly for nodes and markers. V has then jumped to the flow, and later increments do not
        extrapolate over that. May raise SolveError.
        """
        flow = self.state.flow_of(self.parts.law)
        self.rest = self.state.velocity = flow.velocity(flow.unknowns(self.state.guess))
        self.record_beginning(flow)
        outcome = yield from self.advance(1)
        self.past = []
        if self.markers is not None:
            self.markers.forget_earlier()
        return outcome

    def record_beginning(self, flow: Flow) -> None:
        """Record t = 0, and set out the markers there."""
        parts = self.parts
        if parts.motion.markers or parts.motion.shifting:
            self.markers = Markers(
                parts.scene, parts.time.increment, parts.discretizer, self.initial, self.state.velocity
            )
        self.record_fields_if_due(flow)

    def advance(self, k: int) -> Solves:
        """Solve increment k: move the nodes if they move, then yield the problem at its end. May raise SolveError."""
        state, predictor = self.state, self.parts.predictor
        carry = state.move_to(k * self.parts.time.increment, self.before)
        if carry is not None:
            self.past = [velocity + carry @ velocity for velocity in self.past]
        previous = state.velocity
        self.past = [previous, *self.past][: predictor.depth]
        state.guess = predictor.guess(self.past)
        inertia = state.inertia_from(previous)
        outcome = yield from iterate_pressure(state, lambda: self.increment(k, state.flow_of(self.parts.law, inertia)))
        if outcome.status is Status.CONVERGED:
            self.before = previous
            if self.markers is not None:
                self.markers.advance(state.cloud, state.velocity, state.time)
            assert state.flow is not None
            self.record_fields_if_due(state.flow)
        return outcome

    def increment(self, k: int, flow: Flow) -> Solves:
        """Yields the problem of increment k for the method of the case, with its first guess."""
        guess = self.parts.start.disturbed(flow, flow.unknowns(self.state.guess), k)
        return (yield Solve(flow, guess, k, self.state.time))

    # What is recorded and measured.

    def record_fields_if_due(self, flow: Flow) -> None:
        """Record the fields when the time is within half an increment of a recorded time or of the horizon."""
        parts, now = self.parts, self.state
        asked = (*parts.record.times, parts.time.horizon or 0.0)
        if any(abs(now.time - moment) < 0.5 * parts.time.increment for moment in asked):
            fields = nodal_fields(parts.scene, parts.discretizer, flow, now.velocity, self.initial, now.time)
            places = np.full_like(self.initial.nodes, np.nan) if self.markers is None else self.markers.places
            self.snapshots.append(fields.assign(marker_x=places[:, 0], marker_y=places[:, 1]))

    def fields(self) -> pd.DataFrame:
        """One row for each node and recorded time (columns of `FIELDS`)."""
        return pd.concat(self.snapshots, ignore_index=True) if self.snapshots else pd.DataFrame()

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """Time, divergence, errors, the reaction of the moving wall and the audits of the last solved increment."""
        parts, state = self.parts, self.state
        iterated = parts.physics.divergence_tolerance is not None
        found: dict[str, Any] = {
            "cloud_quality": None if state.moving is None else state.moving.quality,
            "time": self.reached,
            "pressure_iterations": state.pressure_iterations if iterated else None,
        }
        if state.flow is None:
            return found
        flow, velocity, time = state.flow, state.flow.velocity(state.unknowns), self.reached
        found["form"] = "conservative" if flow.operators.is_conservative else "strong"
        change = None if self.before is None else (velocity - self.before) / parts.time.increment
        if parts.motion.accumulates:
            found["rate_drift"] = rate_drift(flow, state.unknowns)
        found["divergence"] = divergence(flow, velocity)
        found |= velocity_error(parts.scene, flow, velocity, time)
        found |= wall_reaction(parts.scene, parts.motion, parts.discretizer, flow, velocity, time)

        if self.adaptation is not None:
            found |= {
                "cloud_rounds": self.adaptation.rounds,
                "estimate_factorizations": self.adaptation.factorizations,
            }

        def estimate() -> Comparison:
            if self.adaptation is not None and self.adaptation.found is not None:
                return self.adaptation.found
            solved = outcome.status is Status.CONVERGED
            return compared(state, velocity, self.before) if solved else NOTHING_TO_COMPARE

        error = found.get("velocity_error_inside", float("nan"))
        return found | audit(parts, flow, velocity, change, time, estimate, error)

    def place(self, blame: Mapping[str, float]) -> str:
        """The place of the largest residual and the strain rate there, in words."""
        if "blame_x" not in blame:
            return ""
        x, y, rate = (blame[f"blame_{name}"] for name in ("x", "y", "rate"))
        return f"the residual is largest at ({x:.3g}, {y:.3g}), where ε̄ = {rate:.2g} 1/s"

    # What is known before anything is solved.

    def sample(self) -> tuple[NonlinearProblem, Array]:
        """The problem at t = 0, and the state (2F,) that one Newton step from rest reaches in the first stage of the
        continuation, or in the problem itself when the march begins at rest. When the law of that stage is Newtonian,
        the state is a Newtonian flow.

        May raise SolveError.
        """
        parts, state = self.parts, self.state
        self.begin()
        first = next(iter(parts.start.stages(parts.law)), Stage(parts.law, 1.0, 1.0))
        easiest = state.flow_of(first.law, load=first.load)
        rest = easiest.unknowns(state.velocity)
        factors = parts.linear.factorize(easiest.jacobian(rest))
        u = rest - factors.solve(easiest.residual(rest))
        state.keep(easiest, u)
        return state.flow_of(parts.law), u

    def workload(self) -> Workload:
        """Increments, clouds that are discretised, and stages of the continuation; a descent costs as much as one."""
        increments = max(1, self.increments)
        clouds = 1 + (increments if self.parts.motion.moving else 0)
        return Workload(increments, clouds, self.way.count)

    def diagnostics(self) -> list[dict[str, Any]]:
        """One row for each operator of the cloud at t = 0 on its quality, or one with the reason why there is none."""
        cloud = self.cloud()
        try:
            found = self.parts.discretizer.diagnostics(cloud) or [{"operator": "this discretizer gives no diagnostics"}]
        except SolveError as refusal:
            return [{"operator": refusal.detail}]
        return [{"nodes": len(cloud.nodes), **row} for row in found]
