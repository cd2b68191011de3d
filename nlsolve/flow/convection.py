"""W ρ (v·∇) v : the force of a material that carries its own velocity, on arrays and on series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud, node_major
from nlsolve.contracts.continuum.law import Number
from nlsolve.series import Array


@dataclass(frozen=True)
class Convection:
    """ρ [t/mm³] and the (N, N) matrices of ∂/∂x and ∂/∂y at the nodes."""

    density: float
    gradient: tuple[Any, Any]


class Carried:
    """W ρ (v·∇) v at the interior nodes, (2F,), of interior velocities u (2F,), and its tangent."""

    def __init__(self, convection: Convection, cloud: Cloud, areas: Array, lifted: Array) -> None:
        inside, free = cloud.interior, node_major(cloud.interior)
        self._terms = []
        for axis, derivative in enumerate(convection.gradient):
            # Rows node-major: ∂/∂x (or ∂/∂y) of u_i, then of v_i; beside it u_i (or v_i), the speed that carries both.
            rows = sp.kron(sp.csr_array(derivative)[inside], sp.eye_array(2), format="csr")
            speed = sp.kron(
                sp.eye_array(len(inside)), sp.csr_array([[1.0 - axis, axis], [1.0 - axis, axis]]), format="csr"
            )
            weight = sp.diags_array(convection.density * areas)
            self._terms.append((weight @ rows[:, free], weight @ (rows @ lifted), speed))

    def force(self, u: Number) -> Number:
        (x, x_0, speed_x), (y, y_0, speed_y) = self._terms
        return (speed_x @ u) * (x @ u + x_0) + (speed_y @ u) * (y @ u + y_0)

    def secant(self, u: Array) -> Any:
        return sum(sp.diags_array(speed @ u) @ slope for slope, _, speed in self._terms)

    def tangent(self, u: Array) -> Any:
        return self.secant(u) + sum(
            sp.diags_array(slope @ u + slope_0) @ speed for slope, slope_0, speed in self._terms
        )
