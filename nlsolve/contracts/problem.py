"""R(u) = 0 : the contract of nonlinear problems, and of their expansion along a path u(a)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array, Series

FEW = 300
"""Most unknowns of a problem without a Jacobian that differences of its residual make one for, to judge a state."""

PROBES = 16
"""Random directions by which the terms of the equations of others are estimated."""

STEP = float(np.sqrt(np.finfo(float).eps))
"""Step of a difference over the size of the unknown."""

SAFE = 1e-150, 1e150
"""Between these a sum of squares neither overflows nor loses digits to underflow."""


def norm(vector: Array) -> float:
    """‖x‖₂ of x (N,), finite up to the largest float."""
    size = float(np.linalg.norm(vector))
    if SAFE[0] < size < SAFE[1] or np.isnan(size):
        return size
    largest = float(np.abs(vector).max(initial=0.0))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(vector / largest))


def unit(vector: Array) -> float:
    """A power of two near the largest |x_i| of x (N,): to divide by it rounds nothing, and squares neither overflow
    nor underflow. 1 for zero, and where x is not finite.
    """
    largest = float(np.abs(vector).max(initial=0.0))
    return float(np.ldexp(0.5, np.frexp(largest)[1])) if 0.0 < largest < np.inf else 1.0


def least_squares(matrix: Array, rhs: Array, noise: float | None = None) -> tuple[Array, int]:
    """x (N,) or (N, C) of the least ‖A x − b‖₂, the smallest where many are, and the rank of A (M, N).

    noise : singular values below this part of the largest count as zero; by default max(M, N) units of rounding.
    Raises SolveError (not finite) where A or b is not: LAPACK would print its own complaint first.
    """
    if not (np.isfinite(matrix).all() and np.isfinite(rhs).all()):
        raise SolveError(Status.NON_FINITE, "least squares of numbers that are not finite")
    x, _, rank, _ = np.linalg.lstsq(matrix, rhs, rcond=noise)
    return np.asarray(x, dtype=float), int(rank)


def random_signs(size: int, count: int) -> Array:
    """Columns of ±1, (U, C), the same ones whenever they are asked for."""
    return np.where(np.random.default_rng(0).random((size, count)) < 0.5, -1.0, 1.0)


class Expansion:
    """R(u(a)) = Σ_j a^j R_j along u(a) = u_0 + a u_1 + … : coefficients of the residual, one order at a time.

    Made by running the residual's own formula on a pushed series, so that there is no second formula to keep in step.
    """

    def __init__(self, path: Series, residual: Series) -> None:
        self._path, self._residual = path, residual

    def coefficient(self, j: int) -> Array:
        """R_j, shape (U,), which needs u_0 … u_j. Raises IndexError while one of these has not been appended."""
        return self._residual.coefficient(j)

    def remainder(self, j: int) -> Array:
        """Q_j of R_j = J u_j + Q_j, where u_j is the next to be appended: R_j as it would be with u_j = 0."""
        self._path.append(np.zeros(self._path.shape))
        remainder = self._residual.coefficient(j).copy()  # R_j will be written where this was
        self._path.forget(j)
        return remainder

    def append(self, coefficient: Array) -> None:
        """Push u_j, shape (U,), the next coefficient of the path."""
        self._path.append(coefficient)

    def path(self, a: float) -> Array:
        """u(a), shape (U,), summed over the coefficients appended so far."""
        return self._path.sum(a)


class NonlinearProblem(ABC):
    """R(u) = 0 for u of shape (U,).

    A problem must define `residual` only. Methods that factorise or multiply need `jacobian`, methods that use Taylor
    series need `expand`, and Picard's iteration needs `secant`. A method ends as "not applicable" on a problem that
    does not define what it needs.
    """

    operator_is_jacobian: bool = True
    """False when `operator` gives another matrix than `jacobian`."""
    is_gradient: bool = False
    """True when R is the gradient of a convex potential, so that R(u + t w)·w grows with t for every direction w."""
    has_other_discretizations: bool = False
    """True when `jacobian_by` can assemble J of the same equations for the same unknowns by another discretizer."""
    typical_sizes: Array | None = None
    """Sizes, (U,), at which the unknowns count as large: what is small beside them is zero. None: not known."""

    @property
    def has_scale(self) -> bool:
        """True when the problem knows the size of what cancels in R; by default, when its class defines `scale`."""
        return type(self).scale is not NonlinearProblem.scale

    @property
    def has_series(self) -> bool:
        """True when the problem can expand R; by default, when its class defines `expand`."""
        return type(self).expand is not NonlinearProblem.expand

    @abstractmethod
    def residual(self, u: Array) -> Array:
        """R(u), shape (U,)."""

    def jacobian(self, u: Array) -> Any:
        """J = ∂R/∂u, a sparse (U, U) matrix. Raises SolveError (not applicable) when the problem has none."""
        raise SolveError(
            Status.NOT_APPLICABLE,
            f"{type(self).__name__} has no Jacobian: define its method `jacobian`, or choose a method that needs its "
            "residual only, such as scipy-root with precondition = false",
        )

    def operator(self, u: Array) -> Any:
        """What K* is made of at u, a sparse (U, U) matrix: J(u), unless the case has another iteration operator."""
        return self.jacobian(u)

    def expand(self, u: Array) -> Expansion:
        """The expansion of R around u. Raises SolveError (not applicable) when the problem has none."""
        raise SolveError(
            Status.NOT_APPLICABLE,
            f"{type(self).__name__} has no Taylor series of its residual: write the residual as one formula and run it "
            "on a Series in a method `expand`, or choose a method that needs no series, such as newton or anderson",
        )

    def secant(self, u: Array) -> Any:
        """A(u) with R(u) = A(u) u + c(u), a sparse (U, U) matrix: Picard's matrix.

        It belongs to a problem that is linear once its coefficients are held; their derivatives are left out of A.
        Raises SolveError (not applicable) when the problem has none.
        """
        raise SolveError(
            Status.NOT_APPLICABLE,
            f"{type(self).__name__} has no secant matrix A(u) with R(u) = A(u) u + c(u): choose a method that needs "
            "its Jacobian only, such as newton or anderson",
        )

    def newtonian(self, u: Array, rate: float | None) -> Any:
        """J(u) as if the viscosity were that of one strain rate ε̄ [1/s] everywhere, a sparse (U, U) matrix.

        rate : ε̄; None: the problem's own reference rate.
        Raises SolveError (not applicable) for a problem without a viscosity, or without a rate.
        """
        raise SolveError(
            Status.NOT_APPLICABLE,
            f"{type(self).__name__} has no viscosity, and so no Newtonian operator: choose another operator, such as "
            "tangent or diagonal",
        )

    def jacobian_by(self, discretizer: Any, u: Array) -> Any:
        """J(u) of the same equations by another discretizer, a sparse (U, U) matrix whose rows have the units of R.

        Raises SolveError (not applicable) for a problem that no discretizer has made.
        """
        raise SolveError(
            Status.NOT_APPLICABLE,
            f"{type(self).__name__} knows no other discretization of its equations: choose another operator, such as "
            "tangent or diagonal",
        )

    def undefined(self, u: Array) -> str:
        """Why R, its derivative or its series does not exist at u, in a sentence; empty where that is not known."""
        return ""

    def blame(self, u: Array, residual: Array) -> Mapping[str, float]:
        """Where R(u) = `residual` (U,) is largest, and what is special there: columns `blame_…` of a failed solve."""
        return {"blame_unknown": int(np.nan_to_num(np.abs(residual), nan=np.inf).argmax())}

    def scale(self, u: Array) -> float:
        """The size that ‖R(u)‖₂ is divided by to judge it, for a problem that knows the size of what cancels in R.

        A problem that does not define it is judged equation by equation, by J (`nlsolve.algebra.by_equation`).
        """
        return 1.0

    def size(self, residual: Array) -> float:
        """‖R‖₂ of R (U,) in the units of `weighted`."""
        return norm(self.weighted(residual))

    def weighted(self, residual: Array) -> Array:
        """R (U,) in units that do not depend on those of its equations: in a solve of a problem without a scale the
        driver divides each F_i by the size of what cancels in it, the largest one so far. Else R itself.
        """
        return residual

    def linearisation(self, u: Array, sizes: Array) -> Any:
        """J(u), or what comes near it, by which a state is judged, outside of methods; None where that costs too much.

        A problem of few unknowns that has no Jacobian is judged by differences of R.

        sizes : of the unknowns, (U,). Raises SolveError when J does not exist at u.
        """
        try:
            return self.jacobian(u)
        except SolveError as error:
            if error.status is not Status.NOT_APPLICABLE:
                raise
        if len(u) > FEW:
            return None
        steps = np.where(sizes > 0.0, sizes, 1.0)
        return self.differences(u, np.diag(steps)) / steps

    def estimated_terms(self, u: Array, sizes: Array) -> Array:
        """(Σ_j (J_ij d_j)²)^½ for `sizes` d, (U,), where `linearisation` gives nothing: the root mean square of J D z
        over random signs z, by differences of R.
        """
        products = self.differences(u, sizes[:, None] * random_signs(len(u), PROBES))
        terms: Array = np.sqrt((products**2).mean(axis=1))
        return terms

    def differences(self, u: Array, directions: Array) -> Array:
        """About J(u) W for directions W of the size of the unknowns, both (U, C)."""
        before = self.residual(u)
        return np.stack([(self.residual(u + STEP * w) - before) / STEP for w in directions.T], axis=1)
