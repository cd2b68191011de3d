"""Truncated power series: closed forms, algebra, cost, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import comb, factorial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nlsolve.plugin import NoSeries, Series, as_column
from nlsolve.series import Array, arithmetic, elementary

ORDER = 30
J = np.arange(ORDER + 1)


def line(start: float, slope: float = 1.0, order: int = ORDER) -> Series:
    """x(a) = start + slope a, of shape (1,)."""
    x = Series([start])
    for coefficient in (slope, *[0.0] * (order - 1)):
        x.append([coefficient])
    return x


def coefficients(y: Series, order: int = ORDER) -> Array:
    return y.head(order)[:, 0]


def binomials(exponent: float) -> Array:
    """(1 + a)^α = Σ α (α−1) … (α−j+1)/j! a^j."""
    return np.cumprod([1.0, *[(exponent - j) / (j + 1.0) for j in range(ORDER)]])


FACTORIALS = np.array([1.0 / factorial(int(j)) for j in J])
CLOSED: dict[str, tuple[Callable[[], Series], Array]] = {
    "exp a": (lambda: np.exp(line(0.0)), FACTORIALS),
    "exp (1 + 2 a)": (lambda: np.exp(line(1.0, 2.0)), np.e * 2.0**J * FACTORIALS),
    "log (1 + a)": (lambda: np.log(line(1.0)), np.array([0.0, *[(-1.0) ** (j + 1) / j for j in J[1:]]])),
    "sqrt (1 + a)": (lambda: np.sqrt(line(1.0)), binomials(0.5)),
    "(1 + a)^-0.4338": (lambda: line(1.0) ** -0.4338, binomials(-0.4338)),
    "(1 + a)^3": (lambda: line(1.0) ** 3, np.array([comb(3, j) for j in J], dtype=float)),
    "(2 + a)^0.7": (lambda: line(2.0) ** 0.7, 2.0**0.7 * binomials(0.7) * 0.5**J),
    "sin a": (lambda: np.sin(line(0.0)), FACTORIALS * (J % 2) * (-1.0) ** (J // 2)),
    "cos a": (lambda: np.cos(line(0.0)), FACTORIALS * (1 - J % 2) * (-1.0) ** (J // 2)),
    "sin (1 + 2 a)": (
        lambda: np.sin(line(1.0, 2.0)),
        2.0**J * FACTORIALS * np.array([np.sin(1.0), np.cos(1.0), -np.sin(1.0), -np.cos(1.0)])[J % 4],
    ),
    "sinh a": (lambda: np.sinh(line(0.0)), FACTORIALS * (J % 2)),
    "cosh a": (lambda: np.cosh(line(0.0)), FACTORIALS * (1 - J % 2)),
    "1/(1 − a)": (lambda: 1.0 / (1.0 - line(0.0)), np.ones(ORDER + 1)),
    "(1 + a)/(1 − a)": (lambda: (1.0 + line(0.0)) / (1.0 - line(0.0)), np.where(J == 0, 1.0, 2.0)),
    "1/(1 − a) · 1/(1 − a)": (lambda: (1.0 / line(1.0, -1.0)) * (1.0 / line(1.0, -1.0)), J + 1.0),
    "1/(1 − a)²": (lambda: (1.0 / line(1.0, -1.0)) ** 2, J + 1.0),
    "exp a · exp 2a": (lambda: np.exp(line(0.0)) * np.exp(line(0.0, 2.0)), 3.0**J * FACTORIALS),
    "atan2(a, 1)": (
        lambda: np.arctan2(line(0.0), 1.0),
        np.array([(j % 2) * (-1.0) ** (j // 2) / max(j, 1) for j in J.tolist()]),
    ),
    "atan2(sin 2a, cos 2a)": (
        lambda: np.arctan2(np.sin(line(0.0, 2.0)), np.cos(line(0.0, 2.0))),
        np.where(J == 1, 2.0, 0.0),
    ),
    "atan2(1, a)": (
        lambda: np.arctan2(1.0, line(0.0)),
        np.array([np.pi / 2.0, *[-(j % 2) * (-1.0) ** (j // 2) / j for j in J[1:].tolist()]]),
    ),
    # asinh a = Σ (−1)^i (2i)!/(4^i i!² (2i + 1)) a^(2i+1)
    "asinh a": (
        lambda: np.arcsinh(line(0.0)),
        np.array(
            [
                (j % 2) * (-1.0) ** (j // 2) * comb(2 * (j // 2), j // 2) / 4.0 ** (j // 2) / max(j, 1)
                for j in J.tolist()
            ]
        ),
    ),
}


@pytest.mark.parametrize("name", CLOSED)
def test_coefficients_equal_the_closed_form(name: str) -> None:
    formula, expected = CLOSED[name]
    np.testing.assert_allclose(coefficients(formula()), expected, rtol=1e-12, atol=1e-15 * np.abs(expected).max())


def test_what_is_appended_is_kept_as_it_was() -> None:
    """A method may go on to use the arrays it has pushed, in place."""
    start, slope = np.ones(2), np.ones(2)
    x = Series(start)
    x.append(slope)
    start += 1.0
    slope += 1.0
    np.testing.assert_array_equal(x.head(1), np.ones((2, 2)))


def test_tanh_by_its_bernoulli_numbers() -> None:
    """tanh a = Σ 2^(2m) (2^(2m) − 1) B_2m/(2m)! a^(2m−1); B by its recurrence, in whole numbers over whole numbers."""
    bernoulli = [Fraction(1)]
    for m in range(1, ORDER + 2):
        bernoulli.append(-sum((comb(m + 1, k) * bernoulli[k] for k in range(m)), Fraction(0)) / (m + 1))
    expected = np.zeros(ORDER + 1)
    for j in range(1, ORDER + 1, 2):
        expected[j] = float(2 ** (j + 1) * (2 ** (j + 1) - 1) * bernoulli[j + 1] / factorial(j + 1))
    np.testing.assert_allclose(coefficients(np.tanh(line(0.0))), expected, rtol=1e-12, atol=1e-16)


def test_a_formula_of_many_parts_sums_to_its_value() -> None:
    """Σ a^j y_j = f(x(a)) for a function that uses every operation."""

    def f(x: Any) -> Any:
        return (
            np.tanh(x) * np.sqrt(1.0 + x * x) / np.exp(-x) + np.arcsinh(x) ** 2 - np.cosh(x) / (2.0 + np.log(x)) + 3 / x
        ) * np.cos(2.0 * x) - np.sin(x)

    x = Series([1.3, 2.0])
    y = f(x)
    for j in range(1, ORDER + 1):
        x.append(np.array([0.3, -0.2]) / j**2)
        y.coefficient(j)
    np.testing.assert_allclose(y.sum(0.25), f(x.sum(0.25)), rtol=1e-13)


def test_the_matrix_the_reshape_and_the_constants_act_on_every_coefficient() -> None:
    x = Series([1.0, 2.0])
    x.append([3.0, 5.0])
    matrix = np.array([[1.0, 2.0], [0.0, 1.0], [1.0, 1.0]])
    np.testing.assert_array_equal((matrix @ x).head(1), [[5.0, 2.0, 3.0], [13.0, 5.0, 8.0]])
    np.testing.assert_array_equal(x.reshape(2, 1).coefficient(1), [[3.0], [5.0]])
    np.testing.assert_array_equal((np.array([1.0, 1.0]) - x).head(1), [[0.0, -1.0], [-3.0, -5.0]])
    np.testing.assert_array_equal((np.array([2.0, 3.0]) * x / 2.0).head(1), [[1.0, 3.0], [3.0, 7.5]])
    np.testing.assert_array_equal((-x + x).head(1), np.zeros((2, 2)))
    assert x.shape == (2,)


def test_parts_sums_and_joins_act_on_every_coefficient() -> None:
    x = Series([1.0, 2.0, 4.0])
    x.append([3.0, 5.0, 7.0])
    np.testing.assert_array_equal(x[1:].head(1), [[2.0, 4.0], [5.0, 7.0]])
    np.testing.assert_array_equal(x[::2].head(1), [[1.0, 4.0], [3.0, 7.0]])
    np.testing.assert_array_equal(x[:, None].coefficient(1), [[3.0], [5.0], [7.0]])
    a, b, c = x  # along the first axis
    assert (a.shape, float(b.coefficient(1)), float(c.coefficient(0))) == ((), 5.0, 4.0)
    np.testing.assert_array_equal(np.sum(x).head(1), [7.0, 15.0])
    np.testing.assert_array_equal(np.cumsum(x, axis=0).head(1), [[1.0, 3.0, 7.0], [3.0, 8.0, 15.0]])
    np.testing.assert_array_equal(np.stack([b, 9.0, a]).head(1), [[2.0, 9.0, 1.0], [5.0, 0.0, 3.0]])
    np.testing.assert_array_equal(np.stack([x, np.ones(3)], axis=1).coefficient(1)[:, 1], np.zeros(3))
    np.testing.assert_array_equal(np.concatenate([x[2:], np.ones(1)]).head(1), [[4.0, 1.0], [7.0, 0.0]])
    with pytest.raises(IndexError):
        x[3]


def test_a_formula_on_parts_sums_to_its_value() -> None:
    """Σ a^j F_j = F(u(a)) for a formula of parts, sums and joins, on columns."""

    def f(u: Any) -> Any:
        x, y, z = u
        angle = np.arctan2(-x, y) * np.sum(u, axis=0)
        rest = np.cumsum(u * as_column([1.0, 2.0, 3.0], u), axis=0)[1:] * z
        return np.concatenate([np.stack([angle]), rest])

    u = Series(np.array([[1.3, -0.4], [2.0, 1.0], [0.5, -1.5]]))
    for j in range(1, ORDER + 1):
        u.append(np.array([[0.3, -0.2], [0.1, 0.2], [-0.3, 0.1]]) / j**2)
    value = f(u)
    value.coefficient(ORDER)
    np.testing.assert_allclose(value.sum(0.25), f(u.sum(0.25)), rtol=1e-12)


def test_columns_of_seeds_are_columns_of_the_jacobian() -> None:
    u = Series(np.repeat([[1.0], [2.0]], 2, axis=1))
    u.append(np.eye(2))
    x, y = u
    np.testing.assert_array_equal(np.stack([x * y, x + y**3]).coefficient(1), [[2.0, 1.0], [1.0, 12.0]])


def test_constants_as_a_column_stand_beside_columns() -> None:
    assert as_column([1.0, 2.0], np.zeros(2)).shape == (2,)
    assert as_column([1.0, 2.0], Series(np.zeros((2, 5)))).shape == (2, 1)


# Algebra, for any positive series.

paths = arrays(float, (6, 3), elements=st.floats(-1.0, 1.0, width=32)).map(
    lambda c: np.concatenate([1.0 + np.abs(c[:1]), c[1:]])
)


def pushed(c: Array) -> Series:
    x = Series(c[0])
    for coefficient in c[1:]:
        x.append(coefficient)
    return x


def close(found: Series, expected: Series) -> None:
    a, b = found.head(5), expected.head(5)
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-10 * max(1.0, float(np.abs(b).max())))


@given(paths, paths)
def test_a_product_over_one_factor_is_the_other(c: Array, d: Array) -> None:
    x, y = pushed(c), pushed(d)
    close((x * y) / y, x)


@given(paths, st.floats(-3.0, 3.0))
def test_powers_add(c: Array, a: float) -> None:
    x = pushed(c)
    close(x**a * x ** (1.0 - a), x)


@given(paths)
def test_functions_and_their_inverses(c: Array) -> None:
    x = pushed(c)
    close(np.exp(np.log(x)), x)
    close(np.sqrt(x) ** 2, x)
    close(np.sinh(np.arcsinh(x)), x)
    close(np.sinh(x) / np.cosh(x), np.tanh(x))
    close(np.cosh(x) ** 2 - np.sinh(x) ** 2, x - x + 1.0)
    close(np.cos(x) ** 2 + np.sin(x) ** 2, x - x + 1.0)
    close(2.0 * np.sin(x) * np.cos(x), np.sin(2.0 * x))


FORMULAS: list[Callable[[Any], Any]] = [
    lambda x: x**-0.43,
    lambda x: np.exp(-x) / x,
    lambda x: np.arcsinh(3.0 * x) / np.sqrt(x),
    lambda x: np.tanh(x) + np.log(x) * np.sinh(x) - np.cosh(x),
    lambda x: np.sin(x * x) / (2.0 + np.cos(x)),
]


@pytest.mark.parametrize("number", range(len(FORMULAS)))
@given(arrays(float, 4, elements=st.floats(0.5, 3.0)))
def test_a_seeded_series_carries_the_derivative(number: int, x: Array) -> None:
    f, h = FORMULAS[number], 1e-5
    difference = (f(x + h) - f(x - h)) / (2.0 * h)
    np.testing.assert_allclose(f(Series.seed(x)).coefficient(1), difference, rtol=1e-8, atol=1e-8)


# Cost.


def test_order_p_costs_p_operations_so_that_p_orders_cost_p_squared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted in coefficients that enter convolutions: twice the order, at most four times the products in all."""
    terms = 0
    convolve = arithmetic.convolve

    def counted(x: Array, y: Array, *weights: Array) -> Array:
        nonlocal terms
        terms += len(x)
        return convolve(x, y, *weights)

    for module in (arithmetic, elementary):
        monkeypatch.setattr(module, "convolve", counted)

    def cost(order: int) -> int:
        nonlocal terms
        terms = 0
        x = Series([1.0])
        y = np.exp(x) * x**-0.4 / np.arcsinh(x)
        for j in range(1, order + 1):
            x.append([0.1])
            y.coefficient(j)
        return terms

    ten, twenty, forty = cost(10), cost(20), cost(40)
    assert ten > 10  # the counter is in place
    assert twenty / ten < 4.0
    assert 3.0 < forty / twenty < 4.0


