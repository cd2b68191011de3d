"""v_{k+1} = Σ_{i=0..d} ∇ⁱ v_k,  ∇ v_k = v_k − v_{k−1} : the Taylor series in time by backward differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import scipy
from pydantic import Field

from nlsolve.plugin import Predictor


class Previous(Predictor):
    """v_{k+1} = v_k."""

    kind: Literal["previous"] = "previous"

    @property
    def depth(self) -> int:
        """One increment."""
        return 1

    def guess(self, past: Sequence[np.ndarray]) -> np.ndarray:
        """v_k."""
        return past[0]


class Polynomial(Predictor):
    """v_{k+1} = Σ_{i=0..d} (−1)ⁱ C(d+1, i+1) v_{k−i}, of order Δt^(d+1): the polynomial of degree d through the last
    d + 1 velocities; d = 1 is 2 v_k − v_{k−1}. At the start of a march, with fewer velocities, the degree is lower.

    What is not smooth in time, such as operators of moving nodes where neighbours change (see `skin` in `motion`), is
    amplified by ‖c‖₂: 2.2, 4.4 and 8.3 for d = 1, 2, 3.
    """

    kind: Literal["polynomial"] = "polynomial"
    degree: int = Field(1, ge=1, description="d, degree of the polynomial in time")

    @property
    def depth(self) -> int:
        """d + 1 velocities."""
        return self.degree + 1

    def guess(self, past: Sequence[np.ndarray]) -> np.ndarray:
        """Σ_i c_i v_{k−i}."""
        i = np.arange(len(past))
        return np.tensordot((-1.0) ** i * scipy.special.binom(len(past), i + 1), np.stack(past), axes=1)
