"""Sums, products, quotients and powers of series, by convolution: O(j) operations for coefficient j."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from numbers import Number
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nlsolve.series.coefficients import Series
from nlsolve.series.refusals import INFINITE, STEEP, UNREAL, Array, NoSeries, NoSeriesHere


def as_column(values: ArrayLike, u: Array | Series) -> Array:
    """Constants (U,) as (U, 1, …), to stand beside a u of shape (U, …) in a formula that acts along the first axis."""
    constants = constant(values)
    return constants.reshape(-1, *[1] * (len(u.shape) - 1))


def constant(value: Any) -> Array:
    """The numbers of a constant."""
    return np.asarray(value, dtype=float)


def constant_series(value: Any) -> Series:
    """c + 0 a + 0 a² + …"""
    start = constant(value)
    return Series.by_rule(lambda j: start if j == 0 else np.zeros_like(start))


def added(x: Any, y: Any) -> Series:
    """x + y, of which one may be a constant."""
    if isinstance(x, Series) and isinstance(y, Series):
        return Series.by_rule(lambda j: x.coefficient(j) + y.coefficient(j), x, y)
    series, other = (x, constant(y)) if isinstance(x, Series) else (y, constant(x))
    shape = np.broadcast_shapes(series.shape, other.shape)
    if shape == series.shape:
        return Series.by_rule(lambda j: series.coefficient(j) if j else series.coefficient(0) + other, series)
    return Series.by_rule(
        lambda j: np.broadcast_to(series.coefficient(j), shape) if j else series.coefficient(0) + other, series
    )


def subtracted(x: Any, y: Any) -> Series:
    """x − y, of which one may be a constant."""
    if not isinstance(y, Series):
        return added(x, -constant(y))
    if isinstance(x, Series):
        return Series.by_rule(lambda j: x.coefficient(j) - y.coefficient(j), x, y)
    start = constant(x)
    if np.broadcast_shapes(y.shape, start.shape) != y.shape:
        return added(-y, start)
    return Series.by_rule(lambda j: -y.coefficient(j) if j else start - y.coefficient(0), y)


def multiplied(x: Any, y: Any) -> Series:
    """x y, of which one may be a constant."""
    if isinstance(x, Series) and isinstance(y, Series):
        return product(x, y)
    series, factor = (x, constant(y)) if isinstance(x, Series) else (y, constant(x))
    return series.linear(lambda coefficient: coefficient * factor)


def divided(x: Any, y: Any) -> Series:
    """x/y, of which one may be a constant."""
    if not isinstance(y, Series):
        return multiplied(x, 1.0 / constant(y))
    return quotient(x if isinstance(x, Series) else constant_series(x), y)


def raised(x: Any, exponent: Any) -> Series:
    """x^α for a constant α."""
    if not isinstance(x, Series) or not isinstance(exponent, Number):
        raise NoSeries("a series can be raised to a constant power only; write exp(y log x) for a varying one")
    alpha = float(exponent)  # type: ignore[arg-type]
    if alpha == 0.0:  # x⁰ = 1 at x = 0 too, as for arrays
        return constant_series(np.ones(x.shape))
    if alpha.is_integer() and alpha >= 1.0:  # by products, which are analytic at zero too
        half = x if alpha < 4.0 else raised(x, alpha // 2.0)
        if alpha == 1.0:
            return x
        square = product(half, half)
        return square if alpha % 2.0 == 0.0 else product(square, x)
    return power(x, alpha)


def convolve(x: Array, y: Array, weights: Array | None = None) -> Array:
    """Σ_l w_l x_l y_{j−l} over the whole of two heads of equal length; w_l = 1 without weights."""
    if weights is None:
        return np.einsum("l...,l...->...", x, y[::-1])
    return np.einsum("l,l...,l...->...", weights, x, y[::-1])


def derivative_convolve(x: Series, y: Series, j: int) -> Array:
    """(1/j) Σ_{l=1..j} l x_l y_{j−l}: coefficient j of the integral of x′ y."""
    return convolve(x.head(j)[1:], y.head(j - 1), np.arange(1.0, j + 1.0) / j)


def product(x: Series, y: Series) -> Series:
    """z_j = Σ_l x_l y_{j−l}, a square at half the price."""
    if x is not y:
        return Series.by_rule(lambda j: convolve(x.head(j), y.head(j)), x, y)

    def square(j: int) -> Array:
        half = (j + 1) // 2  # x_l x_{j−l} appears twice, but for the middle term of an even order
        head = x.head(j)
        total = convolve(head[:half], head[j + 1 - half :])
        total *= 2.0
        if j % 2 == 0:
            total += head[half] ** 2
        return total

    return Series.by_rule(square, x)


def quotient(x: Series, y: Series) -> Series:
    """q = x/y:  y₀ q_j = x_j − Σ_{l=1..j} y_l q_{j−l}."""

    def rule(j: int) -> Array:
        start = y.coefficient(0)
        if j == 0:
            return x.coefficient(0) / start
        if j == 1 and not start.all():
            raise NoSeriesHere("1/x", start, start == 0.0, INFINITE)
        return (x.coefficient(j) - convolve(y.head(j)[1:], q.head(j - 1))) / start

    q = Series.by_rule(rule, x, y)
    return q


def power(x: Series, exponent: float, function: Callable[[Array], Array] | None = None, name: str = "") -> Series:
    """j x₀ y_j = Σ_{l=1..j} (α l − (j − l)) x_l y_{j−l} for y = x^α, α no whole number ≥ 0.

    At x₀ = 0 the series begins with x_m a^m, so that y = O(a^(α m)): coefficients below α m are zero, and there are no
    further ones, because the derivative of x^α of an order above α is infinite there.

    function, name : x ↦ x^α and its name, where it has one of its own.
    """
    name, start = name or f"x**{exponent:g}", x.coefficient(0)
    at_zero = start == 0.0
    any_at_zero = bool(at_zero.any())

    def rule(j: int) -> Array:
        if j == 0:
            return start**exponent if function is None else function(start)
        slope = x.head(j)[1:]
        sums = convolve(slope, y.head(j - 1), (exponent + 1.0) / j * np.arange(1.0, j + 1.0) - 1.0)
        if not any_at_zero:
            if j == 1 and np.isnan(y.coefficient(0)[start < 0.0]).any():
                raise NoSeriesHere(name, start, start < 0.0, UNREAL)
            return sums / start
        first = np.where(slope.any(axis=0), 1 + (slope != 0.0).argmax(axis=0), j + 1)  # m, or more than j
        lost = at_zero & ~(exponent * first > j)
        if lost.any():
            raise NoSeriesHere(name, start, lost, INFINITE if exponent < 0.0 else steep(ceil(exponent)))
        return np.where(at_zero, 0.0, sums / np.where(at_zero, 1.0, start))

    y = Series.by_rule(rule, x)
    return y


def steep(order: int) -> str:
    """Why there is no further coefficient where the derivative of an order is infinite."""
    return STEEP if order == 1 else f"its derivative of order {order} is infinite there"
