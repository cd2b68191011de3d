"""H(μ) (1 − c/2 ∫₀¹ μ H(ν)/(μ + ν) dν) = 1 : Chandrasekhar's H-function."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve import System
from nlsolve_systems.burkardt import chandrasekhar_at


class Chandrasekhar(System):
    """By the midpoint rule (Kelley 1980; Kelley 1995, 5.6); at c = 1 the Jacobian at the root is singular. The mean of
    every root is 2 (1 ± √(1 − c))/c, at any size.
    """

    kind: Literal["chandrasekhar"] = "chandrasekhar"
    albedo: float = Field(0.9, gt=0, le=1, description="c")
    size: int = Field(100, gt=0, description="U, midpoints")

    def formula(self, u: Any) -> Any:
        """H_i − 1/(1 − c/(2 n) Σ_j μ_i H_j/(μ_i + μ_j)),  μ_i = (i − 1/2)/n."""
        return chandrasekhar_at(u, (np.arange(self.size) + 0.5) / self.size, self.albedo)

    def standard_start(self) -> np.ndarray:
        """One everywhere."""
        return np.ones(self.size)

    @property
    def singular(self) -> bool:
        """At c = 1 the two roots meet."""
        return self.albedo == 1.0
