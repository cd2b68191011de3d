"""A constitutive law in one file. Its formula, written once, gives the viscosity, Newton's tangent and the series.

To use it as `law = { kind = "ellis" }` in studies, name the module in your package's pyproject.toml:

    [project.entry-points.nlsolve]
    ellis = "law_in_one_file"
"""

from typing import Any, Literal

import numpy as np

from nlsolve.plugin import ConstitutiveLaw, Series, hookimpl


class Ellis(ConstitutiveLaw):
    """μ(ε̄²) = μ₀ / (1 + (ε̄²/ε̄₁²)^((1 − n)/2)): μ₀ for slow flows, a power law of index n for fast ones."""

    kind: Literal["ellis"] = "ellis"
    zero_viscosity: float = 100.0  # μ₀ [MPa s]
    half_rate: float = 1.0  # ε̄₁ [1/s], where μ = μ₀/2
    index: float = 0.3  # n

    def viscosity(self, rate_squared: Any) -> Any:
        return self.zero_viscosity / (1.0 + (rate_squared / self.half_rate**2) ** (0.5 * (1.0 - self.index)))


@hookimpl
def nlsolve_components():
    return [Ellis]


if __name__ == "__main__":
    rate_squared = np.array([0.01, 1.0, 100.0]) ** 2
    print("μ      ", Ellis().viscosity(rate_squared))
    print("dμ/dε̄²", Ellis().viscosity(Series.seed(rate_squared)).coefficient(1))
