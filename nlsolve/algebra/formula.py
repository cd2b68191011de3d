"""F(u) = 0 given as one formula: run on an array it gives the residual, on a seeded series the Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.algebra.colouring import Colouring
from nlsolve.contracts.problem import PROBES, Expansion, NonlinearProblem, random_signs
from nlsolve.contracts.status import InputError, SolveError, Status
from nlsolve.series import Array, NoSeries, NoSeriesHere, Series

NUMBERS = "iuf"
"""Kinds of NumPy types that are accepted as real numbers."""

LONGEST_VALUE = 60
"""Longest wrong value that a sentence repeats, in characters."""

WIDEST = 2000
"""Most columns, or groups of columns, of a Jacobian that is made only to judge a state."""

UNFIT = (AttributeError, IndexError, TypeError, ValueError)
"""What Python and NumPy raise when a formula for arrays asks of a series what only an array has."""

OVERFLOWS = (OverflowError, ZeroDivisionError)
"""What numbers of Python raise where those of NumPy become inf or NaN."""


class FormulaProblem(NonlinearProblem):
    """F(u) = 0; the Jacobian is coefficient 1 of the formula run on u with the seeds of a group of columns.

    formula : F, (U,) -> (U,). One that is not analytic has no expansion, and no Jacobian unless `jacobian` is given.
    size : U.
    pattern : where the Jacobian may differ from zero, a (U, U) matrix; None: anywhere.
    jacobian : u -> J(u), dense or sparse (U, U), instead of the one from the formula.
    columns : True when F acts on each column of an array (U, C), as the formula of a `System` does: one run then serves
        all groups of columns. Otherwise F is run once for each group.
    is_gradient : whether F is the gradient of a convex potential.
    typical_sizes : see `NonlinearProblem`.

    F alone does not tell the size of what cancels in it, and has no scale: its states are judged by its Jacobian,
    equation by equation (`ByEquation`). One that has no Jacobian is judged by differences of F.
    """

    def __init__(
        self,
        formula: Callable[[Any], Any],
        size: int,
        pattern: Any | None = None,
        jacobian: Callable[[Array], Any] | None = None,
        columns: bool = False,
        is_gradient: bool = False,
        typical_sizes: Array | None = None,
    ) -> None:
        self.is_gradient, self.typical_sizes = is_gradient, typical_sizes
        self._formula, self._given, self._columns = formula, jacobian, columns
        self._colouring = Colouring(pattern, size)

    @property
    def has_series(self) -> bool:
        """False when a Jacobian is given, which is taken to mean that F does not run on a series."""
        return self._given is None

    def residual(self, u: Array) -> Array:
        """F(u), (U,); NaN where a number of Python overflows in F or is divided by zero. Raises InputError when F(u) is
        no (U,) array of real numbers.
        """
        try:
            return real(self._formula(u), u.shape, "F(u)")
        except OVERFLOWS:
            return np.full(u.shape, np.nan)

    def undefined(self, u: Array) -> str:
        """What a number of Python raises in F at u."""
        try:
            self._formula(u)
        except OVERFLOWS as error:
            return f"F has no value here: {_said(error)}; choose a start or a method that keeps away from there"
        return ""

    def jacobian(self, u: Array) -> Any:
        """J(u), sparse (U, U). Raises SolveError (not applicable) when there is none, and (non-finite) where a number
        of Python overflows in it; InputError for a wrong one.
        """
        if self._given is not None:
            try:
                return _matrix(self._given(u), len(u))
            except OVERFLOWS as error:
                raise SolveError(Status.NON_FINITE, f"jacobian(u) has no value here: {_said(error)}") from error
        return self._colouring.unpack(self.derivative(u, self._colouring.seeds))

    def linearisation(self, u: Array, sizes: Array) -> Any:
        """J(u), by differences where F has none; None where it has more than `WIDEST` groups of columns."""
        if self._given is None and self._colouring.seeds.shape[1] > WIDEST:
            return None
        try:
            return self.jacobian(u)
        except SolveError as error:
            if error.status is not Status.NOT_APPLICABLE:
                raise
        steps = np.where(sizes > 0.0, sizes, 1.0)
        product = self._colouring.unpack(self.differences(u, steps[:, None] * self._colouring.seeds))
        return product @ sp.diags_array(1.0 / steps)

    def estimated_terms(self, u: Array, sizes: Array) -> Array:
        """See `NonlinearProblem`; by products with J where F runs on a series."""
        try:
            products = self.derivative(u, sizes[:, None] * random_signs(len(u), PROBES))
        except (SolveError, NoSeries):
            return super().estimated_terms(u, sizes)
        return np.sqrt((products**2).mean(axis=1))

    def expand(self, u: Array) -> Expansion:
        """The formula run on a series that begins with u. Raises SolveError (not applicable) when F does not
        run on one.
        """
        path = Series(u)
        try:
            return Expansion(path, self._along(path))
        except OVERFLOWS as error:
            raise SolveError(Status.NON_FINITE, f"F has no series here: {_said(error)}") from error
        except UNFIT as error:
            raise SolveError(
                Status.NOT_APPLICABLE,
                "it is expanded by running F on a power series, and F does not run on one: choose a method that asks "
                f"for residuals and Jacobians only, such as newton ({_said(error)})",
            ) from error

    def derivative(self, u: Array, directions: Array) -> Array:
        """J(u) S for directions S, both (U, C). Raises SolveError when F does not run on a series (not applicable), or
        has no derivative at u (non-finite).
        """
        try:
            if self._columns:
                base = np.broadcast_to(u[:, None], directions.shape)
                return self._along(_seeded(base, directions)).coefficient(1)
            products = [self._along(_seeded(u, w)).coefficient(1) for w in directions.T]
            return np.stack(products, axis=1) if products else directions
        except NoSeriesHere as error:
            raise SolveError(Status.NON_FINITE, f"F has no derivative here: {error}") from error
        except OVERFLOWS as error:
            raise SolveError(Status.NON_FINITE, f"F has no derivative here: {_said(error)}") from error
        except UNFIT as error:
            raise SolveError(
                Status.NOT_APPLICABLE,
                "its Jacobian is made by running F on a power series, and F does not run on one: give `jacobian`, or "
                f"choose a method that asks for none, such as scipy-root without precondition ({_said(error)})",
            ) from error

    def _along(self, path: Series) -> Series:
        """F(u(a)) as one series; a list or array of equations, each a series or a number, is stacked."""
        values = self._formula(path)
        if isinstance(values, np.ndarray) and values.dtype == object:
            values = values.tolist()
        if isinstance(values, list | tuple) and any(isinstance(part, Series) for part in values):
            values = np.stack(values)
        if not isinstance(values, Series):  # F does not depend on u
            return 0.0 * path + real(values, path.shape, "F(u)")
        if values.shape != path.shape:
            raise TypeError(f"F of a series of shape {path.shape} has shape {values.shape}")
        return values


def _seeded(u: Array, seeds: Array) -> Series:
    """u + a S."""
    path = Series(u)
    path.append(seeds)
    return path


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def real(values: Any, shape: tuple[int, ...], name: str) -> Array:
    """`values` as an array of real numbers of this shape. Raises InputError that names `name` when it is not."""
    if type(values) is np.ndarray and values.dtype == np.float64 and values.shape == shape:
        return values
    text = repr(values)
    found = f"{name} = {text}" if len(text) <= LONGEST_VALUE and "\n" not in text else name
    wanted = f"should be real numbers of shape {shape}"
    if values is None:
        raise InputError(f"{found}: {wanted}; does the function return them?")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{found}: {wanted}, not lists of several lengths") from error
    if array.dtype.kind == "c":
        raise InputError(f"{found}: {wanted}; make real and imaginary parts unknowns of their own")
    if array.dtype.kind not in NUMBERS:
        raise InputError(f"{found}: {wanted}, not {array.dtype.type.__name__.removesuffix('_')}")
    if array.shape != shape:
        raise InputError(f"{found}: {wanted}, and has shape {array.shape}")
    return array.astype(float)


def _matrix(values: Any, size: int) -> Any:
    """A given Jacobian, sparse (U, U)."""
    if not sp.issparse(values):
        return sp.csr_array(real(values, (size, size), "jacobian(u)"))
    if values.shape != (size, size):
        raise InputError(f"jacobian(u): should have shape {(size, size)}, and has shape {values.shape}")
    matrix = sp.csr_array(values)
    matrix.data = real(matrix.data, matrix.data.shape, "entries of jacobian(u)")
    return matrix
