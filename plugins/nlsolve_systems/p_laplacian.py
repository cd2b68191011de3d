"""−div((|∇u|² + ε²)^{(p−2)/2} ∇u) = 1 in the unit interval or square, u = 0 on its boundary: the p-Laplacian.

A power-law flow along a channel or a duct (Glowinski & Marroco 1975); p − 1 is its index n.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import System
from nlsolve_systems.grids import on_points, places, slopes

BISECTIONS = 80
REFINEMENTS = 3


class PLaplacian(System):
    """Linear elements on N × N inner points, each row divided by a cell's area: F is a convex potential's gradient."""

    kind: Literal["p-laplacian"] = "p-laplacian"
    power: float = Field(1.5, gt=1, description="p; 2 is linear")
    regularization: float = Field(1e-4, gt=0, description="ε")
    dimension: Literal[1, 2] = Field(1, description="dimension of the domain")
    nodes: int = Field(32, gt=1, description="N, inner points on a side")

    def formula(self, u: Any) -> Any:
        """Σ_d B_dᵀ μ B_d u − 1,  μ = (Σ_d (B_d u)² + ε²)^{(p−2)/2}, with B_d the slope along d on each element."""
        gradient = slopes(self.nodes, self.dimension)
        components = [derivative @ u for derivative in gradient]
        square = sum(component**2 for component in components) + self.regularization**2
        viscosity = square ** (0.5 * self.power - 1.0) / self.dimension  # a triangle is half a cell
        forces = [derivative.T @ (viscosity * part) for derivative, part in zip(gradient, components, strict=True)]
        return sum(forces) - 1.0

    def standard_start(self) -> np.ndarray:
        """x (1 − x)/2, the root for p = 2 in one dimension; in two x (1 − x) y (1 − y)."""
        x = places(self.nodes)
        return on_points(x * (1.0 - x), self.dimension) / (3 - self.dimension)

    def pattern(self) -> Any:
        """An entry for each two points of an element."""
        touched = sum(abs(derivative) for derivative in slopes(self.nodes, self.dimension))
        return touched.T @ touched

    @property
    def is_gradient(self) -> bool:
        """True for every p > 1."""
        return True

    def roots(self) -> np.ndarray | None:
        """In one dimension, where the flux is ½ − x in the middle of each interval: slope by slope, by bisection."""
        if self.dimension == 2:
            return None
        h = np.longdouble(1) / (self.nodes + 1)
        flux = 0.5 - (np.arange(self.nodes + 1) + np.longdouble(0.5)) * h
        wanted = np.abs(flux).astype(float)
        low, high = np.zeros_like(wanted), (1.0 + wanted) ** (1.0 / (self.power - 1.0))
        for _ in range(BISECTIONS):
            slope = 0.5 * (low + high)
            behind = slope * (slope**2 + self.regularization**2) ** (0.5 * self.power - 1.0) > wanted
            low, high = np.where(behind, low, slope), np.where(behind, slope, high)
        slope = low.astype(np.longdouble)
        for _ in range(REFINEMENTS):  # Newton's, of what bisection in double precision has left
            square = slope**2 + self.regularization**2
            viscosity = square ** (0.5 * self.power - 1.0)
            excess = slope * viscosity - np.abs(flux)
            slope = slope - excess / (viscosity * (1.0 + (self.power - 2.0) * slope**2 / square))
        return np.cumsum(h * np.sign(flux) * slope)[None, :-1].astype(float)
