"""First state, then increment after increment: one case from its components to its record."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.continuation import Stage, walk
from nlsolve.flow.momentum import Flow
from nlsolve.flow.moving_nodes import Markers
from nlsolve.flow.observables import divergence, nodal_fields, velocity_error, wall_reaction
from nlsolve.flow.setup import Progress, Record, Setup
from nlsolve.flow.state import Balance
from nlsolve.flow.validity import audit
from nlsolve.results.columns import STEPS
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.summary import reported
from nlsolve.solving.tangent import Tangent


def march(
    setup: Setup,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] = time.process_time,
) -> Record:
    """Run one case; every ending, failure included, is in the record. `clock` is what its seconds are told by."""
    return _March(setup, listen or (lambda progress: None), clock).run()


class _March:
    """One case on its way: the balance it has got to, and the books of the start and of the march."""

    def __init__(self, setup: Setup, listen: Callable[[Progress], None], clock: Callable[[], float]) -> None:
        self.setup, self.scene, self.listen = setup, setup.scene, listen
        self.start_ledger, self.ledger = Ledger(clock), Ledger(clock)
        self.start_tangent = Tangent(setup.linear, None, self.start_ledger)
        self.tangent = Tangent(setup.linear, setup.refresh, self.ledger)
        self.balance = Balance(setup, self.ledger)
        self.rows: list[dict[str, Any]] = []
        self.snapshots: list[pd.DataFrame] = []
        self.increments = self.iterations = 0
        self.validity_time: float | None = None
        self.residual_norm = float("nan")
        self.claimed_wrongly = self.denied_wrongly = 0
        self.blame: Mapping[str, float] = {}
        self.sizes: dict[str, float | None] = {"nodes": None, "unknowns": None, "smallest_spacing": None}
        self.markers: Markers | None = None
        self.past: list[Array] = []  # velocities of the same nodes at the ends of the increments, latest first
        self.before: Array | None = None  # velocity one increment earlier

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
        """The cloud at t = 0, the balance on it, and the node that is watched."""
        self.initial = cloud = self.scene.cloud(self.setup.law)
        self.sizes = {
            "nodes": len(cloud.nodes),
            "unknowns": 2 * len(cloud.interior),
            "smallest_spacing": float(cloud.nearest_distance.min()),
        }
        self.balance.begin(cloud)
        probe, inside = self.scene.probe, cloud.interior
        self.probe = (
            None if probe is None else int(inside[np.linalg.norm(cloud.nodes[inside] - probe, axis=1).argmin()])
        )

    def first_state(self) -> Outcome:
        """Quasi-static state at t = 0 by continuation; a steady scene's last stage is the case's own."""
        steady, start, balance = not self.scene.increments, self.setup.start, self.balance

        def solve_stage(stage: Stage, last: bool) -> Outcome:
            if not last:
                return self.start_stage(stage)
            if not steady:
                return balance.iterate_pressure(lambda: self.start_stage(stage))
            self.take_over()
            return balance.iterate_pressure(lambda: self.solve_increment(0, balance.flow_of(stage.law)))

        outcome, stage = walk(start, self.setup.law, solve_stage)
        self.take_over()
        if outcome.status is Status.CONVERGED:
            if self.scene.markers or self.scene.shifting:
                self.markers = Markers(self.scene, self.setup.discretizer, self.initial, balance.velocity)
            self.record_fields_if_due()
        elif not steady or stage.load < 1.0 or stage.law is not self.setup.law:
            detail = f"on the way to the first state, at {start.by} = {stage.value:g}: {outcome.detail}"
            return Outcome(outcome.status, detail, outcome.state, outcome.residual_norm)
        return outcome

    def take_over(self) -> None:
        """The case's own tangent, in the ordering that the start settled on, unless it is there already."""
        if not self.tangent.branches:
            self.tangent = Tangent(self.setup.linear, self.setup.refresh, self.ledger, self.start_tangent.factors)

    def start_stage(self, stage: Stage) -> Outcome:
        """The starting method on one stage; a state it converges to is kept."""
        setup = self.setup
        with self.start_ledger.entry("stage"):
            flow = self.balance.flow_of(stage.law, load=stage.load)
            outcome = solve(
                flow,
                setup.starter,
                self.start_tangent,
                flow.unknowns(self.balance.guess),
                StoppingTest(kind="residual", tolerance=setup.start.tolerance),
                setup.start.budget(setup.budget),
                self.start_ledger,
            )
        self.blame = outcome.blame
        if outcome.status is Status.CONVERGED:
            self.balance.keep(flow, outcome.state)
        return outcome

    def advance(self, k: int) -> Outcome:
        """One time step: move the nodes if the scene moves them, then solve the balance at its end."""
        balance, predictor = self.balance, self.setup.predictor
        carry = balance.move_to(k * self.scene.increment, self.before)
        if carry is not None:
            self.past = [velocity + carry @ velocity for velocity in self.past]
        previous = balance.velocity
        self.past = [previous, *self.past][: predictor.depth]
        balance.guess = predictor.guess(self.past)
        inertia = balance.inertia_from(previous)
        outcome = balance.iterate_pressure(lambda: self.solve_increment(k, balance.flow_of(self.setup.law, inertia)))
        if outcome.status is Status.CONVERGED:
            self.before = previous
            if self.markers is not None:
                self.markers.advance(balance.cloud, balance.velocity, balance.time)
            self.record_fields_if_due()
        return outcome

    def solve_increment(self, k: int, flow: Flow) -> Outcome:
        """The case's own method on one increment; its rows, counts and largest residual are kept."""
        setup = self.setup
        guess = setup.start.disturbed(flow, flow.unknowns(self.balance.guess), k)
        outcome = solve(flow, setup.solver, self.tangent, guess, setup.stop, setup.budget, self.ledger)
        solved = outcome.status is Status.CONVERGED
        self.iterations += outcome.iterations
        self.claimed_wrongly += outcome.claimed_wrongly
        self.denied_wrongly += outcome.denied_wrongly
        self.blame = outcome.blame
        self.rows += [{"increment": k, "time": self.balance.time, "accepted": False, **row} for row in outcome.rows]
        if self.validity_time is None and self.scene.increments and self.tangent.branches > 1:
            self.validity_time = (k - 1) * self.scene.increment
        before = self.residual_norm if k else np.nan  # of a steady scene the last solve counts: a start may repeat it
        self.residual_norm = float(np.fmax(before, outcome.residual_norm))
        if solved:
            self.balance.keep(flow, outcome.state)
            self.increments = max(k, 1)
            self.rows[-1]["accepted"] = True
            if self.probe is not None:
                place, velocity = self.balance.cloud.nodes[self.probe], self.balance.velocity[self.probe]
                seen = zip(("x", "y", "u", "v"), (*place, *velocity), strict=True)
                self.rows[-1] |= {f"probe_{name}": value for name, value in seen}
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

    def record_fields_if_due(self) -> None:
        """Keep the fields when this time, to half an increment, is one of those asked for, or the last."""
        setup, scene, now = self.setup, self.scene, self.balance
        asked = (*setup.record, scene.horizon or 0.0)
        if any(abs(now.time - moment) < 0.5 * scene.increment for moment in asked):
            assert now.flow is not None
            fields = nodal_fields(scene, setup.discretizer, now.flow, now.velocity, self.initial, now.time)
            places = np.full_like(self.initial.nodes, np.nan) if self.markers is None else self.markers.places
            self.snapshots.append(fields.assign(marker_x=places[:, 0], marker_y=places[:, 1]))

    def record(self, status: Status, detail: str) -> Record:
        """The row of the case, whatever its ending; what is measured on fields is of the last solved increment."""
        ledger, start, balance = self.ledger, self.start_ledger, self.balance
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
            "cloud_quality": None if balance.moving is None else balance.moving.quality,
            "increments": self.increments,
            "time": reached,
            "iterations": self.iterations,
            "pressure_iterations": balance.pressure_iterations if self.scene.divergence else None,
            "branches": self.tangent.branches,
            "validity_time": validity,
            **ledger.work(),
            **reported(self.rows),
            "start_factorizations": start.counts["factorization"],
            "start_triangular_solves": start.counts["triangular_solve"],
            "start_residuals": start.counts["residual"],
            "seconds_operators": ledger.seconds["operators"],
            "seconds_start": start.seconds["stage"],
            "seconds_all": ledger.seconds["method"] + ledger.seconds["operators"] + start.seconds["stage"],
            **self.tangent.facts(),
            "residual_norm": self.residual_norm,
        }
        flow, unknowns = balance.flow, None
        if flow is not None:
            unknowns, discretizer = balance.unknowns, self.setup.discretizer
            velocity = flow.velocity(unknowns)
            change = None if self.before is None else (velocity - self.before) / self.scene.increment
            summary["divergence"] = divergence(flow, velocity)
            summary |= velocity_error(self.scene, flow, velocity, reached)
            summary |= wall_reaction(self.scene, discretizer, flow, velocity, reached)
            estimate = {"estimate": lambda: balance.error_estimate(velocity, self.before)}
            solved = status is Status.CONVERGED
            summary |= audit(self.scene, discretizer, flow, velocity, change, reached, **(estimate if solved else {}))
        steps = pd.DataFrame(self.rows, columns=[name for name in STEPS if name != "case"])
        fields = pd.concat(self.snapshots, ignore_index=True) if self.snapshots else pd.DataFrame()
        return Record(summary, steps, fields, flow, unknowns)
