"""3 μ ε̄ = k T^A ε̄ⁿ : the power law, with ε̄² + ε₀² in place of ε̄²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw, PowerForm


class PowerLaw(ConstitutiveLaw):
    """μ(ε̄²) = (1/3) k T^A (ε̄² + ε₀²)^((n−1)/2)  [MPa s].

    Timesli, Braikat, Lahmam, Zahrouni (2015), aluminium 7075; A is an exponent of the temperature T [K]. The 2015 paper
    states no ε₀, though μ → ∞ at rest for n < 1; with ε₀ = 0 a strain rate of zero gives no finite viscosity.
    """

    kind: Literal["power-law"] = "power-law"
    continued_by: ClassVar = {"index": "nearer 1", "regularization": "larger"}
    consistency: float = Field(2.69e10, gt=0, description="k [MPa sⁿ K^−A]")
    temperature_exponent: float = Field(-3.3155, description="A")
    temperature: float = Field(300.0, gt=0, description="T [K]")
    index: float = Field(0.1324, gt=0, description="n")
    regularization: float = Field(1e-2, ge=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        strength = self.consistency * self.temperature**self.temperature_exponent
        return strength / 3.0 * (rate_squared + self.regularization**2) ** (0.5 * (self.index - 1.0))

    def power_form(self) -> PowerForm:
        """The law at ε₀ = 0."""
        return PowerForm(self.consistency * self.temperature**self.temperature_exponent, self.index)
