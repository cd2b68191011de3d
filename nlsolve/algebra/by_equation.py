"""How near is u to solving F(u) = 0, in no unit: each equation beside what cancels in it, each unknown beside its size.

    r = max_i |F_i| / s_i,    s_i = Σ_j |J_ij| d_j         the relative residual
    c = max_j |Δu_j| / d_j,   J Δu = −F                    the Newton correction

with d_j the size of u_j. Neither changes when an equation or an unknown is multiplied by a number of its own. r is the
smallest relative change of the linearised equations' coefficients that makes u their solution (Oettli & Prager 1964);
c is affine-invariant (Deuflhard 2011, 1.2), and |F_i| ≤ c s_i. On a grid refined n times r says ever less, as s_i grows
like n²; c does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.algebra.measure import ROUNDING, Measure, Sizes
from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.problem import NonlinearProblem, least_squares, norm, random_signs
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array, NoSeries

FALLEN = 1e-4  # part of the size it began with below which an unknown is taken for zero
BESIDE = 0.9  # part of an equation's terms that other unknowns have where it tells the size of an unknown by theirs
SMALLEST = float(np.finfo(float).tiny / np.finfo(float).eps)  # |F_i| that has lost digits to underflow
NOISE = float(np.finfo(float).eps)  # rounding of F_i over s_i
DENSE = 300  # unknowns up to which corrections are least-norm least squares, which a singular Jacobian allows
NEAR = 0.01  # c from which no root is near
SUPERLINEAR, SLOWEST = 0.4, 0.95  # contraction of Newton's steps below which m = 1, and above which none is near
ALLOWED = 3.0  # distance from a root of multiplicity m, over r^(1/m), that a small r does not belie
LOOKED_AHEAD = 2  # Newton steps by which a root of higher multiplicity is told


@dataclass(frozen=True)
class Correction:
    """Δu = d ∘ y at a state, with the sizes d of the unknowns there, and what rounding of F alone would make of y.

    scaled : y, (U,).
    sizes : d, (U,).
    noise : max_j |y_j| for a rounding error of `NOISE` s_i in each F_i, random in sign.
    """

    scaled: Array
    sizes: Array
    noise: float

    @property
    def largest(self) -> float:
        """c."""
        return float(np.abs(self.scaled).max(initial=0.0))


class ByEquation(Measure):
    """For any other problem: r and c, as above.

    d_j = |u_j|, but at least the size that the problem declares as typical, a part `FALLEN` of the size at the start,
    and the same part of min_i s_i/|J_ij|, the change of u_j that its equations would see: an unknown whose root is zero
    is measured by these. The size at the start is |u_j|, of an unknown that is zero there its first Newton correction,
    and where this is zero too min_i s_i/|J_ij| over those equations i whose size is known by other unknowns.
    What s_i falls short of |F_i| by is filled up, so that r ≤ 1.

    A state is solved to a tolerance when r and c are within it. Instead of c may be within it what rounding of F leaves
    of c, or, at a root of multiplicity m, which Newton's steps approach by a factor of 1 − 1/m each, m c may be
    what r lets expect, r^(1/m). Where the problem has no Jacobian, F must also have fallen from its start by the
    tolerance.

    All residuals of a solve are compared by the root mean square of F_i over the s_i of the start, those of a method's
    next states by F_i over the largest s_i of the states so far.

    begun : the sizes of the unknowns at the start, (U,); zero where nothing is known of one.
    """

    def __init__(self, problem: NonlinearProblem, start: Array, residual: Array, linear: LinearSolver) -> None:
        self._problem, self._linear = problem, linear
        self._known: tuple[Array, Any] | None = None
        self._factors: Factors | None = None
        self._least = np.zeros_like(start)
        residual = np.where(np.isfinite(residual), residual, 0.0)
        begun = self._sizes_at(start, residual)
        typical = np.zeros_like(start) if problem.typical_sizes is None else np.abs(problem.typical_sizes)
        self._least = np.fmax(FALLEN * begun, typical)
        self.begun = np.fmax(begun, typical)
        self._weights = self._weights_at(start, residual)
        self._largest = 1.0 / self._weights
        self._first = self.size(residual)

    @property
    def absolute(self) -> float:
        """‖s‖₂ of the start."""
        return norm(1.0 / self._weights)

    def weighted(self, residual: Array) -> Array:
        """F_i over the largest s_i so far."""
        return residual / self._largest

    def sizes(self, u: Array, residual: Array) -> Sizes:
        """See above; the sizes of the terms at u enter the units of `weighted`."""
        relative = self.relative(u, residual)
        return Sizes(norm(residual), self.size(residual), norm(self.weighted(residual)), relative)

    def size(self, residual: Array) -> float:
        """The root mean square of F_i over the s_i of the start."""
        return norm(residual * self._weights) / float(np.sqrt(max(len(residual), 1)))

    def relative(self, u: Array, residual: Array) -> float:
        """r."""
        parts = np.abs(residual)
        if not np.isfinite(parts).all():
            return np.inf
        terms = self._terms(u)
        self._largest = np.fmax(self._largest, np.where(np.isfinite(terms), terms, 0.0))
        left = parts > SMALLEST
        return float((parts[left] / np.fmax(terms[left], parts[left])).max(initial=0.0))

    def settled(self, u: Array, residual: Array, relative: float, tolerance: float) -> bool:
        """See above."""
        self.correction = np.nan
        if not relative <= tolerance:
            return False
        if relative == 0.0:
            self.correction = 0.0
            return True
        step = self.step(u, residual)
        if step is None:
            return relative <= ROUNDING or self.size(residual) <= tolerance * self._first
        self.correction = step.largest
        if step.largest <= max(tolerance, step.noise):
            return True
        return step.largest <= NEAR and self._is_multiple(u, step, relative)

    def vanishes(self, u: Array, residual: Array) -> bool:
        """r ≤ rounding."""
        return self.relative(u, residual) <= ROUNDING

    def step(self, u: Array, residual: Array) -> Correction | None:
        """The Newton correction at u (U,), of least norm in units of d for few unknowns; None where there is none."""
        jacobian = self._jacobian(u)
        if jacobian is None or not (np.isfinite(residual).all() and np.isfinite(jacobian.data).all()):
            return None
        magnitudes = abs(jacobian)
        sizes = self._sizes(u, magnitudes)
        terms = np.fmax(magnitudes @ sizes, np.abs(residual))
        terms[~(terms > 0.0)] = 1.0
        rows = sp.diags_array(1.0 / terms)
        sizes = np.fmax(sizes, FALLEN * seen_by_equations(magnitudes, terms))
        sizes[~(sizes > 0.0)] = 1.0
        matrix = rows @ jacobian @ sp.diags_array(sizes)
        wanted = np.column_stack([-residual / terms, random_signs(len(u), 2)])
        try:
            found = self._solved(sp.csr_array(matrix), wanted)
        except SolveError:
            return None
        if not np.isfinite(found).all():
            return None
        return Correction(found[:, 0], sizes, NOISE * float(np.abs(found[:, 1:]).max(initial=0.0)))

    def _is_multiple(self, u: Array, step: Correction, relative: float) -> bool:
        """Whether Newton's steps from u (U,) shrink as towards a root of multiplicity m > 1 that is as near as r lets
        expect.
        """
        first, now, following = step, u, step
        for _ in range(LOOKED_AHEAD):
            now = now + following.sizes * following.scaled
            after = self.step(now, self._problem.residual(now))
            if after is None or not after.largest > SUPERLINEAR * following.largest:
                return False
            following = after
        contraction = (following.largest / first.largest) ** (1.0 / LOOKED_AHEAD)
        if contraction > SLOWEST:
            return False
        multiplicity = 1.0 / (1.0 - contraction)
        return multiplicity * first.largest <= ALLOWED * float(relative ** (1.0 / multiplicity))

    def _solved(self, matrix: Any, wanted: Array) -> Array:
        if matrix.shape[0] <= DENSE:
            return least_squares(matrix.toarray(), wanted)[0]
        self._factors = self._linear.factorize(matrix, self._factors)
        return np.column_stack([self._factors.solve(column) for column in wanted.T])

    def _sizes(self, u: Array, magnitudes: Any) -> Array:
        """d, (U,), without what equations see; an unknown of which nothing was known at the start has that too.

        magnitudes : |J|, sparse (U, U); None where there is none.
        """
        sizes = np.fmax(np.abs(u), self._least)
        unknown = self._least == 0.0
        if magnitudes is None or not unknown.any():
            return sizes
        terms = magnitudes @ np.where(unknown, 0.0, sizes)
        beside = np.where(terms >= BESIDE * (magnitudes @ sizes), terms, 0.0)
        return np.fmax(sizes, np.where(unknown, FALLEN**2 * seen_by_equations(magnitudes, beside), 0.0))

    def _terms(self, u: Array) -> Array:
        """Σ_j |J_ij| d_j, (U,); zeros where there is no J."""
        jacobian = self._jacobian(u)
        if jacobian is None:
            terms = self._problem.estimated_terms(u, self._sizes(u, None))
        else:
            magnitudes = abs(jacobian)
            terms = magnitudes @ self._sizes(u, magnitudes)
        return np.nan_to_num(terms, nan=0.0)

    def _jacobian(self, u: Array) -> Any:
        """J(u), sparse (U, U), kept while u stays the same; None where there is none."""
        if self._known is None or not np.array_equal(self._known[0], u):
            try:
                matrix = self._problem.linearisation(u, np.fmax(np.abs(u), self._least))
            except (SolveError, NoSeries):
                matrix = None
            self._known = u.copy(), None if matrix is None else sp.csr_array(matrix)
        return self._known[1]

    def _sizes_at(self, start: Array, residual: Array) -> Array:
        """The sizes of the unknowns at the start, (U,); zero where nothing is known of one."""
        sizes, jacobian = np.abs(start), self._jacobian(start)
        if jacobian is None or sizes.all():
            return sizes
        sizes = np.where(sizes > 0.0, sizes, self._first_correction(jacobian, residual))
        magnitudes = abs(jacobian)
        while not sizes.all():
            seen = seen_by_equations(magnitudes, np.fmax(magnitudes @ sizes, np.abs(residual)))
            if not (found := (sizes == 0.0) & (seen > 0.0)).any():
                break
            sizes = np.where(found, seen, sizes)
        return sizes

    def _weights_at(self, start: Array, residual: Array) -> Array:
        """1/s_i at the start, (U,), of 1 where an equation has no size there."""
        jacobian = self._jacobian(start)
        terms = self._problem.estimated_terms(start, self.begun) if jacobian is None else abs(jacobian) @ self.begun
        terms = np.fmax(terms, np.abs(residual))
        weights = np.divide(1.0, terms, out=np.ones_like(terms), where=terms > 0.0)
        return np.where(np.isfinite(weights), weights, 1.0)

    def _first_correction(self, jacobian: Any, residual: Array) -> Array:
        """|J⁻¹ F|, (U,), in which rows and columns are made of one size first; zeros where J is singular."""
        none = np.zeros(len(residual))
        rows = abs(jacobian).max(axis=1).toarray().ravel()
        if not ((rows > 0.0) & np.isfinite(rows)).all():
            return none
        scaled = sp.diags_array(1.0 / rows) @ jacobian
        columns = abs(scaled).max(axis=0).toarray().ravel()
        if not (columns > 0.0).all():
            return none
        matrix = sp.csr_array(scaled @ sp.diags_array(1.0 / columns))
        try:
            self._factors = self._linear.factorize(matrix)
            found = self._factors.solve(residual / rows) / columns
        except SolveError:
            return none
        return np.where(np.isfinite(found), np.abs(found), 0.0)


def seen_by_equations(magnitudes: Any, terms: Array) -> Array:
    """min_i s_i/|J_ij| over equations with s_i > 0, (U,), for |J| sparse (U, U) and s (U,); 0 where there is none."""
    known = np.divide(1.0, terms, out=np.zeros_like(terms), where=terms > 0.0)
    shares = (sp.diags_array(known) @ magnitudes).max(axis=0).toarray().ravel()
    return np.divide(1.0, shares, out=np.zeros_like(shares), where=shares > 0.0)
