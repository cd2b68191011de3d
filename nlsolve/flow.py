"""R(v) = ρ (v − v_k)/Δt − S s(B v) − S_θ λ B_θ v − f : the discrete balance of momentum at the interior nodes.

Terms that the scene leaves out are absent, not zero. The same formula runs on arrays and on series.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.discretizers import Operators
from nlsolve.laws import ConstitutiveLaw, Number, stress, tangent_moduli
from nlsolve.problems import Expansion, NonlinearProblem
from nlsolve.scenes import Cloud
from nlsolve.series import Array, Series


@dataclass(frozen=True)
class Inertia:
    """ρ/Δt [t/(mm³ s)] and the velocity (N, 2) of the same nodes one increment ago [mm/s]."""

    density_over_increment: float
    previous: Array


class Flow(NonlinearProblem):
    """R(u) = 0 for u, the velocities (u_0, v_0, u_1, …) of the interior nodes, shape (2F,) [mm/s]; R in [N/mm³].

    cloud, operators : the nodes and their B, S, B_θ, S_θ.
    law : s(ε̇) = 2 μ(ε̄²) ε̇.
    boundary_velocity : prescribed velocities of the boundary nodes, shape (N − F, 2).
    penalty_modulus : λ [MPa s]; the volumetric term is present when the operators have one.
    inertia, body_force : present when given; f at the interior nodes, shape (F, 2).
    """

    def __init__(
        self,
        cloud: Cloud,
        operators: Operators,
        law: ConstitutiveLaw,
        boundary_velocity: Array,
        penalty_modulus: float = 0.0,
        inertia: Inertia | None = None,
        body_force: Array | None = None,
    ) -> None:
        self.cloud, self.operators, self.law = cloud, operators, law
        self._free = node_major(cloud.interior)
        lifted = np.zeros(2 * len(cloud.nodes))
        lifted[node_major(cloud.boundary)] = boundary_velocity.ravel()
        self._lifted = lifted
        self._strain = operators.strain[:, self._free]
        self._strain_boundary = operators.strain @ lifted
        self._force = operators.force
        self._gradient: Any = None
        self._dilatation: Any = None
        self._inertia = 0.0
        constant = np.zeros(len(self._free))
        if operators.dilatation is not None and penalty_modulus > 0.0:
            self._gradient = -penalty_modulus * operators.pressure_force
            self._dilatation = operators.dilatation[:, self._free]
            constant += self._gradient @ (operators.dilatation @ lifted)
        if inertia is not None:
            self._inertia = inertia.density_over_increment
            constant -= self._inertia * inertia.previous[cloud.interior].ravel()
        if body_force is not None:
            constant -= body_force.ravel()
        self._constant = constant
        self._pressure_modulus = penalty_modulus

    def residual(self, u: Array) -> Array:
        """R(u) [N/mm³]."""
        return self._balance(u)

    def expand(self, u: Array) -> Expansion:
        """The same balance, run on a series that begins with u."""
        path = Series(u)
        return Expansion(path, self._balance(path))

    def _balance(self, u: Number) -> Number:
        balance = self._constant - self._force @ stress(self.law, self._strain_rate(u)).reshape(-1)
        if self._gradient is not None:
            balance = balance + self._gradient @ (self._dilatation @ u)
        if self._inertia:
            balance = balance + self._inertia * u
        return balance

    def _strain_rate(self, u: Number) -> Number:
        return (self._strain @ u + self._strain_boundary).reshape(3, -1)

    def jacobian(self, u: Array) -> Any:
        """J = ρ/Δt − S C B − S_θ λ B_θ with the pointwise moduli C (3, 3, M) of the law."""
        moduli = tangent_moduli(self.law, self._strain_rate(u))
        points = moduli.shape[2]
        # C as a sparse matrix with three entries a row: row a M + m holds columns m, M + m, 2 M + m.
        columns = np.arange(points)[None, :, None] + points * np.arange(3)[None, None, :]
        pointwise = sp.csr_array(
            (
                np.ascontiguousarray(moduli.transpose(0, 2, 1)).ravel(),
                np.broadcast_to(columns, (3, points, 3)).ravel(),
                np.arange(0, 9 * points + 1, 3),
            ),
            shape=(3 * points, 3 * points),
        )
        jacobian = -(self._force @ (pointwise @ self._strain))
        if self._gradient is not None:
            jacobian = jacobian + self._gradient @ self._dilatation
        if self._inertia:
            jacobian = jacobian + self._inertia * sp.eye_array(jacobian.shape[0], format="csr")
        return jacobian

    def scale(self, u: Array) -> float:
        """‖|S| |s| + |S_θ λ| |B_θ v| + ρ/Δt |u| + |constant|‖₂: the size of the forces that cancel in R(u)."""
        terms = abs(self._force) @ np.abs(stress(self.law, self._strain_rate(u))).ravel() + np.abs(self._constant)
        if self._gradient is not None:
            terms += abs(self._gradient) @ np.abs(self._dilatation @ u)
        return float(np.linalg.norm(terms + self._inertia * np.abs(u))) or 1.0

    def velocity(self, u: Array) -> Array:
        """Velocities of all nodes, boundary included, shape (N, 2) [mm/s]."""
        full = self._lifted.copy()
        full[self._free] = u
        return full.reshape(-1, 2)

    def unknowns(self, velocity: Array) -> Array:
        """u from the velocities (N, 2) of all nodes."""
        return velocity[self.cloud.interior].ravel()

    def stress_at_points(self, u: Array) -> Array:
        """s at the evaluation points, shape (3, M) [MPa]."""
        return stress(self.law, self._strain_rate(u))

    def pressure_stress(self, u: Array) -> Array | None:
        """λ tr ε̇ at the volume points, shape (L,) [MPa]; None without a volumetric term."""
        if self.operators.dilatation is None or not self._pressure_modulus:
            return None
        return self._pressure_modulus * (self.operators.dilatation @ self.velocity(u).ravel())


def node_major(nodes: Any) -> Any:
    """Indices 2 i, 2 i + 1 of the velocity components of `nodes`."""
    return np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
