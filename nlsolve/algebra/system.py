"""F(u) = 0, u of shape (U,): the contract of scenes that are systems of equations, each given as one formula.

The formula runs on arrays (U, …) and series alike and acts along the first axis, so that each column of an array is a
state of its own: seeded columns give the Jacobian, a pushed series the coefficients of the homotopy. Neither needs a
second formula.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.algebra.root_search import RootSearch
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.recording import SystemStart
from nlsolve.contracts.scene import Entry, Scene, Section
from nlsolve.series import Array


class System(Scene, ABC):
    """A scene given by a formula and a start, with its roots and its sparsity pattern when they are known.

    class Circle(System):
        kind: Literal["circle"] = "circle"

        def formula(self, u):
            x, y = u
            return np.stack([x**2 + y**2 - 1.0, x - y])

        def standard_start(self):
            return np.array([1.0, 0.5])
    """

    sections: ClassVar[Mapping[str, Section]] = {
        "solver": Section(NonlinearSolver, {"kind": "robust"}),
        "start": Section(SystemStart),
    }

    factor: float = Field(
        default=1.0,
        gt=0,
        description="the standard start times this; a start of zeros becomes one of factors (1: as it is)",
    )
    perturbation: float = Field(
        default=0.0, ge=0, description="seeded noise added to the start, relative to its largest entry"
    )
    seed: int = Field(default=0, ge=0, description="of that noise")

    @abstractmethod
    def formula(self, u: Any) -> Any:
        """F(u), (U, …) -> (U, …), analytic: of +, −, *, /, powers, indexing, slices, matrices from the left, np.stack,
        np.concatenate, np.sum and np.cumsum along axis 0, and the analytic functions of numpy (exp, log, sin, …);
        constants (U,) as `as_column(values, u)`.
        """

    @abstractmethod
    def standard_start(self) -> Array:
        """The state, shape (U,), from which solvers begin."""

    def start(self) -> Array:
        """The standard start, (U,), made harder by `factor` (Moré, Garbow & Hillstrom 1981) and `perturbation`."""
        standard = np.asarray(self.standard_start(), dtype=float)
        if self.factor != 1.0:
            standard = self.factor * (standard if standard.any() else np.ones_like(standard))
        noise = np.random.default_rng(self.seed).standard_normal(len(standard))
        return standard + self.perturbation * (np.abs(standard).max() or 1.0) * noise

    def pattern(self) -> Any | None:
        """Where the Jacobian may differ from zero, a sparse (U, U) matrix; None: anywhere."""
        return None

    def typical_sizes(self) -> Array | None:
        """Sizes, (U,), beside which an unknown that is small counts as zero; None: as it began, and as it is."""
        return None

    def roots(self) -> Array | None:
        """Known roots, shape (K, U), accurate to a relative 1e-12; None when none is known."""
        return None

    @property
    def singular(self) -> bool:
        """True when the Jacobian is singular at a known root: F is flat there, and a small residual says little."""
        return False

    @property
    def is_gradient(self) -> bool:
        """True when F is the gradient of a convex potential."""
        return False

    def nearest_root(self, u: Array) -> Array | None:
        """The known root, shape (U,), that is nearest to u (U,), each unknown beside the largest it is at u and at a
        root; None when none is known.
        """
        roots = self.roots()
        if roots is None:
            return None
        sizes = np.fmax(np.abs(u), np.abs(roots).max(axis=0, initial=0.0))
        return roots[np.linalg.norm((roots - u) / np.where(sizes > 0.0, sizes, 1.0), axis=1).argmin()]

    def equations(self) -> FormulaProblem:
        """The problem F(u) = 0, with its Jacobian by groups of columns and its expansion."""
        size = len(self.standard_start())
        return FormulaProblem(
            self.formula,
            size,
            self.pattern(),
            columns=True,
            is_gradient=self.is_gradient,
            typical_sizes=self.typical_sizes(),
        )

    def search(self, start: Array, linear: LinearSolver, entry: Entry) -> RootSearch:
        """The simulation from any `start` (U,); `entry` times the building of the problem."""
        with entry("operators"):
            problem = self.equations()
        return RootSearch(problem, start, linear, self.nearest_root, self.singular)

    def simulation(self, parts: Any, entry: Entry) -> RootSearch:
        """The simulation from `start()`, or from the stored state that the case names. Raises SolveError where there is
        no such state.
        """
        own, stored = self.start(), parts.start.stored
        return self.search(own if stored is None else stored.unknowns(len(own)), parts.linear, entry)
