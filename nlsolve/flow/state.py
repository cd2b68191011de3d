"""The balance of momentum at one moment: the nodes, their operators, the pressure, and the state solved for last."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Operators
from nlsolve.contracts.continuum.law import ConstitutiveLaw, rate_squared
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status
from nlsolve.flow.incompressibility import pressure_mixing
from nlsolve.flow.momentum import Convection, Flow, Inertia
from nlsolve.flow.moving_nodes import MovingNodes
from nlsolve.flow.observables import discretization_error, divergence
from nlsolve.flow.setup import Setup
from nlsolve.series import Array
from nlsolve.solving.ledger import Ledger


class Balance:
    """What the equations of a case are now, and the last state that solved them.

    time : now [s].
    cloud, operators, gradient : the nodes, B, S, B_θ and S_θ on them, and ∂/∂x, ∂/∂y where the scene convects.
    pressure : at the volume points, shape (L,) [MPa], iterated where the scene asks for a divergence; None before.
    velocity, guess : of the nodes, shape (N, 2) [mm/s]: solved for last, and where the next solve begins.
    flow, unknowns : solved last; None, and absent, before the first.
    """

    def __init__(self, setup: Setup, ledger: Ledger) -> None:
        self.setup, self.scene, self.ledger = setup, setup.scene, ledger
        self.volumetric = bool(self.scene.penalty)
        self.time = 0.0
        self.pressure: Array | None = None
        self.pressure_iterations = 0
        self.moving: MovingNodes | None = None
        self.cloud: Cloud
        self.operators: Operators
        self.flow: Flow | None = None
        self.unknowns: Array

    def begin(self, cloud: Cloud) -> None:
        """The cloud at t = 0, its operators, and rest inside."""
        self.cloud = cloud
        if self.scene.motion_of_nodes == "lagrangian":
            self.moving = MovingNodes(self.scene, self.setup.discretizer, cloud)
        self.build_operators()
        self.velocity = self.guess = np.zeros_like(cloud.nodes)

    def move_to(self, time: float, before: Array | None) -> Any:
        """The nodes and their operators at this time, if the scene moves them; velocities come along to shifted nodes.

        before : velocity (N, 2) one increment earlier than the last.
        Returns the matrix (N, N) by which nodal values change with shifted nodes, else None.
        """
        self.time = time
        if self.moving is None:
            return None
        self.cloud, carry = self.moving.move(self.cloud, self.velocity, before, time)
        self.build_operators()
        if carry is not None:
            self.velocity = self.velocity + carry @ self.velocity
        return carry

    def build_operators(self) -> None:
        """Of the nodes now; the pressure comes along to the new volume points."""
        before = self.operators if self.pressure is not None else None
        with self.ledger.entry("operators"):
            if self.moving is None:
                self.operators = self.setup.discretizer.operators(self.cloud, self.volumetric)
            else:
                self.operators = self.moving.operators(self.cloud, self.volumetric)
            self.gradient = self.setup.discretizer.gradient(self.cloud) if self.scene.convection else None
        if before is not None:
            self.pressure = self.between_volume_points(before, self.operators) @ self.pressure

    def inertia_from(self, before: Array | None) -> Inertia | None:
        """ρ (V − V_k)/Δt with V_k = `before`, where the scene keeps it."""
        if before is None or not self.scene.inertia:
            return None
        return Inertia(self.scene.density / self.scene.increment, before)

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
        assert operators.volumetric is not None
        nearest = cKDTree(operators.strain.points).query(operators.volumetric.points)[1]
        return rate_squared(operators.strain_rate(self.velocity)[:, nearest])

    def between_volume_points(self, here: Operators, there: Operators) -> Any:
        """The matrix that takes pressures from the volume points of some operators to those of others."""
        assert here.volumetric is not None
        assert there.volumetric is not None
        return self.setup.discretizer.values(here.volumetric.points, there.volumetric.points)

    def keep(self, flow: Flow, unknowns: Array) -> None:
        """A solved state: what is measured, and where the next solve begins."""
        self.flow, self.unknowns = flow, unknowns
        self.velocity = self.guess = flow.velocity(unknowns)

    def iterate_pressure(self, solve_once: Callable[[], Outcome]) -> Outcome:
        """Solve, and iterate the pressure until ‖div v‖ ≤ divergence · ‖ε̄‖ where the scene asks for that."""
        asked, most, mixing = self.scene.divergence, self.setup.budget.pressures, pressure_mixing()
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
            pressure = np.zeros_like(image) if self.pressure is None else self.pressure
            self.pressure = mixing.next(pressure, image - pressure)
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

    def error_estimate(self, velocity: Array, before: Array | None) -> float:
        """By the error estimator, of the `velocity` at the end of an increment that began with `before`; NaN without
        one.
        """
        if self.setup.error_estimator is None:
            return float("nan")
        others = self.setup.error_estimator.operators(self.cloud, self.volumetric)
        flow = self.flow_of(self.setup.law, self.inertia_from(before), others=others)
        return discretization_error(flow, velocity, self.setup.linear)


def sample(setup: Setup, clock: Callable[[], float] = time.process_time) -> tuple[Flow, Array, Ledger]:
    """The balance of a case at t = 0, a state for it, and the books of its operators; nothing is iterated.

    The state is one Newton step away from rest under the easiest law of the way to the first state: where that law is
    Newtonian, the flow of a Newtonian material. Raises SolveError.
    """
    ledger = Ledger(clock)
    balance = Balance(setup, ledger)
    balance.begin(setup.scene.cloud(setup.law))
    first = setup.start.stages(setup.law)[0]
    easiest = balance.flow_of(first.law, load=first.load)
    rest = easiest.unknowns(balance.velocity)
    factors = setup.linear.factorize(easiest.jacobian(rest))
    state = rest - factors.solve(easiest.residual(rest))
    balance.keep(easiest, state)
    return balance.flow_of(setup.law), state, ledger
