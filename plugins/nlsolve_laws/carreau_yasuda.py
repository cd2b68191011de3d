"""μ = μ∞ + (μ₀ − μ∞) (1 + (λ e)^a)^((n−1)/a) : the law of Carreau and Yasuda, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw


class CarreauYasuda(ConstitutiveLaw):
    """μ(ε̄²) = μ∞ + (μ₀ − μ∞) (1 + (λ² (ε̄² + ε₀²))^(a/2))^((n−1)/a)  [MPa s].

    Carreau (1972), where a = 2; Yasuda (1979) for other a. Written in ε̄, not γ̇: in simple shear λ ε̄ = λ γ̇/√3. With
    a = 2 it is analytic at rest without ε₀; with ε₀ = 0 and another a it is not, unless a is even.
    """

    kind: Literal["carreau-yasuda"] = "carreau-yasuda"
    continued_by: ClassVar = {"index": "nearer 1", "regularization": "larger"}
    rest_viscosity: float = Field(50.0, gt=0, description="μ₀, at rest [MPa s]")
    fast_viscosity: float = Field(0.0, ge=0, description="μ∞, at ε̄ → ∞ [MPa s]")
    time: float = Field(1.0, gt=0, description="λ, one over the rate ε̄ at which thinning sets in [s]")
    sharpness: float = Field(2.0, gt=0, description="a, of the bend between the two regimes")
    index: float = Field(0.3, gt=0, description="n")
    regularization: float = Field(1e-2, ge=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        relative = (self.time**2 * (rate_squared + self.regularization**2)) ** (0.5 * self.sharpness)
        thinning = (1.0 + relative) ** ((self.index - 1.0) / self.sharpness)
        return self.fast_viscosity + (self.rest_viscosity - self.fast_viscosity) * thinning
