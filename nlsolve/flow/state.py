"""A flow at one time: its nodes, their operators, the pressure, and the velocity that was solved last."""

from __future__ import annotations

from copy import copy
from typing import Any, Protocol

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators, PointOperators
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import ConstitutiveLaw, rate_squared
from nlsolve.contracts.continuum.terms import NodeMotion, Physics, Recording, TimeSteps
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.scene import Entry
from nlsolve.flow.accuracy.enrichment import Finer
from nlsolve.flow.claims.shapes import check_law, check_operators, check_velocity
from nlsolve.flow.continuation import Start
from nlsolve.flow.convection import Convection
from nlsolve.flow.momentum import Flow, Inertia
from nlsolve.flow.motion.moving_nodes import MovingNodes
from nlsolve.flow.motion.point_rates import Passage, PointRates
from nlsolve.series import Array
from nlsolve.solving.stopping import Budget


class FlowParts(Protocol):
    """The components of a flow by the names of their sections, as `FlowScene.sections` declares them."""

    scene: Geometry
    law: ConstitutiveLaw
    discretizer: Discretizer
    error_estimator: Discretizer | None
    linear: LinearSolver
    predictor: Predictor
    physics: Physics
    time: TimeSteps
    motion: NodeMotion
    start: Start
    budget: Budget
    record: Recording


