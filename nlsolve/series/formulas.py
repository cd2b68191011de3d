"""Which formula belongs to which function of numpy; importing this makes `Series` know them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlsolve.series.arithmetic import added, divided, multiplied, power, raised, subtracted
from nlsolve.series.coefficients import ARRAY_FORMULAS, FORMULAS, NOT_ANALYTIC, Formula, Series
from nlsolve.series.elementary import (
    Domain,
    angle,
    from_inverse_slope,
    from_slope,
    joined,
    length,
    log_of_sum,
    sine_and_cosine,
)
from nlsolve.series.refusals import INFINITE, STEEP

__all__ = ["Series"]

WHOLE: dict[Callable[..., Any], Formula] = {
    np.sum: lambda x, axis=None: x.linear(lambda y: np.sum(y, axis=axis)),
    np.cumsum: lambda x, axis=None: x.linear(lambda y: np.cumsum(y, axis=axis)),
    np.mean: lambda x, axis=None: x.linear(lambda y: np.mean(y, axis=axis)),
    np.diff: lambda x, n=1, axis=-1: x.linear(lambda y: np.diff(y, n, axis)),
    np.roll: lambda x, shift, axis=None: x.linear(lambda y: np.roll(y, shift, axis)),
    np.flip: lambda x, axis=None: x.linear(lambda y: np.flip(y, axis)),
    np.stack: lambda parts, axis=0: joined(np.stack, parts, axis),
    np.concatenate: lambda parts, axis=0: joined(np.concatenate, parts, axis),
}

_POSITIVE = Domain(0.0, np.inf, INFINITE)
_WITHIN_ONE = Domain(-1.0, 1.0, STEEP)

ELEMENTWISE: dict[np.ufunc, Formula] = {
    np.add: added,
    np.subtract: subtracted,
    np.multiply: multiplied,
    np.divide: divided,
    np.matmul: lambda matrix, x: x.__rmatmul__(matrix) if isinstance(x, Series) else matrix.__matmul__(x),
    np.positive: lambda x: x,
    np.negative: lambda x: x.linear(np.negative),
    np.conjugate: lambda x: x,
    np.reciprocal: lambda x: 1.0 / x,
    np.square: lambda x: x * x,
    np.power: raised,
    np.float_power: raised,
    np.sqrt: lambda x: power(x, 0.5, np.sqrt, "sqrt"),
    np.cbrt: lambda x: power(x, 1.0 / 3.0, np.cbrt, "cbrt"),
    np.hypot: length,
    np.exp: lambda x: from_slope(np.exp, x, lambda y: y),
    np.exp2: lambda x: from_slope(np.exp2, x, lambda y: np.log(2.0) * y),
    np.expm1: lambda x: from_slope(np.expm1, x, lambda y: y + 1.0),
    np.log: lambda x: from_inverse_slope(np.log, x, x, _POSITIVE),
    np.log2: lambda x: from_inverse_slope(np.log2, x, np.log(2.0) * x, _POSITIVE),
    np.log10: lambda x: from_inverse_slope(np.log10, x, np.log(10.0) * x, _POSITIVE),
    np.log1p: lambda x: from_inverse_slope(np.log1p, x, x + 1.0, Domain(-1.0, np.inf, INFINITE)),
    np.logaddexp: lambda x, y: log_of_sum(np.logaddexp, np.exp, x, y),
    np.logaddexp2: lambda x, y: log_of_sum(np.logaddexp2, np.exp2, x, y),
    np.sin: lambda x: sine_and_cosine(x, np.sin, np.cos, -1.0)[0],
    np.cos: lambda x: sine_and_cosine(x, np.sin, np.cos, -1.0)[1],
    np.tan: lambda x: from_slope(np.tan, x, lambda y: 1.0 + y * y),
    np.arcsin: lambda x: from_inverse_slope(np.arcsin, x, np.sqrt((1.0 - x) * (1.0 + x)), _WITHIN_ONE),
    np.arccos: lambda x: from_inverse_slope(np.arccos, x, -np.sqrt((1.0 - x) * (1.0 + x)), _WITHIN_ONE),
    np.arctan: lambda x: from_inverse_slope(np.arctan, x, 1.0 + x * x),
    np.arctan2: angle,
    np.sinh: lambda x: sine_and_cosine(x, np.sinh, np.cosh, 1.0)[0],
    np.cosh: lambda x: sine_and_cosine(x, np.sinh, np.cosh, 1.0)[1],
    np.tanh: lambda x: from_slope(np.tanh, x, lambda y: 1.0 - y * y),
    np.arcsinh: lambda x: from_inverse_slope(np.arcsinh, x, np.sqrt(1.0 + x * x)),
    np.arccosh: lambda x: from_inverse_slope(np.arccosh, x, np.sqrt((x - 1.0) * (x + 1.0)), Domain(1.0, np.inf, STEEP)),
    np.arctanh: lambda x: from_inverse_slope(np.arctanh, x, (1.0 - x) * (1.0 + x), Domain(-1.0, 1.0, INFINITE)),
    **{scale: (lambda x, scale=scale: x.linear(scale)) for scale in (np.deg2rad, np.radians, np.rad2deg, np.degrees)},
}

FORMULAS.update(ELEMENTWISE)
ARRAY_FORMULAS.update(WHOLE)
NOT_ANALYTIC.update(
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
