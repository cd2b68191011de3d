"""σ̄ = asinh((Z/A)^(1/n)) / α,  Z = e exp(Q/RT) : hot working of metals, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw

GAS_CONSTANT = 8.314462618  # R [J/(mol K)]


class SellarsTegart(ConstitutiveLaw):
    """μ(ε̄²) = asinh((Z/A)^(1/n)) / (3 α e),  Z = e exp(Q/RT),  e² = ε̄² + ε₀²  [MPa s].

    Sellars, Tegart (1966), with Z of Zener, Hollomon (1944); the defaults are a plain example of an aluminium
    alloy, not fitted to data.
    At low stress σ̄ = (Z/A)^(1/n) / α, a power law of index 1/n; at high stress σ̄ grows with log Z only, and layers are
    thinner than that index tells. Analytic at rest only with ε₀ > 0. There is no index in (0, 1] to vary on the way to
    the first state: vary the `regularization`.
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
        relative = float(np.exp(arrhenius / self.stress_exponent)) * squared ** (0.5 / self.stress_exponent)
        return np.arcsinh(relative) / (3.0 * self.stress_factor * np.sqrt(squared))
