"""Which runs `where` chooses: one equality, and tables and figures that agree on it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlsolve.results.frames import json_rows, rows_of
from nlsolve.results.selection import fits, is_wanted, same
from nlsolve.show.figures import LineFigure
from nlsolve.show.figures.cases import select
from nlsolve.show.tables import TableSpec, build


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (1e-8, 1e-8 * (1 + 9e-10), True),
        (1e-8, 1e-8 * (1 + 2e-9), False),
        (20, 20.0, True),
        (np.int64(20), 20, True),
        (0.0, 1e-300, False),
        (np.inf, np.inf, True),
        (np.inf, -np.inf, False),
        (np.nan, np.nan, True),
        (np.nan, None, True),
        (pd.NA, np.nan, True),
        (np.nan, 0.0, False),
        (None, "", False),
        ("anm", "anm", True),
        ("anm", "ANM", False),
        (True, True, True),
        (np.bool_(True), True, True),
        (True, False, False),
        ("20", 20, True),  # a stored column of numbers and words
        ("1e-06", 1e-6, True),
        ("True", True, True),
        ("anm", 20, False),
        ("", 0, False),
        ((1.0, 2.0), (1.0, 2.0), True),
        ((1.0, 2.0), (1.0, 3.0), False),
    ],
)
def test_when_two_values_are_the_same(a: Any, b: Any, expected: bool) -> None:
    assert same(a, b) is expected
    assert same(b, a) is expected


values = st.one_of(st.none(), st.booleans(), st.integers(-5, 5), st.floats(-5, 5), st.sampled_from(["anm", "3", ""]))


@given(values, values)
def test_equality_is_of_a_value_with_itself_and_has_two_sides(a: Any, b: Any) -> None:
    assert same(a, a)
    assert same(a, b) is same(b, a)


def test_one_of_several_values_and_every_column() -> None:
    assert is_wanted(10, [20, 10])
    assert not is_wanted(10, [20, 30])
    run = {"solver.kind": "anm", "solver.order": 20.0}
    assert fits(run, {"solver.kind": ["newton", "anm"], "solver.order": 20})
    assert not fits(run, {"solver.kind": "anm", "solver.order": 10})
    assert not fits(run, {"law.index": 1.0})
    assert fits(run, {})


RUNS = pd.DataFrame(
    {
        "case": list("abcd"),
        "status": "converged",
        "solver.kind": ["anm", "anm", "newton", "newton"],
        "solver.order": ["20", "10", None, None],
        "solver.exact": [True, False, True, True],
        "stop.tolerance": [1e-8, 1e-8 * (1 + 1e-12), 1e-6, np.nan],
        "seconds": [1.0, 2.0, 3.0, 4.0],
    }
)


@pytest.mark.parametrize(
    ("where", "cases"),
    [
        ({"solver.kind": "anm"}, "ab"),
        ({"solver.order": 20}, "a"),
        ({"solver.order": "20"}, "a"),
        ({"solver.exact": True}, "acd"),
        ({"stop.tolerance": 1e-8}, "ab"),
        ({"stop.tolerance": [1e-8, 1e-6]}, "abc"),
        ({"solver.kind": "newton", "stop.tolerance": 1e-6}, "c"),
    ],
)
def test_a_table_and_a_figure_choose_the_same_runs(where: dict[str, Any], cases: str) -> None:
    drawn = select(LineFigure(name="f", source="runs", x="case", y=("seconds",), where=where), RUNS)
    table = build(TableSpec(name="t", rows=("case",), value=("seconds",), where=where), RUNS)
    assert list(drawn["case"]) == list(table.cells.index) == list(cases)


def test_rows_keep_their_types_and_json_their_digits() -> None:
    frame = pd.DataFrame({"a": [1.2345678901234567e-14, np.inf], "n": [1, 2], "word": ["x", None], "b": [True, False]})
    assert rows_of(frame)[0] == {"a": 1.2345678901234567e-14, "n": 1, "word": "x", "b": True}
    assert json.loads(json.dumps(json_rows(frame))) == [
        {"a": 1.2345678901234567e-14, "n": 1, "word": "x", "b": True},
        {"a": None, "n": 2, "word": None, "b": False},
    ]
    mixed = pd.DataFrame({"cell": np.array([np.int64(3), "diverged", np.nan, np.float64(0.5)], dtype=object)})
    assert json.dumps([row["cell"] for row in json_rows(mixed)]) == '[3, "diverged", null, 0.5]'
