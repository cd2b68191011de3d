"""u ← u + w."""

from __future__ import annotations

from typing import Literal

import numpy as np

from nlsolve.plugin import Globalization, NonlinearProblem, Search


class FullSteps(Globalization):
    """t = 1 at every step, even where ‖R‖ grows."""

    kind: Literal["none"] = "none"

    def search(self, problem: NonlinearProblem) -> Search:
        """The search of one solve, which remembers nothing."""
        return Full()


class Full:
    """t = 1, for one residual a step."""

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