def test_no_coefficient_is_computed_twice() -> None:
    asked: list[int] = []

    class Matrix:
        def __matmul__(self, y: Series) -> Any:
            return y.__rmatmul__(self) if isinstance(y, Series) else (asked.append(1), y)[1]

    x = Series([1.0])
    y = Matrix() @ x
    z = y * y + np.exp(y)
    for j in range(1, 6):
        x.append([1.0])
        z.coefficient(j)
        z.coefficient(j)
    assert len(asked) == 6


@pytest.mark.parametrize("name", CLOSED)
def test_what_is_taken_back_is_computed_anew(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines a formula is made of bend at order 3 first, and are then put straight."""
    right, lines = coefficients(CLOSED[name][0]())[:6], list[Series]()

    def bent(start: float, slope: float = 1.0) -> Series:
        lines.append(x := Series([start]))
        for coefficient in (slope, 0.0, 7.0, 0.0, 0.0):
            x.append([coefficient])
        return x

    monkeypatch.setitem(globals(), "line", bent)
    formula = CLOSED[name][0]()
    assert np.abs(coefficients(formula, 5) - right).max() > 1.0
    for x in lines:
        x.forget(3)
        for _ in range(3):
            x.append([0.0])
    np.testing.assert_allclose(coefficients(formula, 5), right, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", CLOSED)
def test_earlier_coefficients_are_the_same_when_they_are_asked_for_again(name: str) -> None:
    """Also those of a series that keeps its last one only, and after all have been packed."""
    formula = CLOSED[name][0]()
    first = [formula.coefficient(j).copy() for j in range(6)]
    again = [formula.coefficient(j) for j in reversed(range(6))]
    np.testing.assert_array_equal(again[::-1], first)
    np.testing.assert_array_equal(formula.head(5), first)


def test_the_start_of_a_series_cannot_be_taken_back() -> None:
    with pytest.raises(ValueError, match="coefficient 0 cannot be taken back: a series keeps y_0"):
        Series([1.0]).forget(0)


# Refusals.

REFUSED: dict[str, Callable[[Series], Any]] = {
    "abs": abs,
    "np.abs": np.abs,
    "<": lambda x: x < 1.0,
    ">=": lambda x: x >= 1.0,
    "==": lambda x: x == 1.0,
    "!=": lambda x: x != 1.0,
    "where": lambda x: np.where(True, x, 0.0),
    "bool": bool,
    "float": float,
    "max": lambda x: max(x, x),
    "np.maximum": lambda x: np.maximum(x, 0.0),
    "np.sign": np.sign,
    "np.sort": np.sort,
    "np.clip": lambda x: np.clip(x, 0.0, 1.0),
    "np.isnan": np.isnan,
    "%": lambda x: x % 1.0,
    "//": lambda x: 1.0 // x,
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_taylor_coefficients_is_a_type_error_that_says_so(name: str) -> None:
    with pytest.raises(NoSeries, match="not analytic") as caught:
        REFUSED[name](line(1.0))
    assert isinstance(caught.value, TypeError)


UNKNOWN: dict[str, Callable[[Series], Any]] = {
    "add with out": lambda x: np.add(x, 1.0, out=np.zeros(1)),
    "add.reduce": np.add.reduce,
    "prod": np.prod,
    "sinc": np.sinc,
    "norm": np.linalg.norm,
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_no_rule_is_known_for_is_not_called_non_analytic(name: str) -> None:
    with pytest.raises(NoSeries, match=f"a series has no rule for {name}: write the formula with") as caught:
        UNKNOWN[name](line(1.0))
    assert "not analytic" not in str(caught.value)


def test_a_varying_exponent_is_a_type_error_that_names_the_way_out() -> None:
    x = line(1.0)
    for power in (lambda: x**x, lambda: x ** np.array([1.0]), lambda: np.power(x, x), lambda: 2.0**x):
        with pytest.raises(NoSeries, match=r"exp\(y log x\)"):
            power()


@pytest.mark.parametrize("other", [np.eye(2), np.ones(2), Series([1.0, 2.0])])
def test_a_series_on_the_left_of_a_product_is_refused_with_the_way_out(other: Any) -> None:
    for product in (lambda x: x @ other, lambda x: np.matmul(x, other)):
        with pytest.raises(NoSeries, match=r"write matrix @ u, and np.sum\(u \* v\)"):
            product(Series([1.0, 2.0]))


def test_only_the_series_one_made_can_be_appended_to() -> None:
    x = Series([1.0])
    with pytest.raises(TypeError, match="append to the series it was made from"):
        (x + 1.0).append([1.0])


def test_a_coefficient_not_yet_known_is_an_index_error() -> None:
    x = Series([1.0])
    y = np.exp(x)
    with pytest.raises(IndexError, match="coefficient 1 is not known yet: 1 have been appended"):
        y.coefficient(1)
    x.append([1.0])
    assert y.coefficient(1)[0] == np.e  # and no harm is done by having asked


def test_a_coefficient_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"shape \(3,\) in a series of shape \(2,\)"):
        Series([1.0, 2.0]).append([1.0, 2.0, 3.0])
