"""σ̄ = asinh((Z/A)^(1/n)) / α,  Z = e exp(Q/RT) : hot working of metals, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw

GAS_CONSTANT = 8.314462618  # R [J/(mol K)]
HALVINGS = 8  # of asinh r, which is below 1 after them up to r = 1e110
GAUSS = np.polynomial.legendre.leggauss(12)  # abscissae in (−1, 1), and weights


class SellarsTegart(ConstitutiveLaw):
    """μ(ε̄²) = asinh((Z/A)^(1/n)) / (3 α e),  Z = e exp(Q/RT),  e² = ε̄² + ε₀²  [MPa s].

    Sellars, Tegart (1966), with Z of Zener, Hollomon (1944); the defaults are a plain example of an aluminium
    alloy, not fitted to data.
    At low stress σ̄ = (Z/A)^(1/n) / α, a power law of index 1/n; at high stress σ̄ grows with log Z only, and layers are
    thinner than that index tells. With ε₀ = 0 it is finite at rest for n ≤ 1 only, and analytic there for n = 1. There
    is no index in (0, 1] to vary on the way to the first state: vary the `regularization`.
    """

    kind: Literal["sellars-tegart"] = "sellars-tegart"
    continued_by: ClassVar = {"regularization": "larger"}
    stress_factor: float = Field(0.0141, gt=0, description="α [1/MPa]")
    stress_exponent: float = Field(5.41, gt=0, description="n")
    rate_factor: float = Field(1.027e9, gt=0, description="A [1/s]")
    activation_energy: float = Field(129.4e3, ge=0, description="Q [J/mol]")
    temperature: float = Field(750.0, gt=0, description="T [K]")
    regularization: float = Field(1e-2, ge=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        squared = rate_squared + self.regularization**2
        # exp(Q/RT)/A by the difference of logarithms: exp(Q/RT) alone overflows when it is cold.
        arrhenius = self.activation_energy / (GAS_CONSTANT * self.temperature) - np.log(self.rate_factor)
        power = 1.0 / self.stress_exponent
        factor = float(np.exp(arrhenius * power))  # r = (Z/A)^(1/n) = factor e^power
        if self.regularization == 0.0:  # asinh r/e, which is 0/0 at rest, by (r/e) (asinh r/r)
            ratio = _arcsinh_over(factor**2 * squared**power)
            return factor / (3.0 * self.stress_factor) * squared ** (0.5 * power - 0.5) * ratio
        return np.arcsinh(factor * squared ** (0.5 * power)) / (3.0 * self.stress_factor * np.sqrt(squared))


def _arcsinh_over(square: Any) -> Any:
    """asinh r/r of r² ≥ 0, r = 0 included, by asinh r = 2 asinh(r/√(2 + 2 √(1 + r²))) until r is small, and then
    asinh r/r = ∫ (1 + r² t²)^(−1/2) dt from 0 to 1 by Gauss's quadrature.
    """
    ratio = 1.0
    for _ in range(HALVINGS):
        root = 1.0 + np.sqrt(1.0 + square)
        ratio = ratio * np.sqrt(2.0 / root)
        square = square / (2.0 * root)
    return ratio * sum(
        0.5 * weight / np.sqrt(1.0 + square * (0.5 + 0.5 * t) ** 2) for t, weight in zip(*GAUSS, strict=True)
    )
