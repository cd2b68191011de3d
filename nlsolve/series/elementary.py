"""exp, log, sin, atan2, … of series, each through the differential equation that it solves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nlsolve.series.arithmetic import constant_series, convolve, derivative_convolve
from nlsolve.series.coefficients import Series
from nlsolve.series.refusals import UNREAL, Array, NoSeriesHere


def from_slope(function: np.ufunc, x: Series, slope_of: Callable[[Series], Series]) -> Series:
    """y = f(x) through y′ = g x′, where g is a series made from y itself."""

    def rule(j: int) -> Array:
        return function(x.coefficient(0)) if j == 0 else derivative_convolve(x, slope_of_y, j)

    y = Series.by_rule(rule, x)
    slope_of_y = slope_of(y)
    return y


def inverse_slope(y: Series, g: Series, rest: Array, j: int) -> Array:
    """y_j with coefficient j of ∫ g y′ equal to `rest`:  g₀ y_j = rest − (1/j) Σ_{l=1..j−1} l y_l g_{j−l}."""
    if j > 1:
        rest = rest - convolve(y.head(j - 1)[1:], g.head(j - 1)[1:], np.arange(1.0, float(j)) / j)
    return rest / g.coefficient(0)


@dataclass(frozen=True)
class Domain:
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


def from_inverse_slope(function: np.ufunc, x: Series, g: Series, domain: Domain | None = None) -> Series:
    """y = f(x) through g y′ = x′."""

    def rule(j: int) -> Array:
        if j == 0:
            return function(x.coefficient(0))
        if j == 1 and domain is not None:
            domain.check(function.__name__, x.coefficient(0))
        return inverse_slope(y, g, x.coefficient(j), j)

    y = Series.by_rule(rule, x, g)
    return y


def sine_and_cosine(x: Series, sine: np.ufunc, cosine: np.ufunc, sign: float) -> tuple[Series, Series]:
    """s′ = c x′,  c′ = ± s x′ : sin x and cos x with sign −1, sinh x and cosh x with sign +1."""

    def of_sine(j: int) -> Array:
        return sine(x.coefficient(0)) if j == 0 else derivative_convolve(x, c, j)

    def of_cosine(j: int) -> Array:
        return cosine(x.coefficient(0)) if j == 0 else sign * derivative_convolve(x, s, j)

    s, c = Series.by_rule(of_sine, x), Series.by_rule(of_cosine, x)
    return s, c


def both(x: Any, y: Any) -> tuple[Series, Series]:
    """Two series of one shape, of which one may have been given as a constant."""
    x, y = (part if isinstance(part, Series) else constant_series(part) for part in (x, y))
    if x.shape != y.shape:
        shape = np.broadcast_shapes(x.shape, y.shape)
        x, y = (part.linear(lambda c: np.broadcast_to(c, shape)) for part in (x, y))
    return x, y


def angle(y: Any, x: Any) -> Series:
    """θ = atan2(y, x) through (x² + y²) θ′ = x y′ − y x′; as on arrays it jumps by 2π across y = 0, x < 0."""
    y, x = both(y, x)
    square = x * x + y * y

    def rule(j: int) -> Array:
        if j == 0:
            return np.arctan2(y.coefficient(0), x.coefficient(0))
        away_from_origin("arctan2(y, x)", x, y, j)
        return inverse_slope(theta, square, derivative_convolve(y, x, j) - derivative_convolve(x, y, j), j)

    theta = Series.by_rule(rule, y, x, square)
    return theta


def length(x: Any, y: Any) -> Series:
    """h = √(x² + y²) through h h′ = x x′ + y y′."""
    x, y = both(x, y)

    def rule(j: int) -> Array:
        if j == 0:
            return np.hypot(x.coefficient(0), y.coefficient(0))
        away_from_origin("hypot(x, y)", x, y, j)
        return inverse_slope(h, h, derivative_convolve(x, x, j) + derivative_convolve(y, y, j), j)

    h = Series.by_rule(rule, x, y)
    return h


def away_from_origin(name: str, x: Series, y: Series, j: int) -> None:
    """Raise NoSeriesHere at order 1 where x = y = 0."""
    start = x.coefficient(0)
    if j == 1 and (origin := (start == 0.0) & (y.coefficient(0) == 0.0)).any():
        raise NoSeriesHere(name, start, origin, "its slope there, where y = 0 too, depends on the direction")


def log_of_sum(function: np.ufunc, exponential: np.ufunc, x: Any, y: Any) -> Series:
    """z = log(eˣ + e^y) through z′ = e^(x−z) x′ + e^(y−z) y′, or the same to the base 2: no exponential overflows."""
    x, y = both(x, y)

    def rule(j: int) -> Array:
        if j == 0:
            return function(x.coefficient(0), y.coefficient(0))
        return derivative_convolve(x, of_x, j) + derivative_convolve(y, of_y, j)

    z = Series.by_rule(rule, x, y)
    of_x, of_y = exponential(x - z), exponential(y - z)
    return z


def joined(join: Callable[..., Array], parts: Any, axis: int = 0) -> Series:
    """np.stack or np.concatenate of series and constants of equal shapes."""
    series = [part if isinstance(part, Series) else constant_series(part) for part in parts]
    return Series.by_rule(lambda j: join([part.coefficient(j) for part in series], axis=axis), *series)
