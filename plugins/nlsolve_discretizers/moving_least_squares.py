"""Collocation by moving least squares."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from nlsolve.plugin import Cloud, ConstitutiveLaw, SolveError, Status
from nlsolve_discretizers.collocation import Collocation, least_count
from nlsolve_discretizers.weights.least_squares import Derivatives, fit
from nlsolve_discretizers.weights.lists import Lists
from nlsolve_discretizers.weights.supports import Supports

SUPPORTS = ("support", "force_support", "volume_support")
AMPLE = 1.5
"""Points of a support over the coefficients of its polynomial with which flows were solved at degrees 2 and 3."""

SMALLEST_PIVOT = 1e-8  # of R, relative to its column: below, the support does not determine the polynomial


class MovingLeastSquares(Collocation):
    """Polynomials fitted to the neighbours with weights that fall with distance (Lancaster & Salkauskas 1981).

    Operators of moved clouds take less time with numba: pip install 'nlsolve[numba]'; the column `compiled_by` tells.
    """

    kind: Literal["mls"] = "mls"
    support: int = Field(10, ge=3, description="nodes around a strain point")
    force_support: int = Field(12, ge=3, description="stress points around a node")
    volume_support: int = Field(20, ge=3, description="nodes around a volume point at a node")
    radius: float | None = Field(None, gt=0, description="influence radius in place of the counts [mm]")
    weight: Literal["gaussian", "quartic", "spline"] = Field("gaussian", description="weight function of the distance")
    shape: float = Field(3.0, gt=0, description="of the gaussian: exp(−(shape · distance/radius)²)")

    @model_validator(mode="after")
    def _enough_neighbours(self) -> Self:
        least = least_count(self.degree)
        for name in SUPPORTS:
            if self.radius is None and getattr(self, name) < least:
                raise ValueError(
                    f"{name} = {getattr(self, name)}: polynomials of degree {self.degree} need at least {least} points"
                )
        return self

    def advice(self, law: ConstitutiveLaw, rate: float) -> str:
        """To take larger supports, where they have hardly more points than their polynomials have coefficients."""
        least = least_count(self.degree)
        few = [f"{name} = {getattr(self, name)}" for name in SUPPORTS if getattr(self, name) < AMPLE * least]
        if self.radius is not None or not few:
            return ""
        return (
            f"discretizer.{' and '.join(few)}: few points for polynomials of degree {self.degree}, which have {least} "
            f"coefficients: give at least {AMPLE * least:.0f}, or lower discretizer.degree"
        )

    def neighbour_count(self, role: str) -> int | None:
        """The counts of the roles, unless a radius is given; values have as many neighbours as strains."""
        if self.radius is not None:
            return None
        return {"force": self.force_support, "volume": self.volume_support}.get(role, self.support)

    def supports(
        self, sources: np.ndarray, targets: np.ndarray, role: str, cloud: Cloud | None, lists: Lists | None = None
    ) -> Supports:
        """The nearest sources by count, or those within `radius`."""
        count = self.neighbour_count(role)
        if count is None:
            assert self.radius is not None
            return Supports.within(sources, targets, self.radius)
        return Supports.nearest(sources, targets, count, self.balanced, lists)

    def local_weights(
        self, places: np.ndarray, radius: np.ndarray, derivatives: Derivatives
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weights by least squares; the quality of a support is its smallest pivot."""
        return fit(places, radius, self.degree, derivatives, self.weight, self.shape)

    def refusal(self, count: int, place: np.ndarray, quality: float) -> SolveError | None:
        """An error (bad cloud) if the neighbours do not determine the polynomial."""
        if quality > SMALLEST_PIVOT:
            return None
        return SolveError(
            Status.BAD_CLOUD,
            f"the {count} neighbours of the point ({place[0]:.6g}, {place[1]:.6g}) do not determine a polynomial of "
            f"degree {self.degree}: widen the supports or lower the degree",
        )
