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
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy
import scipy.sparse as sp

from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.cloud import Cloud, node_major
from nlsolve.contracts.continuum.law import CONTRACTION, ConstitutiveLaw
from nlsolve.series import Array, Indices


@dataclass(frozen=True)
class PointOperators:
    """A pair B, S or B_θ, S_θ at P points, with c = 3 components a point (strain rates) or 1 (dilatation rates).

    rate : B, values at the nodes -> rates at the points, sparse (c P, 2N).
    force : S, stresses there -> force at the interior nodes, sparse (2F, c P).
        Either may be an object that multiplies vectors and can be read like a sparse matrix, but is assembled later.
    points : places of the points, (P, 2) [mm].
    areas : A, areas of the points, (P,) [mm²]; strain points have them in a conservative form only.
    """

    rate: Any
    force: Any
    points: Array
    areas: Array | None = None

    @classmethod
    def conservative(cls, cloud: Cloud, rate: Any, points: Array, areas: Array) -> PointOperators:
        """The pair of a conservative form: B = `rate`, S = −Bᵀ A at the interior nodes."""
        free = node_major(cloud.interior)
        weighed = sp.diags_array(_weights(areas, rate.shape[0] // len(points)))
        return cls(rate, (-(rate[:, free].T @ weighed)).tocsr(), points, areas)

    def rate_of(self, unknowns: Indices) -> Any:
        """The columns `unknowns` (2F,) of B, (c P, 2F): rates of what is zero elsewhere; kept."""
        if not self._kept or not np.array_equal(self._kept[0], unknowns):
            self._kept[:] = unknowns, self.rate[:, unknowns]
        return self._kept[1]

    @cached_property
    def _kept(self) -> list[Any]:
        return []

    def weights(self) -> Array:
        """The diagonal of A, (c P,) [mm²], xy counted twice; for points with areas only."""
        assert self.areas is not None
        return _weights(self.areas, self.rate.shape[0] // len(self.points))


def _weights(areas: Array, components: int) -> Array:
    return np.outer(CONTRACTION, areas).ravel() if components == len(CONTRACTION) else areas


@dataclass(frozen=True)
class Operators:
    """The operators of one cloud.

    strain : B and S, at M points.
    volumetric : B_θ and S_θ, at L points; None when no volumetric term was asked for.
    node_areas : W ≥ 0 of a conservative form, (F,) [mm²], 0 where the rule for other terms has no weight; None in a
        strong form.
    neighbours : what the discretizer found on the cloud and can use again in `moved`; nothing else reads it.
    """

    strain: PointOperators
    volumetric: PointOperators | None = None
    node_areas: Array | None = None
    neighbours: Any = None

    @property
    def is_conservative(self) -> bool:
        """True when R is in [N/mm], the force on the material around each node."""
        return self.node_areas is not None

    @cached_property
    def strain_points_beside(self) -> Indices:
        """The strain point nearest to each volume point, (L,); for operators with volume points only."""
        assert self.volumetric is not None
        nearest: Indices = scipy.spatial.cKDTree(self.strain.points).query(self.volumetric.points)[1]
        return nearest

    def strain_rate(self, velocity: Array) -> Array:
        """ε̇ at the M strain points, (3, M) ordered xx, yy, xy [1/s], of the `velocity` (N, 2) of all nodes."""
        rates: Array = self.strain.rate @ velocity.ravel()
        return rates.reshape(3, -1)


class Discretizer(Component, ABC):
    """Builds the operators of a cloud."""

    noun: ClassVar[str] = "discretizer"
    default_error_estimator: ClassVar[Mapping[str, Any] | None] = {"kind": "delaunay"}
    """Table of the discretizer that solves the flow on an enriched cloud, to estimate the error of this one's solutions
    when a study names none. None: no estimate.
    """
    order: ClassVar[float] = 2.0
    """k, the power of the nodes' distance with which the error of a smooth velocity falls."""

    def for_law(self, law: ConstitutiveLaw, rate: float) -> Discretizer:
        """This discretizer, with what it leaves open chosen for a law at strain rates of about `rate` [1/s]."""
        return self

    def advice(self, law: ConstitutiveLaw, rate: float) -> str:
        """What to choose instead of this discretizer's own settings where no method has solved the flow of a law at
        strain rates of about `rate` [1/s]; empty: nothing to say.
        """
        return ""

    def compiled_by(self) -> str | None:
        """What compiled the code that builds the operators, e.g. "numba 0.68.1"; asking loads it."""
        return None

    def completed(self, cloud: Cloud) -> Cloud:
        """The nodes at which this discretizer solves for velocities: those of the scene, first and in their order, and
        those that it adds. May raise SolveError (bad cloud).
        """
        return cloud

    @abstractmethod
    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when `volumetric`, B_θ, S_θ. Raises SolveError (bad cloud) naming the place where supports fail."""

    def moved(self, operators: Operators, cloud: Cloud) -> Operators | None:
        """The operators of a cloud whose nodes have moved a little, made with the `neighbours` found before; None when
        these no longer fit. Called only with `operators` that have neighbours. A class that overrides `operators` must
        override `moved` too.
        """
        return None

    def renewed(self, operators: Operators, cloud: Cloud) -> Operators:
        """The operators of a cloud whose nodes have moved, those that `operators` gives: what the `neighbours` found
        before know may save time, and changes nothing. Called only with `operators` that have neighbours. In a class
        that overrides `operators` alone it is this one, which builds them anew.
        """
        return self.operators(cloud, operators.volumetric is not None)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "operators" in vars(cls) and "renewed" not in vars(cls):
            cls.renewed = Discretizer.renewed  # type: ignore[method-assign]

    @abstractmethod
    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """Sparse (N, N) matrices of ∂/∂x and ∂/∂y at the nodes, used for convection and for measured columns."""

    @abstractmethod
    def values(self, sources: Array, targets: Array) -> Any:
        """Sparse (T, N) matrix taking values at `sources` (N, 2) to values at `targets` (T, 2)."""

    def diagnostics(self, cloud: Cloud) -> list[dict[str, Any]]:
        """One row for each operator of a cloud on its quality (columns `DIAGNOSTICS`); empty: nothing to report."""
        return []
