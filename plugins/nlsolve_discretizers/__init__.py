"""Collocation by moving least squares and by radial basis functions, and finite elements of degree 1 and 2."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_discretizers.linear_triangles import LinearTriangles
from nlsolve_discretizers.moving_least_squares import MovingLeastSquares
from nlsolve_discretizers.quadratic_triangles import QuadraticTriangles
from nlsolve_discretizers.radial_basis import RadialBasis


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    """The discretizers of this package."""
    return [MovingLeastSquares, RadialBasis, LinearTriangles, QuadraticTriangles]
