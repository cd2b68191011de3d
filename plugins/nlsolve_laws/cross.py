"""μ = μ∞ + (μ₀ − μ∞) / (1 + (λ e)^(1−n)) : the law of Cross, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from nlsolve.plugin import ConstitutiveLaw


class Cross(ConstitutiveLaw):
    """μ(ε̄²) = μ∞ + (μ₀ − μ∞) / (1 + (λ² (ε̄² + ε₀²))^((1−n)/2))  [MPa s].

    Cross (1965), in ε̄, not γ̇. Far above 1/λ it is μ∞ plus a power law of index n. The power of ε̄² is not analytic at
    rest, so that series need ε₀ > 0 there; tangents do not.
    """

    kind: Literal["cross"] = "cross"
    continued_by: ClassVar = {"index": "larger", "regularization": "larger"}
    rest_viscosity: float = Field(50.0, gt=0, description="μ₀, at rest [MPa s]")
    fast_viscosity: float = Field(0.0, ge=0, description="μ∞, at ε̄ → ∞; at most μ₀ [MPa s]")
    time: float = Field(1.0, gt=0, description="λ, one over the rate ε̄ at which μ is halfway to μ∞ [s]")
    index: float = Field(0.3, gt=0, le=1, description="n; n = 1 is the Newtonian (μ₀ + μ∞)/2")
    regularization: float = Field(1e-2, ge=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    @model_validator(mode="after")
    def _thins(self) -> Self:
        if self.fast_viscosity > self.rest_viscosity:
            raise ValueError(
                f"fast_viscosity = {self.fast_viscosity:g} MPa s must not exceed "
                f"rest_viscosity = {self.rest_viscosity:g} MPa s"
            )
        return self

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        relative = (self.time**2 * (rate_squared + self.regularization**2)) ** (0.5 * (1.0 - self.index))
        return self.fast_viscosity + (self.rest_viscosity - self.fast_viscosity) / (1.0 + relative)
