"""H(μ) (1 − c/2 ∫₀¹ μ H(ν)/(μ + ν) dν) = 1 : Chandrasekhar's H-function."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import System
from nlsolve_systems.burkardt import chandrasekhar_at

SLOWEST = 0.97  # largest contraction factor with which the root is iterated
ROUNDING = 1e-18  # error of the root, in extended precision


class Chandrasekhar(System):
    """By the midpoint rule (Kelley 1980; Kelley 1995, 5.6); at c = 1 the Jacobian at the root is singular. The mean of
    every root is 2 (1 ± √(1 − c))/c, at any size.
    """

    kind: Literal["chandrasekhar"] = "chandrasekhar"
    albedo: float = Field(0.9, gt=0, le=1, description="c")
    size: int = Field(100, gt=0, description="U, midpoints")

    def formula(self, u: Any) -> Any:
        """H_i − 1/(1 − c/(2 n) Σ_j μ_i H_j/(μ_i + μ_j)),  μ_i = (i − 1/2)/n."""
        return chandrasekhar_at(u, self._midpoints(), self.albedo)

    def _midpoints(self) -> np.ndarray:
        return (np.arange(self.size) + 0.5) / self.size

    def standard_start(self) -> np.ndarray:
        """H = 1."""
        return np.ones(self.size)

    def roots(self) -> np.ndarray | None:
        """The smaller root, by the iteration H ← 1/(1 − …) from H = 1, whose error shrinks by 1 − √(1 − c) each time;
        None near c = 1, where that takes too many iterations.
        """
        rate = 1.0 - np.sqrt(1.0 - self.albedo)
        if rate > SLOWEST:
            return None
        root = np.ones(self.size, dtype=np.longdouble)
        for _ in range(int(np.ceil(np.log(ROUNDING) / np.log(rate)))):
            root = root - chandrasekhar_at(root, self._midpoints(), self.albedo)
        return root.astype(float)[None]

    @property
    def singular(self) -> bool:
        """True at c = 1, where the two roots meet."""
        return self.albedo == 1.0
