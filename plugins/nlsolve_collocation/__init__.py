"""Collocation by moving least squares and by radial basis functions, and linear triangles to compare with."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_collocation.linear_triangles import LinearTriangles
from nlsolve_collocation.moving_least_squares import MovingLeastSquares
from nlsolve_collocation.radial_basis import RadialBasis


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [MovingLeastSquares, RadialBasis, LinearTriangles]
