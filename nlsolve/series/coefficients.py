"""The coefficients of a series: pushed by a caller, or computed by the rule of a formula when first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn
from weakref import ref

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nlsolve.series.refusals import Array, NoSeries, not_analytic, unknown

Indices = NDArray[np.intp]
Formula = Callable[..., "Series"]

FORMULAS: dict[np.ufunc, Formula] = {}
"""The series of numpy's functions of arrays, entry by entry; of two operands one may be a constant."""

ARRAY_FORMULAS: dict[Callable[..., Any], Formula] = {}
"""Those of numpy's other functions."""

NOT_ANALYTIC: set[Callable[..., Any]] = set()
"""The functions that have no Taylor coefficients."""

FIRST_CAPACITY = 24  # coefficients packed arrays have room for at first; doubled whenever they are full


def _refusal(name: str) -> Callable[..., NoReturn]:
    """A method of `Series` that raises NoSeries, by the name that the reader knows it by."""

    def refuse(*_: Any) -> NoReturn:
        raise not_analytic(name)

    return refuse


class Series:
    """y(a) = Σ_j a^j y_j with array coefficients y_j, all of one shape.

    `Series(y_0)` starts a series that the caller continues with `append`; arithmetic on it makes dependent series.
    A pushed series keeps all its coefficients, and so does one that others are convolved with. Any other one keeps the
    first and the last, and computes one between them anew when it is asked for: a formula of many operations would fill
    the caches with numbers that nobody reads again.
    """

    def __init__(self, start: ArrayLike) -> None:
        self._rule: Callable[[int], Array] | None = None
        self._start: Array = np.array(start, dtype=float)
        self._last: Array | None = self._start
        self._known = 1
        self._buffer: Array | None = None
        self._dependents: list[ref[Series]] = []

    @classmethod
    def seed(cls, value: ArrayLike) -> Series:
        """x + a: coefficient 1 of any formula run on it is the derivative of that formula at `value`."""
        series = cls(value)
        series.append(np.ones_like(series.coefficient(0)))
        return series

    @classmethod
    def by_rule(cls, rule: Callable[[int], Array], *operands: Series) -> Series:
        """The series y_j = rule(j), where the rule asks the `operands` for their coefficients up to j."""
        series = cls(rule(0))
        series._rule = rule
        for operand in operands:
            operand._dependents.append(ref(series))
        return series

    def append(self, coefficient: ArrayLike) -> None:
        """Push the next coefficient of a series begun with `Series(y_0)`."""
        if self._rule is not None:
            raise TypeError("this series follows from others by a formula: append to the series it was made from")
        term = np.array(coefficient, dtype=float)
        if term.shape != self.shape:
            raise ValueError(f"a coefficient of shape {term.shape} in a series of shape {self.shape}")
        self._room()
        self._put(term)

    def forget(self, j: int) -> None:
        """Take back y_j, y_{j+1}, … here and in all series made from this one; y_0 stays."""
        if self._known <= j:
            return
        if j < 1:
            raise ValueError(f"coefficient {j} cannot be taken back: a series keeps y_0")
        self._known = j
        if self._buffer is None:
            self._last = self._start if j == 1 else None
        for reference in self._dependents:
            if (dependent := reference()) is not None:
                dependent.forget(j)

    def coefficient(self, j: int) -> Array:
        """y_j, computed now if it was not before; IndexError while the series it depends on is not known to order j."""
        while self._known <= j:
            if self._rule is None:
                raise IndexError(f"coefficient {j} is not known yet: {self._known} have been appended so far")
            self._put(self._rule(self._known))
        if j == 0:
            return self._start
        if self._buffer is not None:
            return self._buffer[j]
        if j == self._known - 1 and self._last is not None:
            return self._last
        assert self._rule is not None
        return self._rule(j)

    def head(self, j: int) -> Array:
        """y_0 … y_j as one array of shape (j + 1, …), which all coefficients are written to from now on."""
        self.coefficient(j)
        return self._room()[: j + 1]

    def _put(self, term: Array) -> None:
        """Keep the next coefficient."""
        if self._buffer is None:
            self._last = term
        else:
            self._room()[self._known] = term
        self._known += 1

    def _room(self) -> Array:
        """The packed coefficients, with room for one more."""
        if self._buffer is None:
            buffer = np.empty((max(FIRST_CAPACITY, 2 * self._known), *self.shape))
            for j in range(self._known):
                buffer[j] = self.coefficient(j)
            self._buffer, self._last = buffer, None
        elif self._known == len(self._buffer):
            self._buffer = np.concatenate([self._buffer, np.empty_like(self._buffer)])
        return self._buffer

    def sum(self, a: float) -> Array:
        """Σ_j a^j y_j over the coefficients known so far (Horner)."""
        total = np.zeros(self.shape)
        for j in reversed(range(self._known)):
            total = total * a + self.coefficient(j)
        return total

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one coefficient."""
        return self._start.shape

    def linear(self, operation: Callable[[Array], Array]) -> Series:
        """The series of a linear operation, which acts on every coefficient alike."""
        return Series.by_rule(lambda j: operation(self.coefficient(j)), self)

    def reshape(self, *shape: int) -> Series:
        """The same numbers in another shape."""
        return self.linear(lambda y: y.reshape(*shape))

    def __getitem__(self, part: Any) -> Series:
        """A part of the numbers, by index or slice; `x, y = u` takes a series apart along its first axis."""
        return self.linear(lambda y: y[part])

    # Arithmetic, by the formulas of numpy's functions.

    def __neg__(self) -> Series:
        return FORMULAS[np.negative](self)

    def __add__(self, other: Any) -> Series:
        return FORMULAS[np.add](self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Series:
        return FORMULAS[np.subtract](self, other)

    def __rsub__(self, other: Any) -> Series:
        return FORMULAS[np.subtract](other, self)

    def __mul__(self, other: Any) -> Series:
        return FORMULAS[np.multiply](self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Series:
        return FORMULAS[np.divide](self, other)

    def __rtruediv__(self, other: Any) -> Series:
        return FORMULAS[np.divide](other, self)

    def __pow__(self, exponent: Any) -> Series:
        return FORMULAS[np.power](self, exponent)

    def __rpow__(self, base: Any) -> Series:
        return FORMULAS[np.power](base, self)

    def __rmatmul__(self, matrix: Any) -> Series:
        return self.linear(lambda y: matrix @ y)

    def __matmul__(self, other: Any) -> NoReturn:
        raise NoSeries(
            "a series stands on the right of @ only: write matrix @ u, and np.sum(u * v) for a product of two"
        )

    # What has no Taylor coefficients, or none that are known here.

    __abs__ = _refusal("abs")
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refusal("a comparison")
    __bool__ = _refusal("a choice by condition")
    __float__ = _refusal("float")
    __mod__ = __rmod__ = _refusal("%")
    __floordiv__ = __rfloordiv__ = _refusal("//")
    __hash__ = object.__hash__

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Series:
        formula = FORMULAS.get(ufunc)
        if ufunc in NOT_ANALYTIC:
            raise not_analytic(f"np.{ufunc.__name__}")
        if formula is None or method != "__call__" or options:
            how = f".{method}" if method != "__call__" else f" with {', '.join(options)}" if options else ""
            raise unknown(f"{ufunc.__name__}{how}")
        return formula(*inputs)

    def __array_function__(self, function: Callable[..., Any], types: Any, inputs: Any, options: Any) -> Series:
        formula = ARRAY_FORMULAS.get(function)
        if function in NOT_ANALYTIC:
            raise not_analytic(f"np.{function.__name__}")
        if formula is None:
            raise unknown(function.__name__)
        return formula(*inputs, **options)
