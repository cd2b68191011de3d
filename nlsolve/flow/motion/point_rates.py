"""ε̇_{k+1} = ε̇_k + B (v_{k+1} − v_k) : strain rates that are accumulated at points which move with the material.

Timesli, Braikat, Lahmam, Zahrouni (2015), equation 20, adds increments to σ, ε̇, ε̄ and μ. Here ε̇ is carried; σ, ε̄ and μ
follow from it by the law at each point, where the paper sums their truncated series.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators, PointOperators
from nlsolve.series import Array


@dataclass(frozen=True)
class PointRates:
    """ε̇ at the strain points, shape (3, M), and tr ε̇ at the volume points, (L,) or None without them [1/s]."""

    strain: Array
    dilatation: Array | None = None

    @classmethod
    def of(cls, operators: Operators, velocity: Array) -> PointRates:
        """B v and B_θ v of the velocity (N, 2) of all nodes."""
        volumetric = operators.volumetric
        dilatation = None if volumetric is None else volumetric.rate @ velocity.ravel()
        return cls(operators.strain_rate(velocity), dilatation)

    def __sub__(self, other: PointRates) -> PointRates:
        """ε̇ − ε̇′ at the same points."""
        if self.dilatation is None or other.dilatation is None:
            return PointRates(self.strain - other.strain)
        return PointRates(self.strain - other.strain, self.dilatation - other.dilatation)

    def at(self, strain: Passage, dilatation: Passage | None) -> PointRates:
        """The same rates at other points."""
        there = None if self.dilatation is None or dilatation is None else dilatation(self.dilatation)
        return PointRates(np.stack([strain(component) for component in self.strain]), there)


@dataclass(frozen=True)
class Passage:
    """Takes values at the points of one cloud to those of a cloud whose nodes have moved on.

    Points at the nodes, and points whose neighbours were kept, are material points: their values stay with them. From
    others, moved with the material, values are interpolated to the new points.
    """

    here: PointOperators
    there: PointOperators
    before: Cloud
    after: Cloud
    discretizer: Discretizer
    kept: bool

    @property
    def is_material(self) -> bool:
        """Whether each point of `there` is the same material point of `here`."""
        at_nodes = np.array_equal(self.here.points, self.before.nodes) and np.array_equal(
            self.there.points, self.after.nodes
        )
        return self.kept or at_nodes

    def __call__(self, values: Array) -> Array:
        """Values (P′,) at the points of `there` from those (P,) of `here`."""
        if self.is_material:
            return values
        moved = self.here.points + self.discretizer.values(self.before.nodes, self.here.points) @ (
            self.after.nodes - self.before.nodes
        )
        passed: Array = self.discretizer.values(moved, self.there.points) @ values
        return passed
