"""The problem R(u) = 0 of a flow at one time, and what is read from its states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud, node_major
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators, PointOperators
from nlsolve.contracts.continuum.law import ConstitutiveLaw, Number, stress, tangent_moduli
from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.convection import Carried, Convection
from nlsolve.flow.momentum import places
from nlsolve.flow.momentum.expansion import FlowExpansion, Placing
from nlsolve.flow.momentum.matrices import isotropic, magnitude, pointwise, secant_moduli
from nlsolve.flow.motion.point_rates import PointRates
from nlsolve.series import Array, NoSeriesHere, Series


@dataclass(frozen=True)
class Inertia:
    """ρ/Δt [t/(mm³ s)] and the velocity (N, 2) of the same nodes one increment ago [mm/s]."""

    density_over_increment: float
    previous: Array


class Flow(NonlinearProblem):
    """R(u) = 0 for u, the velocities (u_0, v_0, u_1, …) of the interior nodes, shape (2F,) [mm/s]; R in [N/mm³], or in
    [N/mm] when the operators are a conservative form.

    cloud, operators : the nodes and their B, S, B_θ, S_θ.
    law : s(ε̇) = 2 μ(ε̄²) ε̇.
    boundary_velocity : prescribed velocities of the boundary nodes, shape (N − F, 2).
    penalty_modulus : λ [MPa s], one or (L,); the volumetric term is present when the operators have one.
    pressure : p at the volume points, shape (L,) [MPa], for the iterated penalty.
    inertia, convection, body_force : present when given; f at the interior nodes, shape (F, 2) [N/mm³].
    reference_rate : ε̄ [1/s] at which a Newtonian operator takes the viscosity when none is given.
    drift : ε̇ − B v and tr ε̇ − B_θ v [1/s] where strain rates are accumulated; absent: ε̇ = B v.
    others : operators of the same cloud by other discretizers, where those that `jacobian_by` builds are kept.
    """

    has_other_discretizations = True

    def __init__(
        self,
        cloud: Cloud,
        operators: Operators,
        law: ConstitutiveLaw,
        boundary_velocity: Array,
        penalty_modulus: float | Array = 0.0,
        pressure: Array | None = None,
        inertia: Inertia | None = None,
        convection: Convection | None = None,
        body_force: Array | None = None,
        reference_rate: float | None = None,
        drift: PointRates | None = None,
        others: dict[Discretizer, Operators] | None = None,
    ) -> None:
        self.cloud, self.operators, self.law = cloud, operators, law
        self._terms = inertia, convection
        self._reference_rate = reference_rate
        self._others = {} if others is None else others
        self.is_gradient = operators.is_conservative and convection is None
        self._free = node_major(cloud.interior)
        lifted = np.zeros(2 * len(cloud.nodes))
        lifted[node_major(cloud.boundary)] = boundary_velocity.ravel()
        self._lifted = lifted
        self._inside = Placing(self._free, len(lifted))
        self.drift = drift
        self._force = operators.strain.force
        self._volumetric: PointOperators | None = None
        self._inertia: Any = None
        self._carried: Carried | None = None
        areas = self._areas = np.ones(len(self._free)) * (
            1.0 if operators.node_areas is None else np.repeat(operators.node_areas, 2)
        )
        constant = np.zeros(len(self._free))
        self._modulus: Array | None = None
        self._pressure: Array | float = 0.0 if pressure is None else pressure
        volumetric = operators.volumetric
        if volumetric is not None and np.max(penalty_modulus) > 0.0:
            self._volumetric = volumetric
            self._modulus = np.full(len(volumetric.points), penalty_modulus)
            given = volumetric.rate @ lifted
            if drift is not None and drift.dilatation is not None:
                given = given + drift.dilatation
            constant -= volumetric.force @ (self._modulus * given)
            if pressure is not None:
                constant += volumetric.force @ pressure
        if inertia is not None:
            self._inertia = areas * inertia.density_over_increment
            constant -= self._inertia * self.unknowns(inertia.previous)
        if convection is not None:
            self._carried = Carried(convection, cloud, areas, lifted)
        if body_force is not None:
            constant -= areas * body_force.ravel()
        self._constant = constant
        self._known: tuple[Array, tuple[Array, Array | None]] | None = None
        self._to_nodes: tuple[Discretizer, Any] | None = None

    def residual(self, u: Array) -> Array:
        """R(u), (2F,)."""
        return self._balance(u, self._stresses_at(u))

    def expand(self, u: Array) -> Expansion:
        """The expansion of R around u: the formula of the residual, run on a series that begins with u.

        Its coefficients raise SolveError (non-finite) where the law has no series at a strain rate of u.
        """
        path = Series(u)
        return FlowExpansion(path, self._balance(path, self._stresses(path)), self.without_series)

    def _stresses_at(self, u: Array) -> tuple[Array, Array | None]:
        """`_stresses` of a state, kept: a solve asks for `scale` and `residual` where it starts."""
        if self._known is None or not np.array_equal(self._known[0], u):
            self._known = u.copy(), self._stresses(u)
        return self._known[1]

    def _stresses(self, u: Number) -> tuple[Number, Number | None]:
        """s at the strain points, (3M,), and λ B_θ v at the volume points, (L,), None without a volumetric term."""
        placed = self._inside @ u
        deviatoric = stress(self.law, self._strain_rate(placed)).reshape(-1)
        if self._volumetric is None:
            return deviatoric, None
        return deviatoric, self._modulus * (self._volumetric.rate @ placed)

    def _balance(self, u: Number, stresses: tuple[Number, Number | None]) -> Number:
        deviatoric, volumetric = stresses
        balance = self._constant - self._force @ deviatoric
        if self._volumetric is not None:
            balance = balance - self._volumetric.force @ volumetric
        if self._inertia is not None:
            balance = balance + self._inertia * u
        if self._carried is not None:
            balance = balance + self._carried.force(u)
        return balance

    def strain_rate(self, u: Number) -> Number:
        """ε̇ at the strain points, (3, M) ordered xx, yy, xy [1/s]."""
        return self._strain_rate(self._inside @ u)

    def _strain_rate(self, placed: Number) -> Number:
        """ε̇ of velocities (2N,) that are zero on the boundary, to which the prescribed ones are added."""
        rate = (self.operators.strain.rate @ (placed + self._lifted)).reshape(3, -1)
        return rate if self.drift is None else rate + self.drift.strain

    def jacobian(self, u: Array) -> Any:
        """J = W ρ (1/Δt + ∂(v·∇ v)/∂v) − S C B − S_θ λ B_θ with the pointwise moduli C (3, 3, M) of the law.

        Raises SolveError (non-finite) where the law has none at a strain rate of u.
        """
        carried = None if self._carried is None else self._carried.tangent(u)
        try:
            moduli = tangent_moduli(self.law, self.strain_rate(u))
        except NoSeriesHere as refusal:
            raise self.without_series(u, refusal) from refusal
        if not np.isfinite(moduli).all() and (why := self.undefined(u)):
            raise SolveError(Status.NON_FINITE, why)
        return self._linearized(moduli, carried)

    def secant(self, u: Array) -> Any:
        """A = W ρ (1/Δt + v·∇) − S 2μ B − S_θ λ B_θ, viscosity and carrying velocity those of u (Picard, Oseen)."""
        carried = None if self._carried is None else self._carried.secant(u)
        return self._linearized(secant_moduli(self.law, self.strain_rate(u)), carried)

    def newtonian(self, u: Array, rate: float | None) -> Any:
        """A with one viscosity μ(rate²) at all points: the operator of a Newtonian material (Oseen's, when carried)."""
        chosen = self._reference_rate if rate is None else rate
        if chosen is None:
            raise SolveError(
                Status.NOT_APPLICABLE, "this flow has no reference rate: give the rate of the Newtonian operator"
            )
        viscosity = self.law.viscosity(np.array([chosen**2]))
        carried = None if self._carried is None else self._carried.secant(u)
        return self._linearized(isotropic(np.broadcast_to(viscosity, len(self.operators.strain.points))), carried)

    def jacobian_by(self, discretizer: Discretizer, u: Array) -> Any:
        """J of the same terms on the same nodes by another discretizer, its rows times W/W′ of the two node areas
        (1 where one of these is 0).

        λ is that of the nearest volume point of this flow. Raises SolveError when the nodes carry no such operators.
        """
        others = self._others.get(discretizer)
        if others is None:
            others = self._others[discretizer] = discretizer.operators(
                self.cloud, self.operators.volumetric is not None
            )
        modulus: float | Array = 0.0
        if self._modulus is not None and self.operators.volumetric is not None and others.volumetric is not None:
            tree = scipy.spatial.cKDTree(self.operators.volumetric.points)
            modulus = self._modulus[tree.query(others.volumetric.points)[1]]
        inertia, convection = self._terms
        boundary = self._lifted[node_major(self.cloud.boundary)].reshape(-1, 2)
        other = Flow(self.cloud, others, self.law, boundary, modulus, inertia=inertia, convection=convection)
        both = (self._areas > 0.0) & (other._areas > 0.0)
        ratio = np.divide(self._areas, other._areas, out=np.ones_like(self._areas), where=both)
        return sp.diags_array(ratio) @ other.jacobian(u)

    def _linearized(self, moduli: Array, carried: Any) -> Any:
        """W ρ/Δt + carried − S C B − S_θ λ B_θ with pointwise moduli C (3, 3, M)."""
        # S C has fewer entries than C B.
        parts = [(self._force @ pointwise(-moduli)) @ self._strain, self._without_stress, carried]
        return reduce(add, (part for part in parts if part is not None))

    @cached_property
    def _strain(self) -> Any:
        """B at the interior nodes, (3M, 2F)."""
        return self.operators.strain.rate_of(self._free)

    @cached_property
    def _without_stress(self) -> Any:
        """W ρ/Δt − S_θ λ B_θ, the same for every u; None where neither is present."""
        inertia = None if self._inertia is None else sp.diags_array(self._inertia)
        if self._volumetric is None:
            return inertia
        assert self._modulus is not None
        dilatation = sp.diags_array(-self._modulus) @ self._volumetric.rate_of(self._free)
        volumetric = self._volumetric.force @ dilatation
        return volumetric if inertia is None else volumetric + inertia

    def scale(self, u: Array) -> float:
        """‖|S| |s| + |S_θ| |λ B_θ v| + W ρ |v/Δt + v·∇ v| + |constant|‖₂: the size of the forces that cancel in R."""
        deviatoric, volumetric = self._stresses_at(u)
        terms = magnitude(self._force) @ np.abs(deviatoric)
        terms += np.abs(self._constant)
        if self._volumetric is not None and volumetric is not None:
            terms += magnitude(self._volumetric.force) @ np.abs(volumetric)
        if self._inertia is not None:
            terms += self._inertia * np.abs(u)
        if self._carried is not None:
            terms += np.abs(self._carried.force(u))
        return float(np.linalg.norm(terms)) or 1.0

    def undefined(self, u: Array) -> str:
        """The first strain point where the viscosity is not finite, and how many there are."""
        return places.undefined(self.law, self.operators.strain.points, self.strain_rate(u))

    def without_series(self, u: Array, refusal: NoSeriesHere) -> SolveError:
        """The error of a law whose formula has refused to give the series, with a strain point where it does not."""
        return places.without_series(self.law, self.operators.strain.points, self.strain_rate(u), refusal)

    def blame(self, u: Array, residual: Array) -> Mapping[str, float]:
        """See `places.blame`."""
        return places.blame(self.cloud, self.law, self.operators.strain.points, self.strain_rate(u), residual)

    def velocity(self, u: Array) -> Array:
        """Velocities of all nodes, boundary included, shape (N, 2) [mm/s]."""
        full = self._lifted.copy()
        full[self._free] = u
        return full.reshape(-1, 2)

    def unknowns(self, velocity: Array) -> Array:
        """u, shape (2F,), from the velocities (N, 2) of all nodes."""
        return velocity.take(self.cloud.interior, axis=0).ravel()

    def rates(self, u: Array) -> PointRates:
        """ε̇ at the strain points and tr ε̇ at the volume points."""
        return PointRates(self.strain_rate(u), self.dilatation_rate(u))

    def to_nodes(self, discretizer: Discretizer) -> Any:
        """Values at the strain points -> at the nodes as the discretizer takes them there, sparse (N, M); kept.

        Raises SolveError (bad cloud) where the points around a node do not determine them.
        """
        if self._to_nodes is None or self._to_nodes[0] != discretizer:
            self._to_nodes = discretizer, discretizer.values(self.operators.strain.points, self.cloud.nodes)
        return self._to_nodes[1]

    def stress_at_points(self, u: Array) -> Array:
        """s at the evaluation points, shape (3, M) [MPa]."""
        return stress(self.law, self.strain_rate(u))

    def dilatation_rate(self, u: Array) -> Array | None:
        """tr ε̇ = div v at the volume points, shape (L,) [1/s]; None without a volumetric term."""
        volumetric = self.operators.volumetric
        if self._modulus is None or volumetric is None:
            return None
        rate: Array = volumetric.rate @ self.velocity(u).ravel()
        if self.drift is not None and self.drift.dilatation is not None:
            rate = rate + self.drift.dilatation
        return rate

    def pressure(self, u: Array) -> Array | None:
        """p − λ tr ε̇ at the volume points, shape (L,) [MPa], the next p of an iterated penalty; None without one."""
        rate = self.dilatation_rate(u)
        return None if rate is None or self._modulus is None else self._pressure - self._modulus * rate
