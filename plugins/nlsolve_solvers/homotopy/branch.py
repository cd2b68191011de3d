"""W(a) around one state: the terms computed so far, and what extrapolations and range rules need of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from nlsolve.plugin import HomotopyForm, NonlinearProblem, norm
from nlsolve_solvers.homotopy.extrapolations import Extrapolation, coordinates, extrapolate, series
from nlsolve_solvers.homotopy.forms import weighted


class Branch:
    """One series: W_1 … W_p with the r_j = K* W_j they were solved from, all (U,)."""

    def __init__(self, problem: NonlinearProblem, state: np.ndarray, form: HomotopyForm, extrapolation: str) -> None:
        self.problem, self.state, self.kind = problem, state, extrapolation
        self.recurrence = form.recurrence(problem, state)
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
        return norm(self.rhs[0])

    @property
    def contraction(self) -> float:
        """(‖r_p‖/‖r_1‖)^(1/(p−1)): what an order leaves of the residual, in the mean; r_{j+1} is left by W_1 … W_j.
        1 for one order, of which nothing is known.
        """
        if self.order == 1:
            return 1.0
        first = self.residual
        return float((norm(self.rhs[-1]) / first) ** (1.0 / (self.order - 1))) if first else 0.0

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
        self.sizes.append(norm(w_j))
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

    def approximant(self, order: int | None = None) -> Callable[[float], np.ndarray]:
        """a ↦ W(a) of the first `order` terms, of all when none is given, in the coordinates of `columns`, (p,)."""
        made = self.extrapolation(order)
        used = self.columns[:, : made.degree]
        return lambda a: used @ made.weights(a)

    def has_pole(self) -> bool:
        """Whether the series is used in place of a Padé, which has a pole on the path."""
        return self.kind != "series" and len(self.extrapolation().denominator) == 1

    def increment(self, a: float) -> np.ndarray:
        """W(a)."""
        return weighted(self.extrapolation().weights(a), self.terms)

    def next_coefficient(self) -> np.ndarray:
        """r_{p+1}, (U,): the first coefficient that W_1 … W_p leave in the homotopy."""
        return self.recurrence.right_hand_side()

    def defect(self, a: float) -> float:
        """‖what W(a) leaves in the homotopy at a‖, by evaluating G; at a = 1 that is ‖G(W(1))‖ in either form."""
        weights = self.extrapolation().weights(a)
        g = self.problem.residual(self.state + weighted(weights, self.terms))
        return norm(g if a == 1.0 else self.recurrence.miss(a, g, weights, self.rhs))


class BranchView:
    """A `SeriesBranch`: what a range rule may look at of a branch, and nothing that would change it."""

    def __init__(self, branch: Branch) -> None:
        self._branch = branch

    @property
    def order(self) -> int:
        """p."""
        return self._branch.order

    @property
    def sizes(self) -> Sequence[float]:
        """‖W_1‖ … ‖W_p‖."""
        return tuple(self._branch.sizes)

    @property
    def terms(self) -> Sequence[np.ndarray]:
        """W_1 … W_p, each (U,), to read only."""
        return tuple(read_only(term) for term in self._branch.terms)

    @property
    def columns(self) -> np.ndarray:
        """Coordinates of the W_j, (p, p), to read only."""
        return read_only(self._branch.columns)

    @property
    def residual(self) -> float:
        """‖G(0)‖."""
        return self._branch.residual

    @property
    def contraction(self) -> float:
        """See `Branch`."""
        return self._branch.contraction

    @property
    def singularity(self) -> float:
        """See `Branch`."""
        return self._branch.singularity

    def approximant(self, order: int | None = None) -> Callable[[float], np.ndarray]:
        """See `Branch`."""
        return self._branch.approximant(order)

    def next_coefficient(self) -> np.ndarray:
        """r_{p+1}, (U,), to read only."""
        return read_only(self._branch.next_coefficient())

    def defect(self, a: float) -> float:
        """See `Branch`."""
        return self._branch.defect(a)


def read_only(values: np.ndarray) -> np.ndarray:
    """The same numbers, which cannot be written to."""
    view = values.view()
    view.flags.writeable = False
    return view