class FlowState:
    """The present time, nodes, operators and pressure of a case, and the state that was solved last.

    time : the present time [s].
    discretizer : that of the case, with what it leaves open chosen for the law.
    cloud : the nodes at that time.
    operators, gradient : B, S, B_θ and S_θ of these nodes; ∂/∂x and ∂/∂y, or None without convection.
    pressure : p at the volume points, shape (L,) [MPa]; None until it has been iterated.
    velocity : of all nodes, solved last, shape (N, 2) [mm/s].
    guess : velocity of all nodes that the next solve begins with, shape (N, 2) [mm/s].
    drift : how far accumulated strain rates are from those of `velocity`; None as long as they are the same.
    others : operators of these nodes by other discretizers, as far as methods have asked for them.
    flow, unknowns : the problem solved last, and its solution, shape (2F,). Before the first solve `flow` is None and
        `unknowns` is not set.
    """

    def __init__(self, parts: FlowParts, entry: Entry) -> None:
        self.parts, self.scene, self.entry = parts, parts.scene, entry
        self.discretizer = parts.discretizer.for_law(parts.law, parts.scene.reference_rate)
        self.volumetric = bool(parts.physics.penalty)
        self.time = 0.0
        self.pressure: Array | None = None
        self.pressure_iterations = 0
        self.moving: MovingNodes | None = None
        self.cloud: Cloud
        self.operators: Operators
        self.drift: PointRates | None = None
        self.others: dict[Discretizer, Operators] = {}
        self.flow: Flow | None = None
        self.unknowns: Array

    def begin(self, cloud: Cloud) -> None:
        """Set the cloud at t = 0, build its operators, and start from rest. May raise SolveError (bad cloud), and
        TypeError, which names the plugin, for operators and viscosities of other shapes than their contracts'.
        """
        self.cloud = cloud
        check_law(self.parts.law)
        if self.parts.motion.moving:
            self.moving = MovingNodes(
                self.parts.scene, self.parts.motion, self.parts.time.increment, self.discretizer, cloud
            )
        self.build_operators()
        self.velocity = self.guess = np.zeros_like(cloud.nodes)

    def to_rest(self) -> None:
        """Forget what has been solved: the next solve begins at rest."""
        self.velocity = self.guess = np.zeros_like(self.cloud.nodes)
        self.flow = None

    def carry_to(self, cloud: Cloud, carry: Any) -> None:
        """Go on with other nodes at the same time; velocity and pressure are carried there. May raise SolveError.

        carry : sparse (M, N), values at the present nodes -> values at those of `cloud`.
        """
        self.velocity = self.guess = carry @ self.velocity
        self.cloud = cloud
        self.build_operators()

    def move_to(self, time: float, before: Array | None) -> Any:
        """Go on to `time` [s]: moving nodes get new places and operators, and velocities are carried to shifted nodes.

        before : velocity (N, 2) [mm/s] one increment earlier than the last.
        Returns the matrix (N, N) that gives the change of nodal values by a shift; None when no node is shifted.
        May raise SolveError (bad cloud).
        """
        self.time = time
        if self.moving is None:
            return None
        earlier, operators, searches = self.cloud, self.operators, self.moving.searches
        self.cloud, carry = self.moving.move(self.cloud, self.velocity, before, time)
        self.build_operators()
        if carry is not None:
            self.velocity = self.velocity + carry @ self.velocity
        if self.parts.motion.accumulates and self.flow is not None:
            rates = self.flow.rates(self.unknowns)
            passage = self._passage(earlier, operators, self.operators, kept=self.moving.searches == searches)
            self.drift = rates.at(*passage) - PointRates.of(self.operators, self.velocity)
        return carry

    def _passage(
        self, earlier: Cloud, here: Operators, there: Operators, kept: bool = False
    ) -> tuple[Passage, Passage | None]:
        """From the strain and volume points `here`, of an earlier cloud, to those `there`, of the present one."""

        def between(here: PointOperators, there: PointOperators) -> Passage:
            return Passage(here, there, earlier, self.cloud, self.parts.discretizer, kept)

        volumetric = here.volumetric, there.volumetric
        dilatation = None if volumetric[0] is None or volumetric[1] is None else between(volumetric[0], volumetric[1])
        return between(here.strain, there.strain), dilatation

    def build_operators(self) -> None:
        """Build the operators of the present nodes; the pressure is interpolated to the new volume points."""
        before = self.operators if self.pressure is not None else None
        self.others = {}
        with self.entry("operators"):
            if self.moving is None:
                self.operators = self.discretizer.operators(self.cloud, self.volumetric)
            else:
                self.operators = self.moving.operators(self.cloud, self.volumetric)
            self.gradient = self.parts.discretizer.gradient(self.cloud) if self.parts.physics.convection else None
        check_operators(self.parts.discretizer, self.operators, self.cloud)
        if before is not None:
            self.pressure = self.between_volume_points(before, self.operators) @ self.pressure

    def inertia_from(self, before: Array | None) -> Inertia | None:
        """ρ (V − V_k)/Δt with V_k = `before` (N, 2) [mm/s]; None when the physics leave inertia out."""
        if before is None or not self.parts.physics.inertia:
            return None
        return Inertia(self.parts.physics.density / self.parts.time.increment, before)

    def flow_of(
        self,
        law: ConstitutiveLaw,
        inertia: Inertia | None = None,
        load: float = 1.0,
    ) -> Flow:
        """The problem R(u) = 0 at the present time.

        inertia : None without inertia.
        load : factor on boundary velocities and body forces.
        """
        operators, physics = self.operators, self.parts.physics
        body_force = self.scene.body_force(self.cloud.nodes.take(self.cloud.interior, axis=0), law, physics)
        modulus: float | Array = 0.0
        if self.volumetric:
            modulus = physics.penalty_modulus(law, self.scene.reference_rate, self.rate_squared_at_volume_points)
        return Flow(
            self.cloud,
            operators,
            law,
            load
            * check_velocity(self.scene.called(), self.scene.boundary_velocity(self.cloud, law, self.time), self.cloud),
            modulus,
            self.pressure,
            inertia,
            Convection(physics.density, self.gradient) if self.gradient is not None else None,
            None if body_force is None else load * body_force,
            self.scene.reference_rate,
            self.drift,
            self.others,
        )

    def discretized_by(self, discretizer: Discretizer) -> FlowState:
        """This flow on the same nodes by another discretizer, without a pressure. May raise SolveError (bad cloud)."""
        there = copy(self)
        if discretizer not in self.others:
            with self.entry("operators"):
                self.others[discretizer] = discretizer.operators(self.cloud, self.volumetric)
        there.operators, there.pressure, there.others = self.others[discretizer], None, {}
        return there

    def at_rest_on(self, cloud: Cloud, discretizer: Discretizer) -> FlowState:
        """This flow at rest on another cloud by a discretizer that may be another one, without a pressure and without
        what has been accumulated. May raise SolveError (bad cloud).
        """
        there = copy(self)
        there.cloud, there.discretizer, there.moving, there.others = cloud, discretizer, None, {}
        there.pressure = there.drift = None
        same = discretizer == self.discretizer and len(cloud.nodes) == len(self.cloud.nodes)
        there.operators = self.operators if same else discretizer.operators(cloud, self.volumetric)
        there.gradient = None if self.gradient is None else discretizer.gradient(cloud)
        there.to_rest()
        return there

    def enriched(self, finer: Finer, discretizer: Discretizer, velocity: Array) -> FlowState:
        """This flow, solved last with `velocity` (N, 2), on a finer cloud by a discretizer that may be another one.

        The pressure there is the one that the penalty has built up here. May raise SolveError (bad cloud).
        """
        assert self.flow is not None
        there = self.at_rest_on(finer.cloud, discretizer)
        there.velocity = there.guess = finer.carry(velocity)
        pressure = self.flow.pressure(self.flow.unknowns(velocity))
        if pressure is not None:
            there.pressure = self.between_volume_points(self.operators, there.operators) @ pressure
        if self.drift is not None:
            there.drift = self.drift.at(*self._passage(self.cloud, self.operators, there.operators))
        return there

    def rate_squared_at_volume_points(self) -> Array:
        """ε̄² of the velocity so far, taken at the strain point nearest to each volume point, shape (L,)."""
        return rate_squared(self.operators.strain_rate(self.velocity)[:, self.operators.strain_points_beside])

    def between_volume_points(self, here: Operators, there: Operators) -> Any:
        """Sparse matrix that takes pressures from the volume points of `here` to those of `there`."""
        assert here.volumetric is not None
        assert there.volumetric is not None
        return self.parts.discretizer.values(here.volumetric.points, there.volumetric.points)

    def keep(self, flow: Flow, unknowns: Array) -> None:
        """Keep a problem with its solution (2F,), which is measured and which the next solve begins with."""
        self.flow, self.unknowns = flow, unknowns
        self.velocity = self.guess = flow.velocity(unknowns)
