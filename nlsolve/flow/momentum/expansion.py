"""The series of a flow's residual along a path of its unknowns, the velocities at the interior nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nlsolve.contracts.problem import Expansion
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array, Indices, NoSeriesHere, Series


@dataclass(frozen=True)
class Placing:
    """The matrix (size, U) that puts entry i of a vector at place free[i] of a longer one, which is zero elsewhere."""

    free: Indices
    size: int

    def __matmul__(self, u: Array) -> Array:
        if not isinstance(u, np.ndarray):  # a series asks for each of its coefficients
            return NotImplemented
        placed = np.zeros(self.size)
        placed[self.free] = u
        return placed


class FlowExpansion(Expansion):
    """The expansion of a flow, whose law may have no series at a strain rate."""

    def __init__(
        self, path: Series, residual: Series, without_series: Callable[[Array, NoSeriesHere], SolveError]
    ) -> None:
        super().__init__(path, residual)
        self._without_series = without_series

    def coefficient(self, j: int) -> Array:
        try:
            return super().coefficient(j)
        except NoSeriesHere as refusal:
            raise self._without_series(self._path.coefficient(0), refusal) from refusal

    def remainder(self, j: int) -> Array:
        try:
            return super().remainder(j)
        except NoSeriesHere as refusal:
            raise self._without_series(self._path.coefficient(0), refusal) from refusal
