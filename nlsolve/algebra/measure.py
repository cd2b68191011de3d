"""What the driver judges states by: R over the scale of a problem that knows one. Others are judged `by_equation`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.problem import NonlinearProblem, norm
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array, NoSeries

ROUNDING = 4.0 * float(np.finfo(float).eps)  # of r, or of ‖R‖ over the size of the terms of J u, where R is zero


class Sizes(NamedTuple):
    """How large R is at one state.

    absolute : ‖R‖₂ in the unit of the problem.
    size : by which all residuals of one solve are compared with each other.
    weighted : ‖R‖₂ in the units of `Measure.weighted`.
    relative : the relative residual.
    """

    absolute: float
    size: float
    weighted: float
    relative: float


class Measure(ABC):
    """What the driver judges the states of one solve by.

    scale : what `size` is divided by to be a relative size.
    correction : c at the state judged last; NaN where none was needed or there is none.
    """

    scale: float = 1.0
    correction: float = np.nan

    @property
    @abstractmethod
    def absolute(self) -> float:
        """What ‖R‖₂ is divided by to be a relative size."""

    @abstractmethod
    def weighted(self, residual: Array) -> Array:
        """R (U,) in units in which methods compare the residuals of states that are near each other."""

    @abstractmethod
    def sizes(self, u: Array, residual: Array) -> Sizes:
        """Of R (U,) at u (U,)."""

    @abstractmethod
    def settled(self, u: Array, residual: Array, relative: float, tolerance: float) -> bool:
        """Whether u (U,), with its relative residual, solves the problem to `tolerance`."""

    @abstractmethod
    def vanishes(self, u: Array, residual: Array) -> bool:
        """Whether R(u) is no more than the rounding in terms of the size of |J| |u| that cancel."""


class ByScale(Measure):
    """For a problem that knows the size of what cancels in it: ‖R‖₂ over its scale at the start."""

    def __init__(self, problem: NonlinearProblem, scale: float) -> None:
        self._problem, self.scale = problem, scale

    @property
    def absolute(self) -> float:
        """The scale."""
        return self.scale

    def weighted(self, residual: Array) -> Array:
        """R."""
        return residual

    def sizes(self, u: Array, residual: Array) -> Sizes:
        """‖R‖₂, and relative ‖R‖₂/scale."""
        size = norm(residual)
        return Sizes(size, size, size, size / self.scale)

    def settled(self, u: Array, residual: Array, relative: float, tolerance: float) -> bool:
        """‖R‖₂/scale ≤ tolerance."""
        return relative <= tolerance

    def vanishes(self, u: Array, residual: Array) -> bool:
        """See `Measure`."""
        try:
            terms = abs(sp.csr_array(self._problem.jacobian(u))) @ np.abs(u)
        except (SolveError, NoSeries):
            return False
        return bool(norm(residual) <= ROUNDING * norm(terms))
