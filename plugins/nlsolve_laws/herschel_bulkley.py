"""3 μ e = σ_y (1 − exp(−m e)) + K eⁿ : yield in the form of Papanastasiou, with e² = ε̄² + ε₀²."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import ConstitutiveLaw, PowerForm


class _Yielding(ConstitutiveLaw):
    """The yield stress of the laws below. Under σ_y they creep at rates of about 1/m or ε₀, whichever is larger."""

    continued_by: ClassVar = {"regularization": "larger", "yield_stress": "smaller", "growth": "smaller"}

    yield_stress: float = Field(20.0, ge=0, description="σ_y, equivalent (√3 times that in shear); 0: none [MPa]")
    growth: float = Field(10.0, gt=0, description="m of Papanastasiou: the larger, the stiffer below σ_y [s]")
    regularization: float = Field(1e-2, gt=0, description="ε₀ [1/s]")

    @property
    def regularization_rate(self) -> float:
        """ε₀ [1/s]."""
        return self.regularization

    def _rate(self, rate_squared: Any) -> Any:
        """e = √(ε̄² + ε₀²): (1 − exp(−m e))/e holds odd powers of e, which are not analytic in ε̄² at rest."""
        return np.sqrt(rate_squared + self.regularization**2)

    def _yield_viscosity(self, rate: Any) -> Any:
        """σ_y (1 − exp(−m e)) / (3 e), by 1 − exp(−2x) = 2 tanh x / (1 + tanh x): nothing cancels at small x."""
        half = np.tanh(0.5 * self.growth * rate)
        return 2.0 / 3.0 * self.yield_stress * half / ((1.0 + half) * rate)


class HerschelBulkley(_Yielding):
    """μ(ε̄²) = (σ_y (1 − exp(−m e)) + K eⁿ) / (3 e),  e² = ε̄² + ε₀²  [MPa s].

    Herschel, Bulkley (1926); Papanastasiou (1987) for the exponential, which makes the rigid core viscous.
    """

    kind: Literal["herschel-bulkley"] = "herschel-bulkley"
    continued_by: ClassVar = {"index": "nearer 1", **_Yielding.continued_by}
    consistency: float = Field(40.0, gt=0, description="K [MPa sⁿ]")
    index: float = Field(0.3, gt=0, description="n")

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        rate = self._rate(rate_squared)
        return self._yield_viscosity(rate) + self.consistency / 3.0 * rate ** (self.index - 1.0)

    def power_form(self) -> PowerForm | None:
        """The law at ε₀ = 0, without a yield stress."""
        return None if self.yield_stress else PowerForm(self.consistency, self.index)


class Bingham(_Yielding):
    """μ(ε̄²) = η + σ_y (1 − exp(−m e)) / (3 e),  e² = ε̄² + ε₀²  [MPa s].

    Bingham (1922); Papanastasiou (1987) for the exponential. The defaults are a plain example: σ_y = 3 η ε̄ at ε̄ near 7.
    There is no index to vary on the way to the first state: vary the `regularization`.
    """

    kind: Literal["bingham"] = "bingham"
    plastic_viscosity: float = Field(1.0, gt=0, description="η, beyond yield [MPa s]")

    def viscosity(self, rate_squared: Any) -> Any:
        """μ(ε̄²) for ε̄² [1/s²]."""
        return self.plastic_viscosity + self._yield_viscosity(self._rate(rate_squared))

    def power_form(self) -> PowerForm | None:
        """Newton's fluid, without a yield stress."""
        return None if self.yield_stress else PowerForm(3.0 * self.plastic_viscosity, 1.0)
