"""Every analytic function of NumPy on a series: against differences, against known functions, and where it ends.

Mathematics against mathematics: the values of the same function on arrays, inverse functions, and identities.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlsolve.plugin import NoSeries, NoSeriesHere, Series
from nlsolve.series import Array

ORDER = 12

ANYWHERE, POSITIVE, WITHIN_ONE, ABOVE_ONE = (-2.0, 2.0), (0.3, 3.0), (-0.8, 0.8), (1.3, 3.0)
FUNCTIONS: dict[np.ufunc, tuple[float, float]] = {
    np.positive: ANYWHERE,
    np.negative: ANYWHERE,
    np.conjugate: ANYWHERE,
    np.reciprocal: POSITIVE,
    np.square: ANYWHERE,
    np.sqrt: POSITIVE,
    np.cbrt: (-3.0, -0.3),
    np.exp: ANYWHERE,
    np.exp2: ANYWHERE,
    np.expm1: ANYWHERE,
    np.log: POSITIVE,
    np.log2: POSITIVE,
    np.log10: POSITIVE,
    np.log1p: (-0.7, 2.0),
    np.sin: ANYWHERE,
    np.cos: ANYWHERE,
    np.tan: (-1.0, 1.0),
    np.arcsin: WITHIN_ONE,
    np.arccos: WITHIN_ONE,
    np.arctan: ANYWHERE,
    np.sinh: ANYWHERE,
    np.cosh: ANYWHERE,
    np.tanh: ANYWHERE,
    np.arcsinh: ANYWHERE,
    np.arccosh: ABOVE_ONE,
    np.arctanh: WITHIN_ONE,
    np.deg2rad: ANYWHERE,
    np.radians: ANYWHERE,
    np.rad2deg: ANYWHERE,
    np.degrees: ANYWHERE,
}
OF_TWO = (np.hypot, np.arctan2, np.logaddexp, np.logaddexp2)


def path(*terms: Any, order: int = ORDER) -> Series:
    """The polynomial of these coefficients, known to an order."""
    first, *rest = (np.asarray(term, dtype=float) for term in terms)
    x = Series(first)
    for j in range(order):
        x.append(rest[j] if j < len(rest) else np.zeros_like(first))
    return x


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_the_derivative_is_that_of_central_differences(function: np.ufunc) -> None:
    x, h = np.linspace(*FUNCTIONS[function], 7), 1e-5
    difference = (function(x + h) - function(x - h)) / (2.0 * h)
    np.testing.assert_allclose(function(Series.seed(x)).coefficient(1), difference, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
@given(part=st.floats(0.0, 1.0), bend=st.floats(-1.0, 1.0))
def test_the_series_sums_to_the_function_along_a_bent_path(function: np.ufunc, part: float, bend: float) -> None:
    low, high = FUNCTIONS[function]
    x = path([low + part * (high - low)], [0.5], [bend])
    y = function(x)
    y.coefficient(ORDER)
    a = 0.02
    np.testing.assert_allclose(y.sum(a), function(x.sum(a)), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(y.coefficient(0), function(x.coefficient(0)))


@pytest.mark.parametrize("function", OF_TWO, ids=lambda function: function.__name__)
@given(x=st.floats(-3.0, 3.0), y=st.floats(0.5, 3.0))
def test_functions_of_two_series_and_of_a_series_and_a_number(function: np.ufunc, x: float, y: float) -> None:
    first, second, a = path([x], [0.5], [-0.2]), path([y], [-0.3], [0.1]), 0.02
    for left, right in ((first, second), (first, y), (x, second)):
        z = function(left, right)
        z.coefficient(ORDER)
        left, right = (part.sum(a) if isinstance(part, Series) else part for part in (left, right))
        np.testing.assert_allclose(z.sum(a), function(left, right), rtol=1e-12, atol=1e-12)


def test_the_log_of_a_sum_of_exponentials_overflows_nowhere() -> None:
    """d log(eˣ + e^y)/dx is 1 where x is far above y, and 0 where it is far below, though eˣ is infinite."""
    slopes = np.logaddexp(Series.seed([1e4, -1e4]), 0.0).coefficient(1)
    np.testing.assert_array_equal(slopes, [1.0, 0.0])


INVERSES: list[tuple[np.ufunc, np.ufunc, tuple[float, float]]] = [
    (np.exp2, np.log2, POSITIVE),
    (np.expm1, np.log1p, (-0.7, 2.0)),
    (np.exp, np.log, POSITIVE),
    (np.tan, np.arctan, ANYWHERE),
    (np.sin, np.arcsin, WITHIN_ONE),
    (np.cos, np.arccos, WITHIN_ONE),
    (np.cosh, np.arccosh, ABOVE_ONE),
    (np.tanh, np.arctanh, WITHIN_ONE),
]


@pytest.mark.parametrize(
    ("function", "inverse", "interval"), INVERSES, ids=lambda value: getattr(value, "__name__", "")
)
@given(part=st.floats(0.0, 1.0))
def test_inverses_composed_are_the_identity(
    function: np.ufunc, inverse: np.ufunc, interval: tuple[float, float], part: float
) -> None:
    x = path([interval[0] + part * (interval[1] - interval[0])], [0.2], [0.1], [-0.1], order=8)
    np.testing.assert_allclose(function(inverse(x)).head(8), x.head(8), rtol=0.0, atol=1e-9)


def test_the_small_is_not_lost_in_functions_made_for_it() -> None:
    x = Series.seed([1e-18])
    assert np.expm1(x).coefficient(0)[0] == np.log1p(x).coefficient(0)[0] == 1e-18


# Powers at zero.


@pytest.mark.parametrize("start", [0.0, -0.0, 1.5, -2.0])
def test_the_zeroth_power_is_one_everywhere(start: float) -> None:
    y = path([start], [1.0]) ** 0
    np.testing.assert_array_equal(y.head(ORDER)[:, 0], [1.0, *[0.0] * ORDER])


@given(st.integers(1, 9), st.floats(-2.0, 2.0))
def test_whole_powers_at_zero_are_those_of_polynomials(exponent: int, slope: float) -> None:
    y = path([0.0], [slope], [1.0]) ** exponent
    expected = np.polynomial.Polynomial([0.0, slope, 1.0]) ** exponent
    known = np.append(expected.coef, np.zeros(ORDER + 1))[: ORDER + 1]
    np.testing.assert_allclose(y.head(ORDER)[:, 0], known, rtol=1e-12, atol=1e-12)


@given(st.floats(1.001, 5.0), st.sampled_from([1.0, -1.0]))
def test_a_power_above_one_has_its_derivatives_at_zero_up_to_its_order(exponent: float, slope: float) -> None:
    """x^α = o(x^j) for j < α: coefficient j is zero, and there is none for j > α."""
    if exponent.is_integer():
        exponent += 0.5
    x = path([0.0, 1.0], [slope, slope])
    y = x**exponent
    for j in range(1, int(exponent) + 1):
        assert y.coefficient(j)[0] == 0.0
        np.testing.assert_allclose(y.coefficient(j)[1], (path([1.0], [slope]) ** exponent).coefficient(j)[0])
    with pytest.raises(
        NoSeriesHere, match=r"x\*\*[\d.]+ has no power series at x = 0 \(entry 0\): its derivative of order"
    ):
        y.coefficient(int(exponent) + 1)


@given(st.floats(0.51, 3.0))
def test_a_power_of_a_square_is_as_flat_as_twice_the_power(exponent: float) -> None:
    """(u²)^α = |u|^(2α) is differentiable at u = 0 for α > 1/2, its derivative is zero there."""
    u = Series.seed([0.0])
    assert ((u * u) ** exponent).coefficient(1)[0] == 0.0


# Where a function ends: the value, the place and the reason.

ENDS: list[tuple[Callable[[Any], Any], float, str]] = [
    (np.sqrt, 0.0, "sqrt has no power series at x = 0: its slope is infinite there"),
    (np.sqrt, -2.0, "sqrt has no power series at x = -2: it has no real value there"),
    (np.cbrt, 0.0, "cbrt has no power series at x = 0: its slope is infinite there"),
    (lambda x: x**0.3, 0.0, "x**0.3 has no power series at x = 0: its slope is infinite there"),
    (lambda x: x**-0.3, 0.0, "x**-0.3 has no power series at x = 0: it is infinite there"),
    (lambda x: x**-2, 0.0, "x**-2 has no power series at x = 0: it is infinite there"),
    (lambda x: x**1.5, -1.0, "x**1.5 has no power series at x = -1: it has no real value there"),
    (lambda x: 1.0 / x, 0.0, "1/x has no power series at x = 0: it is infinite there"),
    (np.reciprocal, 0.0, "1/x has no power series at x = 0: it is infinite there"),
    (lambda x: x / x, 0.0, "1/x has no power series at x = 0: it is infinite there"),
    (np.log, 0.0, "log has no power series at x = 0: it is infinite there"),
    (np.log2, 0.0, "log2 has no power series at x = 0: it is infinite there"),
    (np.log10, -1.0, "log10 has no power series at x = -1: it has no real value there"),
    (np.log1p, -1.0, "log1p has no power series at x = -1: it is infinite there"),
    (np.arcsin, 1.0, "arcsin has no power series at x = 1: its slope is infinite there"),
    (np.arccos, -1.0, "arccos has no power series at x = -1: its slope is infinite there"),
    (np.arccos, 2.0, "arccos has no power series at x = 2: it has no real value there"),
    (np.arccosh, 1.0, "arccosh has no power series at x = 1: its slope is infinite there"),
    (np.arccosh, 0.0, "arccosh has no power series at x = 0: it has no real value there"),
    (np.arctanh, -1.0, "arctanh has no power series at x = -1: it is infinite there"),
    (lambda x: np.hypot(x, 0.0), 0.0, "hypot(x, y) has no power series at x = 0: its slope there, where y = 0 too, "),
    (
        lambda x: np.arctan2(0.0, x),
        0.0,
        "arctan2(y, x) has no power series at x = 0: its slope there, where y = 0 too, ",
    ),
    (lambda x: np.sqrt(x * x) * x, 0.0, "sqrt has no power series at x = 0: its slope is infinite there"),
]


@pytest.mark.parametrize(("function", "value", "sentence"), ENDS, ids=[sentence for _, _, sentence in ENDS])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_where_a_function_ends_its_value_stands_and_its_slope_is_refused_by_name(
    function: Callable[[Any], Any], value: float, sentence: str
) -> None:
    y = function(Series.seed(np.array([value])))
    np.testing.assert_array_equal(y.coefficient(0), function(np.array([value])))
    for _ in range(2):  # asked again, the answer is the same
        with pytest.raises(NoSeriesHere) as refusal:
            y.coefficient(1)
        assert str(refusal.value).startswith(sentence)
    assert isinstance(refusal.value, NoSeries)


@pytest.mark.parametrize("shape", [(4,), (2, 2)])
def test_the_entry_is_named_among_many(shape: tuple[int, ...]) -> None:
    entry = np.unravel_index(2, shape)
    with pytest.raises(NoSeriesHere) as refusal:
        np.sqrt(Series.seed(np.array([4.0, 1.0, 0.0, 0.0]).reshape(shape))).coefficient(1)
    assert refusal.value.entry == tuple(map(int, entry))
    assert f"(entry {', '.join(map(str, refusal.value.entry))})" in str(refusal.value)


def test_what_is_not_a_number_is_no_place_to_name() -> None:
    """A value that was lost before is passed on, as on arrays."""
    x: Array = np.array([np.nan])
    for function in (np.sqrt, np.log, np.arcsin, lambda x: 1.0 / x, lambda x: x**1.5):
        assert np.isnan(function(Series.seed(x)).coefficient(1)).all()
