"""F(u) = 0 given as one formula: arrays run through it are residuals, seeded series its Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.algebra.colouring import Compression
from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.contracts.status import InputError, SolveError, Status
from nlsolve.contracts.system import System
from nlsolve.series import Array, Series

UNFIT = (AttributeError, IndexError, TypeError, ValueError)
"""What Python and NumPy raise when a formula for arrays asks of a series what only an array has."""


class FormulaProblem(NonlinearProblem):
    """F(u) = 0; the Jacobian is coefficient 1 of the formula run on u with the seeds of a group of columns.

    formula : F, (U,) -> (U,). Where it is not analytic there is no Jacobian but a given one, and no expansion.
    size : U.
    pattern : where the Jacobian may differ from zero, a (U, U) matrix; None: anywhere.
    jacobian : u -> J(u), dense or sparse (U, U), instead of the one from the formula.
    columns : F acts on each column of an array (U, C), as that of a `System` does, so that one run of it serves all
        groups of columns. A formula that knows states (U,) only is run once a group.

    Its scale is 1: the published sets are judged by an absolute residual (‖F‖∞ < 1e-6 for the 23 problems), and F alone
    does not tell the size of what cancels in it. `stop.tolerance` therefore is a bound on ‖F‖₂ itself.
    """

    def __init__(
        self,
        formula: Callable[[Any], Any],
        size: int,
        pattern: Any | None = None,
        jacobian: Callable[[Array], Any] | None = None,
        columns: bool = False,
    ) -> None:
        self._formula, self._given, self._columns = formula, jacobian, columns
        self._compression = Compression(pattern, size)

    @classmethod
    def of(cls, system: System) -> FormulaProblem:
        """The equations of a system."""
        problem = cls(system.formula, len(system.standard_start()), system.pattern(), columns=True)
        problem.is_gradient = system.is_gradient
        return problem

    def residual(self, u: Array) -> Array:
        """F(u). Raises InputError where that is no (U,) array of real numbers."""
        return real(self._formula(u), u.shape, "F(u)")

    def jacobian(self, u: Array) -> Any:
        """J(u), sparse (U, U). Raises SolveError (not applicable) where there is none, InputError for a wrong one."""
        if self._given is not None:
            return _matrix(self._given(u), len(u))
        try:
            return self._compression.unpack(self._derivative(u, self._compression.seeds))
        except UNFIT as error:
            raise SolveError(
                Status.NOT_APPLICABLE,
                "the Jacobian is made by running F on a power series, which it does not allow: give a `jacobian`, or "
                f"choose a method that asks for none, such as scipy-root without precondition; {_said(error)}",
            ) from error

    def expand(self, u: Array) -> Expansion:
        """The same formula, run on a series that begins with u. Raises SolveError (not applicable) where it cannot be."""
        path = Series(u)
        try:
            return Expansion(path, self._along(path))
        except UNFIT as error:
            raise SolveError(
                Status.NOT_APPLICABLE,
                "the method runs F on a power series, which it does not allow: choose a method that asks for residuals "
                f"and Jacobians only, such as newton; {_said(error)}",
            ) from error

    def _derivative(self, u: Array, seeds: Array) -> Array:
        """J(u) S for directions S, (U, C)."""
        if not self._columns:
            return np.stack([self._along(_seeded(u, seed)).coefficient(1) for seed in seeds.T], axis=1)
        return self._along(_seeded(np.broadcast_to(u[:, None], seeds.shape), seeds)).coefficient(1)

    def _along(self, path: Series) -> Series:
        """F(u(a)); a list or an array of the equations, each a series or a number, is put together."""
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
    """`values` as an array of real numbers of this shape. Raises InputError that says what `name` is instead."""
    if type(values) is np.ndarray and values.dtype == np.float64 and values.shape == shape:
        return values
    if values is None:
        raise InputError(f"{name} = None: should be numbers of shape {shape}; does the function return them?")
    try:
        array = np.asarray(values)
    except ValueError as error:  # lists of several lengths
        raise InputError(f"{name}: should be numbers of shape {shape}, not lists of several lengths") from error
    if array.dtype.kind == "c":
        raise InputError(f"{name}: should be real, not complex: make real and imaginary parts unknowns of their own")
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name}: should be numbers of shape {shape}, not of type {array.dtype.name}")
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}: should have shape {shape}, an equation for each unknown")
    return array.astype(float)


def _matrix(values: Any, size: int) -> Any:
    """A given Jacobian, sparse (U, U)."""
    if sp.issparse(values):
        real(values.data, values.data.shape, "jacobian(u)")
        if values.shape != (size, size):
            raise InputError(f"jacobian(u) has shape {values.shape}: should have shape {(size, size)}")
        return sp.csr_array(values, dtype=float)
    return sp.csr_array(real(values, (size, size), "jacobian(u)"))
