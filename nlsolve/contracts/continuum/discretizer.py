"""R(v) = … − S s(B v) − S_θ λ B_θ v : two pairs of sparse operators, the contract of discretizers.

    B     node velocities -> strain rates at M evaluation points            (3M, 2N)
    S     stresses there  -> force at the interior nodes                    (2F, 3M)
    B_θ   node velocities -> dilatation rates at L volume points            (L, 2N)
    S_θ   pressures there -> force at the interior nodes                    (2F, L)

N nodes, F of them interior. Velocities are node-major (u_0, v_0, u_1, v_1, …); strain rates and stresses are in three
blocks xx, yy, xy of length M. Evaluation points at the nodes give the composed form, between them stress points.

A strong form gives forces per volume [N/mm³]. A conservative form gives the forces on the material around each node
per thickness [N/mm], S = −Bᵀ A with the areas A of the evaluation points (xy counted twice), and S_θ = −B_θᵀ A_θ:
R is then the gradient of the dissipation potential, its tangent symmetric, and `node_areas` W weigh the other terms.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.law import CONTRACTION
from nlsolve.series import Array


@dataclass(frozen=True)
class Operators:
    """The operators of one cloud.

    dilatation, pressure_force, volume_points : None when no volumetric term was asked for.
    node_areas, strain_areas, volume_areas : W (F,), A (M,) and A_θ (L,) [mm²] of a conservative form, else None.
    neighbours : what the discretizer found on the cloud and may keep while nodes move; nobody else looks at it.
    """

    strain: Any
    force: Any
    strain_points: Array
    dilatation: Any = None
    pressure_force: Any = None
    volume_points: Array | None = None
    node_areas: Array | None = None
    strain_areas: Array | None = None
    volume_areas: Array | None = None
    neighbours: Any = None

    @classmethod
    def conservative(
        cls,
        cloud: Cloud,
        strain: Any,
        strain_points: Array,
        strain_areas: Array,
        node_areas: Array,
        dilatation: Any = None,
        volume_points: Array | None = None,
        volume_areas: Array | None = None,
    ) -> Operators:
        """S = −Bᵀ A and S_θ = −B_θᵀ A_θ at the interior nodes; `node_areas` (N,) of all nodes."""
        free = np.stack([2 * cloud.interior, 2 * cloud.interior + 1], axis=1).ravel()
        weighed = np.outer(CONTRACTION, strain_areas).ravel()
        force = (-(strain[:, free].T @ sp.diags_array(weighed))).tocsr()
        pressure_force = None
        if dilatation is not None:
            pressure_force = (-(dilatation[:, free].T @ sp.diags_array(volume_areas))).tocsr()
        return cls(
            strain,
            force,
            strain_points,
            dilatation,
            pressure_force,
            volume_points,
            node_areas[cloud.interior],
            strain_areas,
            volume_areas,
        )


class Discretizer(Component, ABC):
    """Turns a cloud into operators."""

    noun: ClassVar[str] = "discretizer"
    default_counterpart: ClassVar[Mapping[str, Any] | None] = None
    """The discretizer that estimates the error of this one's solutions when a study names none: one of another kind,
    whose errors are not the same; None: no estimate.
    """

    @abstractmethod
    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when `volumetric`, B_θ, S_θ. Raises SolveError (bad cloud) naming the place where supports fail."""

    def moved(self, operators: Operators, cloud: Cloud) -> Operators | None:
        """The operators of a cloud whose nodes have moved a little, with the `neighbours` found before; None when they
        serve no more. Asked only of operators that carry some; a class that overrides `operators` overrides both.
        """
        return None

    @abstractmethod
    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """Sparse (N, N) matrices of ∂/∂x and ∂/∂y at the nodes, for what is not a stress: convection, measures."""

    @abstractmethod
    def values(self, sources: Array, targets: Array) -> Any:
        """Sparse (T, N) matrix taking values at `sources` (N, 2) to values at `targets` (T, 2)."""

    def diagnostics(self, cloud: Cloud) -> list[dict[str, Any]]:
        """How good the operators of a cloud are, a row an operator (columns `DIAGNOSTICS`)."""
        return []
