"""Numbers as text."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlsolve.show.tables.latex.words import NUMBER
from nlsolve.show.tables.numbers import alike, plain, significant

FINITE = st.floats(-1e300, 1e300, allow_subnormal=False)


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [
        (0.0124, 2, "0.012"),
        (0.0996, 2, "0.10"),
        (1240.0, 2, "1200"),
        (99999.0, 2, "1.0e+05"),
        (7.0, 3, "7.00"),
        (1.24e-9, 2, "1.2e-09"),
        (0.0, 3, "0.00"),
        (-0.5, 1, "-0.5"),
    ],
)
def test_significant_figures(value, figures, text):
    assert significant(value, figures) == text


@given(FINITE, st.integers(1, 15))
def test_significant_figures_are_near(value, figures):
    text = significant(value, figures)
    assert NUMBER.fullmatch(text)
    assert math.isclose(float(text), value, rel_tol=0.5001 * 10.0 ** (1 - figures), abs_tol=0.0)


@given(st.lists(FINITE, min_size=1), st.integers(1, 6))
def test_a_column_is_written_in_one_way(values, figures):
    form = alike(values, figures)
    texts = [form(value) for value in values if value]
    assert all(NUMBER.fullmatch(text) for text in texts)
    assert len({"e" in text for text in texts}) <= 1
    if any("." in text for text in texts):
        assert all(math.isclose(float(form(v)), v, rel_tol=0.5001 * 10.0 ** (1 - figures)) for v in values)


def test_integers_stay_integers():
    assert [alike([3.0, 1200.0, math.nan], 3)(value) for value in (3.0, 1200.0)] == ["3", "1200"]
    assert alike([3.0, 0.5], 3)(3.0) == "3.00"
    assert alike([3e-9, 0.5], 2)(0.5) == "5.0e-01"
    assert alike([3e-9, 0.0], 2)(0.0) == "0"


def test_plain():
    assert [plain(value) for value in (2.0, 1e12, 2.70449e-9)] == ["2", "1e+12", "2.704e-09"]
