"""S = 2 μ(ε̄²) ε̇ with ε̄² = 2/3 ε̇:ε̇ : the contract of constitutive laws.

A law is one formula, μ(ε̄²). Run on an array it gives the viscosity, on a seeded series Newton's tangent, on a pushed
series the coefficients of the homotopy. Units: mm, s, MPa, tonne.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np

from nlsolve.contracts.component import Component
from nlsolve.series import Array, NoSeriesHere, Series

Number = TypeVar("Number", Array, Series)


@dataclass(frozen=True)
class PowerForm:
    """3 μ ε̄ = K ε̄ⁿ : consistency K [MPa sⁿ] and index n of the pure power law that exact solutions are written for."""

    consistency: float
    index: float

    @property
    def shear_consistency(self) -> float:
        """m in τ = m γ̇ⁿ for simple shear, where ε̄ = γ̇/√3:  m = K 3^(−(n+1)/2)."""
        return self.consistency * math.pow(3.0, -(self.index + 1.0) / 2.0)


class ConstitutiveLaw(Component, ABC):
    """A viscous law S = 2 μ(ε̄²) ε̇, analytic for ε̄² > 0. At rest it may be infinite, or finite without a series."""

    noun: ClassVar[str] = "law"
    continued_by: ClassVar[Mapping[str, Literal["larger", "smaller", "nearer 1"]]] = {}
    """The fields by which the law is continued, and whether larger or smaller values of them are easier to solve, or,
    as for an index, those nearer 1: below 1 larger ones, above 1 smaller ones down to 1.
    """

    @abstractmethod
    def viscosity(self, rate_squared: Number) -> Number:
        """μ(ε̄²) [MPa s] for ε̄² [1/s²], an array or a `Series`; written once, with analytic operations only."""

    def power_form(self) -> PowerForm | None:
        """The pure power law this law tends to, for scenes with a closed solution; None if it is no power law."""
        return None

    @property
    def regularization_rate(self) -> float | None:
        """ε₀ [1/s], the strain rate below which the regularization sets the viscosity; None without one."""
        return None

    def continuation(self, by: str, values: tuple[float, ...]) -> list[ConstitutiveLaw]:
        """Easier laws to pass through on the way to this one, in order, ending with this one itself.

        by : name of the field that is varied.
        values : values of that field, in order; those that are not easier than the law's own value are skipped.
        Raises ValueError when the law is not continued by this field.
        """
        if by not in self.continued_by:
            none = 'none of its fields: set values = [] to begin at rest, or by = "load" with values = [1e-4, 1e-2]'
            fields = f"{', '.join(self.continued_by)} only" if self.continued_by else none
            raise ValueError(f"start.by = {by!r}: the law {self.kind_name()!r} is continued by {fields}")
        target = getattr(self, by)
        way = self.continued_by[by]
        larger = way == "larger" or (way == "nearer 1" and target <= 1.0)
        least = 1.0 if way == "nearer 1" else -np.inf
        easier = [value for value in values if (value > target if larger else least <= value < target)]
        return [self.with_(**{by: value}) for value in easier] + [self]


def tangent_moduli(law: ConstitutiveLaw, strain_rate: Array) -> Any:
    """C = ∂S/∂ε̇ = 2 μ I + (8/3) μ′(ε̄²) ε̇ ⊗ (w ε̇): shape (3, 3, M) for strain rates (3, M) ordered xx, yy, xy.

    w = (1, 1, 2) because ε̇:ε̇ = ε̇xx² + ε̇yy² + 2 ε̇xy². The derivative μ′ is the formula run on a seeded series. Where
    ε̇ = 0 the second term vanishes whether or not μ′ is finite there: ε̄² μ′(ε̄²) → 0 if μ(0) is finite.
    """
    squared = rate_squared(strain_rate)
    at_rest = squared == 0.0
    viscosity = law.viscosity(Series.seed(squared))
    try:
        slope = viscosity.coefficient(1)
    except NoSeriesHere:
        if not at_rest.any():
            raise
        slope = law.viscosity(Series.seed(np.where(at_rest, 1.0, squared))).coefficient(1)
    slope = np.where(at_rest, 0.0, slope)
    weighted = CONTRACTION[:, None] * strain_rate
    moduli = (8.0 / 3.0) * slope * strain_rate[:, None, :] * weighted[None, :, :]
    moduli[np.arange(3), np.arange(3)] += 2.0 * viscosity.coefficient(0)
    return moduli


def local_index(law: ConstitutiveLaw, rate: float) -> float:
    """n = d log τ/d log γ̇ at ε̄ = rate [1/s]: the index of the power law that this law is like there."""
    viscosity = law.viscosity(Series.seed(np.array([rate**2])))
    return float(1.0 + 2.0 * rate**2 * viscosity.coefficient(1)[0] / viscosity.coefficient(0)[0])


CONTRACTION = np.array([1.0, 1.0, 2.0])
"""w in ε̇:ε̇ = w · (ε̇xx², ε̇yy², ε̇xy²)."""


def rate_squared(strain_rate: Number) -> Number:
    """ε̄² = 2/3 ε̇:ε̇ of strain rates (3, M) ordered xx, yy, xy; shape (M,)."""
    return (2.0 / 3.0 * CONTRACTION) @ (strain_rate * strain_rate)


def stress(law: ConstitutiveLaw, strain_rate: Number) -> Number:
    """S = 2 μ(ε̄²) ε̇ [MPa], shape (3, M), ordered xx, yy, xy."""
    return 2.0 * law.viscosity(rate_squared(strain_rate)) * strain_rate
