"""S = 2 K (√3 e)^(m−1) ε̇ : the law of Norton and Hoff, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw, PowerForm


class NortonHoff(ConstitutiveLaw):
    """μ(ε̄²) = K (3 (ε̄² + ε₀²))^((m−1)/2)  [MPa s].

    Norton (1929) for uniaxial creep, Hoff (1954) for all of ε̇; in simple shear τ = K γ̇^m. A power law of consistency
    3^((m+1)/2) K in 3 μ ε̄ = k ε̄^m; with ε₀ = 0 and m < 1 a strain rate of zero gives no finite viscosity.
    """

    kind: Literal["norton-hoff"] = "norton-hoff"
    continued_by: ClassVar = {"index": "nearer 1", "regularization": "larger"}
    consistency: float = Field(40.0, gt=0, description="K [MPa s^m]")
    index: float = Field(0.2, gt=0, description="m, sensitivity to the strain rate")
    regularization: float = Field(1e-2, ge=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        return self.consistency * (3.0 * (rate_squared + self.regularization**2)) ** (0.5 * (self.index - 1.0))

    def power_form(self) -> PowerForm:
        """The law at ε₀ = 0."""
        return PowerForm(3.0 ** (0.5 * (self.index + 1.0)) * self.consistency, self.index)
