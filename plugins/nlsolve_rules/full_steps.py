"""u ← u + w."""

from __future__ import annotations

from typing import Literal

import numpy as np

from nlsolve.plugin import Globalization, NonlinearProblem, Search


class FullSteps(Globalization):
    """t = 1, whatever becomes of it."""

    kind: Literal["none"] = "none"

    def search(self, problem: NonlinearProblem) -> Search:
        """Nothing to remember."""
        return Full()


class Full:
    """One residual a step."""

    def length(
        self,
        problem: NonlinearProblem,
        state: np.ndarray,
        residual: np.ndarray,
        direction: np.ndarray,
        predicted_decrease: float = 1.0,
    ) -> tuple[float, np.ndarray]:
        """1 and R(u + w)."""
        return 1.0, problem.residual(state + direction)
