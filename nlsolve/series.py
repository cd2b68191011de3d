"""y(a) = y₀ + a y₁ + a² y₂ + …: truncated power series over arrays, pushed one order at a time.

A `Series` remembers its coefficients and the rule for the next one. Arithmetic on series builds new series whose
coefficient j is computed when first asked for, from the coefficients 0 … j of its operands, with O(j) array
operations; p orders of a whole formula therefore cost O(p²). Write a formula once, for arrays, and run it on

    an array            its values,
    `Series.seed(x)`    its derivative: coefficient 1 of f(x + a) is f′(x),
    a pushed `Series`   its Taylor coefficients along a path x(a).

Recurrences: Griewank & Walther, Evaluating Derivatives (2008), table 13.2. What is not analytic (absolute value,
comparison, choice by condition) has no Taylor coefficients and raises NoSeries. What is analytic, but not at the values
it is run at, as √x at x = 0, has its value there, and raises NoSeriesHere for the first coefficient that there is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from numbers import Number
from typing import Any, NoReturn
from weakref import ref

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
INFINITE, UNREAL, STEEP = "it is infinite there", "it has no real value there", "its slope is infinite there"
FIRST_CAPACITY = 24  # coefficients packed arrays have room for at first; doubled whenever they are full
_WAY_OUT = (
    "write the formula with +, -, *, /, powers, the elementary functions of numpy (exp, log, sqrt, sin, atan2, sinh, "
    "…), np.sum, np.stack and matrices from the left"
)


class NoSeries(TypeError):
    """A formula that has no Taylor coefficients, or is not written so that a `Series` can find them."""


class NoSeriesHere(NoSeries):
    """A formula that has Taylor coefficients, but not at the values it is run at.

    entry : index of the first such value in the array of values.
    """

    def __init__(self, name: str, values: Array, where: Mask, why: str) -> None:
        self.entry = tuple(int(i) for i in np.argwhere(where)[0])
        place = f" (entry {', '.join(map(str, self.entry))})" if values.size > 1 else ""
        super().__init__(f"{name} has no power series at x = {values[self.entry]:g}{place}: {why}")


def _not_analytic(name: str) -> NoSeries:
    return NoSeries(
        f"absolute value, comparison and choice by condition (here {name}) are not analytic, so they have no Taylor "
        f"coefficients: {_WAY_OUT}"
    )


def _unknown(name: str) -> NoSeries:
    return NoSeries(f"a series has no rule for {name}: {_WAY_OUT}")


def _refusal(name: str) -> Callable[..., NoReturn]:
    """A method of `Series` that raises NoSeries, by the name that the reader knows it by."""

    def refuse(*_: Any) -> NoReturn:
        raise _not_analytic(name)

    return refuse


class Series:
    """y(a) = Σ_j a^j y_j with array coefficients y_j, all of one shape.

    `Series(y_0)` starts a series that the caller continues with `append`; arithmetic on it makes dependent series.
    """

    def __init__(self, start: ArrayLike) -> None:
        self._rule: Callable[[int], Array] | None = None
        self._terms = [np.array(start, dtype=float)]
        self._packed = 0
        self._buffer: Array | None = None
        self._dependents: list[ref[Series]] = []

    @classmethod
    def seed(cls, value: ArrayLike) -> Series:
        """x + a: coefficient 1 of any formula run on it is the derivative of that formula at `value`."""
        series = cls(value)
        series.append(np.ones_like(series.coefficient(0)))
        return series

    @classmethod
    def _by_rule(cls, rule: Callable[[int], Array], *operands: Series) -> Series:
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
        self._terms.append(term)

    def forget(self, j: int) -> None:
        """Take back y_j, y_{j+1}, … here and in all series made from this one; y_0 stays."""
        if len(self._terms) <= j:
            return
        if j < 1:
            raise ValueError(f"coefficient {j} cannot be taken back: a series keeps y_0")
        del self._terms[j:]
        self._packed = min(self._packed, j)
        for reference in self._dependents:
            if (dependent := reference()) is not None:
                dependent.forget(j)

    def coefficient(self, j: int) -> Array:
        """y_j, computed now if it was not before; IndexError while the series it depends on is not known to order j."""
        while len(self._terms) <= j:
            if self._rule is None:
                raise IndexError(f"coefficient {j} is not known yet: {len(self._terms)} have been appended so far")
            self._terms.append(self._rule(len(self._terms)))
        return self._terms[j]

    def head(self, j: int) -> Array:
        """y_0 … y_j as one array of shape (j + 1, …); packed only for series that others are convolved with."""
        self.coefficient(j)
        if self._buffer is None or j >= len(self._buffer):
            buffer = np.empty((max(FIRST_CAPACITY, 2 * j), *self.shape))
            if self._buffer is not None:
                buffer[: self._packed] = self._buffer[: self._packed]
            self._buffer = buffer
        for number in range(self._packed, j + 1):
            self._buffer[number] = self._terms[number]
        self._packed = max(self._packed, j + 1)
        return self._buffer[: j + 1]

    def sum(self, a: float) -> Array:
        """Σ_j a^j y_j over the coefficients known so far (Horner)."""
        total = np.zeros(self.shape)
        for coefficient in reversed(self._terms):
            total = total * a + coefficient
        return total

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one coefficient."""
        return self._terms[0].shape

    # Linear operations act on every coefficient alike.

    def _linear(self, operation: Callable[[Array], Array]) -> Series:
        return Series._by_rule(lambda j: operation(self.coefficient(j)), self)

    def reshape(self, *shape: int) -> Series:
        """The same numbers in another shape."""
        return self._linear(lambda y: y.reshape(*shape))

    def __getitem__(self, part: Any) -> Series:
        """A part of the numbers, by index or slice; `x, y = u` takes a series apart along its first axis."""
        return self._linear(lambda y: y[part])

    def __rmatmul__(self, matrix: Any) -> Series:
        return self._linear(lambda y: matrix @ y)

    def __matmul__(self, other: Any) -> NoReturn:
        raise NoSeries(
            "a series stands on the right of @ only: write matrix @ u, and np.sum(u * v) for a product of two"
        )

    def __neg__(self) -> Series:
        return self._linear(np.negative)

    def __add__(self, other: Any) -> Series:
        if isinstance(other, Series):
            return Series._by_rule(lambda j: self.coefficient(j) + other.coefficient(j), self, other)
        constant = _constant(other)
        shape = np.broadcast_shapes(self.shape, constant.shape)
        if shape == self.shape:
            return Series._by_rule(lambda j: self.coefficient(j) if j else self.coefficient(0) + constant, self)
        return Series._by_rule(
            lambda j: np.broadcast_to(self.coefficient(j), shape) if j else self.coefficient(0) + constant, self
        )

    __radd__ = __add__

    def __sub__(self, other: Any) -> Series:
        return self + (-other)

    def __rsub__(self, other: Any) -> Series:
        return -self + other

    def __mul__(self, other: Any) -> Series:
        if isinstance(other, Series):
            return _product(self, other)
        constant = _constant(other)
        return self._linear(lambda y: y * constant)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Series:
        if isinstance(other, Series):
            return _quotient(self, other)
        return self * (1.0 / _constant(other))

    def __rtruediv__(self, other: Any) -> Series:
        return _quotient(_constant_series(other), self)

    def __rpow__(self, base: Any) -> NoReturn:
        raise NoSeries("a series can be raised to a constant power only; write exp(y log x) for a varying one")

    def __pow__(self, exponent: Any) -> Series:
        if not isinstance(exponent, Number):
            self.__rpow__(self)
        power = float(exponent)  # type: ignore[arg-type]
        if power == 0.0:  # x⁰ = 1 at x = 0 too, as for arrays
            return _constant_series(np.ones(self.shape))
        if power.is_integer() and power >= 1.0:  # by products, which are analytic at zero too
            half = self if power < 4.0 else self ** (power // 2.0)
            if power == 1.0:
                return self
            square = _product(half, half)
            return square if power % 2.0 == 0.0 else _product(square, self)
        return _power(self, power)

    # What has no Taylor coefficients, or none that are known here.

    __abs__ = _refusal("abs")
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refusal("a comparison")
    __bool__ = _refusal("a choice by condition")
    __float__ = _refusal("float")
    __mod__ = __rmod__ = _refusal("%")
    __floordiv__ = __rfloordiv__ = _refusal("//")
    __hash__ = object.__hash__

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Series:
        formula = _FORMULAS.get(ufunc)
        if ufunc in _NOT_ANALYTIC:
            raise _not_analytic(f"np.{ufunc.__name__}")
        if formula is None or method != "__call__" or options:
            how = f".{method}" if method != "__call__" else f" with {', '.join(options)}" if options else ""
            raise _unknown(f"{ufunc.__name__}{how}")
        return formula(*inputs)

    def __array_function__(self, function: Callable[..., Any], types: Any, inputs: Any, options: Any) -> Series:
        formula = _ARRAY_FORMULAS.get(function)
        if function in _NOT_ANALYTIC:
            raise _not_analytic(f"np.{function.__name__}")
        if formula is None:
            raise _unknown(function.__name__)
        return formula(*inputs, **options)


def as_column(values: ArrayLike, u: Array | Series) -> Array:
    """Constants (U,) as (U, 1, …), to stand beside a u of shape (U, …) in a formula that acts along the first axis."""
    constants = _constant(values)
    return constants.reshape(-1, *[1] * (len(u.shape) - 1))


def _constant(value: Any) -> Array:
    return np.asarray(value, dtype=float)


def _constant_series(value: Any) -> Series:
    start = _constant(value)
    return Series._by_rule(lambda j: start if j == 0 else np.zeros_like(start))


def _convolve(x: Array, y: Array, weights: Array | None = None) -> Array:
    """Σ_l w_l x_l y_{j−l} over the whole of two heads of equal length; w_l = 1 without weights."""
    if weights is None:
        return np.einsum("l...,l...->...", x, y[::-1])
    return np.einsum("l,l...,l...->...", weights, x, y[::-1])


def _derivative_convolve(x: Series, y: Series, j: int) -> Array:
    """(1/j) Σ_{l=1..j} l x_l y_{j−l}: coefficient j of the integral of x′ y."""
    return _convolve(x.head(j)[1:], y.head(j - 1), np.arange(1.0, j + 1.0) / j)


def _product(x: Series, y: Series) -> Series:
    if x is not y:
        return Series._by_rule(lambda j: _convolve(x.head(j), y.head(j)), x, y)

    def square(j: int) -> Array:
        half = (j + 1) // 2  # x_l x_{j−l} appears twice, but for the middle term of an even order
        head = x.head(j)
        total = 2.0 * np.einsum("l...,l...->...", head[:half], head[::-1][:half])
        return total if j % 2 else total + head[half] ** 2

    return Series._by_rule(square, x)


def _quotient(x: Series, y: Series) -> Series:
    def rule(j: int) -> Array:
        start = y.coefficient(0)
        if j == 0:
            return x.coefficient(0) / start
        if j == 1 and not start.all():
            raise NoSeriesHere("1/x", start, start == 0.0, INFINITE)
        return (x.coefficient(j) - _convolve(y.head(j)[1:], q.head(j - 1))) / start

    q = Series._by_rule(rule, x, y)
    return q


def _power(x: Series, exponent: float, function: Callable[[Array], Array] | None = None, name: str = "") -> Series:
    """j x₀ y_j = Σ_{l=1..j} (α l − (j − l)) x_l y_{j−l} for y = x^α, α no whole number ≥ 0.

    At x₀ = 0 the series begins with x_m a^m, so that y = O(a^(α m)): coefficients below α m are zero, and there are no
    further ones, because the derivative of x^α of an order above α is infinite there.

    function, name : x ↦ x^α and its name, where it has one of its own.
    """
    name = name or f"x**{exponent:g}"

    def rule(j: int) -> Array:
        start = x.coefficient(0)
        if j == 0:
            return start**exponent if function is None else function(start)
        slope = x.head(j)[1:]
        sums = _convolve(slope, y.head(j - 1), (exponent + 1.0) / j * np.arange(1.0, j + 1.0) - 1.0)
        at_zero = start == 0.0
        if not at_zero.any():
            if j == 1 and np.isnan(y.coefficient(0)[start < 0.0]).any():
                raise NoSeriesHere(name, start, start < 0.0, UNREAL)
            return sums / start
        first = np.where(slope.any(axis=0), 1 + (slope != 0.0).argmax(axis=0), j + 1)  # m, or more than j
        lost = at_zero & ~(exponent * first > j)
        if lost.any():
            raise NoSeriesHere(name, start, lost, INFINITE if exponent < 0.0 else _steep(ceil(exponent)))
        return np.where(at_zero, 0.0, sums / np.where(at_zero, 1.0, start))

    y = Series._by_rule(rule, x)
    return y


def _steep(order: int) -> str:
    return STEEP if order == 1 else f"its derivative of order {order} is infinite there"


def _from_slope(function: np.ufunc, x: Series, slope_of: Callable[[Series], Series]) -> Series:
    """y = f(x) through y′ = g x′, where g is a series made from y itself."""

    def rule(j: int) -> Array:
        return function(x.coefficient(0)) if j == 0 else _derivative_convolve(x, slope_of_y, j)

    y = Series._by_rule(rule, x)
    slope_of_y = slope_of(y)
    return y


def _inverse_slope(y: Series, g: Series, rest: Array, j: int) -> Array:
    """y_j with coefficient j of ∫ g y′ equal to `rest`:  g₀ y_j = rest − (1/j) Σ_{l=1..j−1} l y_l g_{j−l}."""
    if j > 1:
        rest = rest - _convolve(y.head(j - 1)[1:], g.head(j - 1)[1:], np.arange(1.0, float(j)) / j)
    return rest / g.coefficient(0)


@dataclass(frozen=True)
class _Domain:
    """low < x < high, where a function is analytic; what it is at its ends, in words."""

    low: float
    high: float
    at_ends: str

    def check(self, name: str, x: Array) -> None:
        """Raise NoSeriesHere for an x outside; what is not a number is inside."""
        for where, why in (
            ((x < self.low) | (x > self.high), UNREAL),
            ((x == self.low) | (x == self.high), self.at_ends),
        ):
            if where.any():
                raise NoSeriesHere(name, x, where, why)


def _from_inverse_slope(function: np.ufunc, x: Series, g: Series, domain: _Domain | None = None) -> Series:
    """y = f(x) through g y′ = x′."""

    def rule(j: int) -> Array:
        if j == 0:
            return function(x.coefficient(0))
        if j == 1 and domain is not None:
            domain.check(function.__name__, x.coefficient(0))
        return _inverse_slope(y, g, x.coefficient(j), j)

    y = Series._by_rule(rule, x, g)
    return y


def _sine_and_cosine(x: Series, sine: np.ufunc, cosine: np.ufunc, sign: float) -> tuple[Series, Series]:
    """s′ = c x′,  c′ = ± s x′ : sin x and cos x with sign −1, sinh x and cosh x with sign +1."""

    def of_sine(j: int) -> Array:
        return sine(x.coefficient(0)) if j == 0 else _derivative_convolve(x, c, j)

    def of_cosine(j: int) -> Array:
        return cosine(x.coefficient(0)) if j == 0 else sign * _derivative_convolve(x, s, j)

    s, c = Series._by_rule(of_sine, x), Series._by_rule(of_cosine, x)
    return s, c


def _both(x: Any, y: Any) -> tuple[Series, Series]:
    """Two series of one shape, of which one may have been given as a constant."""
    x, y = (part if isinstance(part, Series) else _constant_series(part) for part in (x, y))
    if x.shape != y.shape:
        shape = np.broadcast_shapes(x.shape, y.shape)
        x, y = (part._linear(lambda c: np.broadcast_to(c, shape)) for part in (x, y))
    return x, y


def _angle(y: Any, x: Any) -> Series:
    """θ = atan2(y, x) through (x² + y²) θ′ = x y′ − y x′; as on arrays it jumps by 2π across y = 0, x < 0."""
    y, x = _both(y, x)
    square = x * x + y * y

    def rule(j: int) -> Array:
        if j == 0:
            return np.arctan2(y.coefficient(0), x.coefficient(0))
        _away_from_origin("arctan2(y, x)", x, y, j)
        return _inverse_slope(theta, square, _derivative_convolve(y, x, j) - _derivative_convolve(x, y, j), j)

    theta = Series._by_rule(rule, y, x, square)
    return theta


def _length(x: Any, y: Any) -> Series:
    """h = √(x² + y²) through h h′ = x x′ + y y′."""
    x, y = _both(x, y)

    def rule(j: int) -> Array:
        if j == 0:
            return np.hypot(x.coefficient(0), y.coefficient(0))
        _away_from_origin("hypot(x, y)", x, y, j)
        return _inverse_slope(h, h, _derivative_convolve(x, x, j) + _derivative_convolve(y, y, j), j)

    h = Series._by_rule(rule, x, y)
    return h


def _away_from_origin(name: str, x: Series, y: Series, j: int) -> None:
    """Raise NoSeriesHere at order 1 where x = y = 0."""
    start = x.coefficient(0)
    if j == 1 and (origin := (start == 0.0) & (y.coefficient(0) == 0.0)).any():
        raise NoSeriesHere(name, start, origin, "its slope there, where y = 0 too, depends on the direction")


def _log_of_sum(function: np.ufunc, exponential: np.ufunc, x: Any, y: Any) -> Series:
    """z = log(eˣ + e^y) through z′ = e^(x−z) x′ + e^(y−z) y′, or the same to the base 2: no exponential overflows."""
    x, y = _both(x, y)

    def rule(j: int) -> Array:
        if j == 0:
            return function(x.coefficient(0), y.coefficient(0))
        return _derivative_convolve(x, of_x, j) + _derivative_convolve(y, of_y, j)

    z = Series._by_rule(rule, x, y)
    of_x, of_y = exponential(x - z), exponential(y - z)
    return z


def _joined(join: Callable[..., Array], parts: Any, axis: int = 0) -> Series:
    """np.stack or np.concatenate of series and constants of equal shapes."""
    series = [part if isinstance(part, Series) else _constant_series(part) for part in parts]
    return Series._by_rule(lambda j: join([part.coefficient(j) for part in series], axis=axis), *series)


_ARRAY_FORMULAS: dict[Callable[..., Any], Callable[..., Series]] = {
    np.sum: lambda x, axis=None: x._linear(lambda y: np.sum(y, axis=axis)),
    np.cumsum: lambda x, axis=None: x._linear(lambda y: np.cumsum(y, axis=axis)),
    np.mean: lambda x, axis=None: x._linear(lambda y: np.mean(y, axis=axis)),
    np.diff: lambda x, n=1, axis=-1: x._linear(lambda y: np.diff(y, n, axis)),
    np.roll: lambda x, shift, axis=None: x._linear(lambda y: np.roll(y, shift, axis)),
    np.flip: lambda x, axis=None: x._linear(lambda y: np.flip(y, axis)),
    np.stack: lambda parts, axis=0: _joined(np.stack, parts, axis),
    np.concatenate: lambda parts, axis=0: _joined(np.concatenate, parts, axis),
}

_POSITIVE = _Domain(0.0, np.inf, INFINITE)
_WITHIN_ONE = _Domain(-1.0, 1.0, STEEP)

_FORMULAS: dict[np.ufunc, Callable[..., Series]] = {
    np.add: lambda x, y: x + y if isinstance(x, Series) else y + x,
    np.subtract: lambda x, y: x - y if isinstance(x, Series) else -y + x,
    np.multiply: lambda x, y: x * y if isinstance(x, Series) else y * x,
    np.divide: lambda x, y: x / y if isinstance(x, Series) else y.__rtruediv__(x),
    np.matmul: lambda matrix, x: x.__rmatmul__(matrix) if isinstance(x, Series) else matrix.__matmul__(x),
    np.positive: lambda x: x,
    np.negative: lambda x: -x,
    np.conjugate: lambda x: x,
    np.reciprocal: lambda x: 1.0 / x,
    np.square: lambda x: x * x,
    np.power: lambda x, exponent: Series.__pow__(x, exponent),
    np.float_power: lambda x, exponent: Series.__pow__(x, exponent),
    np.sqrt: lambda x: _power(x, 0.5, np.sqrt, "sqrt"),
    np.cbrt: lambda x: _power(x, 1.0 / 3.0, np.cbrt, "cbrt"),
    np.hypot: _length,
    np.exp: lambda x: _from_slope(np.exp, x, lambda y: y),
    np.exp2: lambda x: _from_slope(np.exp2, x, lambda y: np.log(2.0) * y),
    np.expm1: lambda x: _from_slope(np.expm1, x, lambda y: y + 1.0),
    np.log: lambda x: _from_inverse_slope(np.log, x, x, _POSITIVE),
    np.log2: lambda x: _from_inverse_slope(np.log2, x, np.log(2.0) * x, _POSITIVE),
    np.log10: lambda x: _from_inverse_slope(np.log10, x, np.log(10.0) * x, _POSITIVE),
    np.log1p: lambda x: _from_inverse_slope(np.log1p, x, x + 1.0, _Domain(-1.0, np.inf, INFINITE)),
    np.logaddexp: lambda x, y: _log_of_sum(np.logaddexp, np.exp, x, y),
    np.logaddexp2: lambda x, y: _log_of_sum(np.logaddexp2, np.exp2, x, y),
    np.sin: lambda x: _sine_and_cosine(x, np.sin, np.cos, -1.0)[0],
    np.cos: lambda x: _sine_and_cosine(x, np.sin, np.cos, -1.0)[1],
    np.tan: lambda x: _from_slope(np.tan, x, lambda y: 1.0 + y * y),
    np.arcsin: lambda x: _from_inverse_slope(np.arcsin, x, np.sqrt((1.0 - x) * (1.0 + x)), _WITHIN_ONE),
    np.arccos: lambda x: _from_inverse_slope(np.arccos, x, -np.sqrt((1.0 - x) * (1.0 + x)), _WITHIN_ONE),
    np.arctan: lambda x: _from_inverse_slope(np.arctan, x, 1.0 + x * x),
    np.arctan2: _angle,
    np.sinh: lambda x: _sine_and_cosine(x, np.sinh, np.cosh, 1.0)[0],
    np.cosh: lambda x: _sine_and_cosine(x, np.sinh, np.cosh, 1.0)[1],
    np.tanh: lambda x: _from_slope(np.tanh, x, lambda y: 1.0 - y * y),
    np.arcsinh: lambda x: _from_inverse_slope(np.arcsinh, x, np.sqrt(1.0 + x * x)),
    np.arccosh: lambda x: _from_inverse_slope(
        np.arccosh, x, np.sqrt((x - 1.0) * (x + 1.0)), _Domain(1.0, np.inf, STEEP)
    ),
    np.arctanh: lambda x: _from_inverse_slope(np.arctanh, x, (1.0 - x) * (1.0 + x), _Domain(-1.0, 1.0, INFINITE)),
    **{scale: (lambda x, scale=scale: x._linear(scale)) for scale in (np.deg2rad, np.radians, np.rad2deg, np.degrees)},
}

_NOT_ANALYTIC: frozenset[Callable[..., Any]] = frozenset(
    (
        *(np.absolute, np.fabs, np.sign, np.signbit, np.copysign, np.heaviside),
        *(np.floor, np.ceil, np.trunc, np.rint, np.round, np.fix, np.remainder, np.fmod, np.floor_divide, np.divmod),
        *(np.maximum, np.minimum, np.fmax, np.fmin, np.max, np.min, np.ptp, np.clip),
        *(np.greater, np.greater_equal, np.less, np.less_equal, np.equal, np.not_equal),
        *(np.logical_and, np.logical_or, np.logical_not, np.logical_xor, np.isfinite, np.isnan, np.isinf),
        *(np.where, np.select, np.piecewise, np.sort, np.argsort, np.argmax, np.argmin, np.any, np.all),
        *(np.median, np.quantile, np.percentile, np.nan_to_num, np.interp),
    )
)
