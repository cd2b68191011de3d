"""W(a) around one state: the terms computed so far, and what extrapolations and range rules need of them."""

from __future__ import annotations

import numpy as np

from nlsolve.plugin import NonlinearProblem
from nlsolve_solvers.homotopy.extrapolations import Extrapolation, coordinates, extrapolate, series
from nlsolve_solvers.homotopy.forms import FORMS, weighted


class Branch:
    """One series: W_1 … W_p with the r_j = K* W_j they were solved from, all (U,)."""

    def __init__(self, problem: NonlinearProblem, state: np.ndarray, form: str, extrapolation: str) -> None:
        self.problem, self.state, self.kind = problem, state, extrapolation
        self.recurrence = FORMS[form](problem, state)
        self.rhs: list[np.ndarray] = []
        self.terms: list[np.ndarray] = []
        self.sizes: list[float] = []
        self._columns: np.ndarray | None = None

    @property
    def order(self) -> int:
        """p, the number of terms so far."""
        return len(self.terms)

    @property
    def residual(self) -> float:
        """‖G(0)‖."""
        return float(np.linalg.norm(self.rhs[0]))

    @property
    def contraction(self) -> float:
        """(‖r_p‖/‖r_1‖)^(1/(p−1)): what an order leaves of the residual, in the mean; r_{j+1} is left by W_1 … W_j."""
        first = self.residual
        return float((np.linalg.norm(self.rhs[-1]) / first) ** (1.0 / (self.order - 1))) if first else 0.0

    @property
    def singularity(self) -> float:
        """ρ ≈ (‖W_{p−2}‖/‖W_p‖)^(1/2): how far from a = 0 the nearest singularity of W lies. Over two orders, because
        the terms of an even or an odd W vanish in turn (Hadamard; of two singularities ±ρ or ρ e^(±iθ) the common ρ).
        """
        if self.order < 3 or not self.sizes[-1]:
            return float("inf") if self.order and not self.sizes[-1] else float("nan")
        return float((self.sizes[-3] / self.sizes[-1]) ** 0.5)

    def append(self, rhs: np.ndarray, w_j: np.ndarray) -> None:
        """Push W_j and r_j = K* W_j."""
        self.rhs.append(rhs)
        self.terms.append(w_j)
        self.sizes.append(float(np.linalg.norm(w_j)))
        self.recurrence.append(w_j)
        self._columns = None

    @property
    def columns(self) -> np.ndarray:
        """Coordinates of the W_j, (p, p)."""
        if self._columns is None:
            self._columns = coordinates(self.terms)
        return self._columns

    def extrapolation(self, order: int | None = None) -> Extrapolation:
        """The approximant made of the first `order` terms, of all when none is given."""
        order = order or self.order
        return series(order) if self.kind == "series" else extrapolate(self.kind, self.columns[:, :order])

    def has_pole(self) -> bool:
        """Whether the series is used in place of a Padé, which has a pole on the path."""
        return self.kind != "series" and len(self.extrapolation().denominator) == 1

    def increment(self, a: float) -> np.ndarray:
        """W(a)."""
        return weighted(self.extrapolation().weights(a), self.terms)

    def defect(self, a: float) -> float:
        """‖what W(a) leaves in the homotopy at a‖, by evaluating G; at a = 1 that is ‖G(W(1))‖ in either form."""
        weights = self.extrapolation().weights(a)
        g = self.problem.residual(self.state + weighted(weights, self.terms))
        return float(np.linalg.norm(g if a == 1.0 else self.recurrence.miss(a, g, weights, self.rhs)))
