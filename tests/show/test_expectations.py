"""Expectations: what can be asserted of results, and what is said when they do not bear it out."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest
from pydantic import ValidationError

from nlsolve.show.expectations import Expectation, judged
from nlsolve.show.tables import TableSpec

RUNS = pd.DataFrame(
    {
        "case": ["a", "b", "c", "d"],
        "status": ["converged", "converged", "converged", "diverged"],
        "solver.kind": ["newton", "anm", "newton", "anm"],
        "law.index": [0.5, 0.5, 1.0, 1.0],
        "tangents": [60, 2, 40, 4],
        "seconds": [7.0, 2.0, 5.0, float("nan")],
    }
)
TABLE = TableSpec(name="work", rows="solver.kind", columns="law.index", value="tangents")


def refutation(**fields: Any) -> str:
    (finding,) = judged([Expectation(**fields)], [TABLE], RUNS)
    return finding.refutation


@pytest.mark.parametrize(
    "fields",
    [
        {"column": "tangents", "at_most": 60},
        {"column": "tangents", "at_least": 2, "at_most": 60},
        {"column": "tangents", "where": {"solver.kind": "anm"}, "at_most": 4},
        {"column": "tangents", "where": {"law.index": 0.5}, "equals": [2, 60]},
        {"column": "status", "where": {"law.index": 0.5}, "equals": "converged"},
        {"column": "seconds", "where": {"case": "a"}, "equals": 7.05, "tolerance": 0.01},
        {"column": "tangents", "by": "solver.kind", "order": ["anm", "newton"]},
        {"column": "tangents", "by": "law.index", "order": [1.0, 0.5], "where": {"solver.kind": "newton"}},
        {"column": "tangents", "by": "solver.kind", "order": ["anm", "newton"], "within": "law.index"},
        {"table": "work", "column": "law.index = 0.5", "where": {"solver.kind": "anm"}, "equals": 2},
        {"table": "work", "column": "law.index = 1", "where": {"solver.kind": "anm"}, "equals": "diverged"},
    ],
)
def test_what_holds(fields):
    assert refutation(**fields) == ""


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"column": "tangents", "at_most": 50}, "case a: tangents is 60, and should be at most 50"),
        ({"column": "tangents", "at_least": 3}, "case b: tangents is 2, and should be at least 3"),
        ({"column": "seconds", "at_least": 0.0}, "case d: seconds is nan, and should be at least 0"),
        ({"column": "status", "equals": "converged"}, "case d: status is diverged, and not converged"),
        ({"column": "tangents", "equals": [60, 2]}, "case c: tangents is 40, and not 60 or 2"),
        ({"column": "tangents", "where": {"law.index": 2.0}, "at_most": 1}, "no row has these values"),
        ({"column": "tangnts", "at_most": 1}, "there is no column 'tangnts'; did you mean 'tangents'?"),
        (
            {"column": "tangents", "by": "solver.kind", "order": ["newton", "anm"]},
            "tangents is 2 for solver.kind = anm and 60 for newton",
        ),
        (
            {"column": "tangents", "by": "solver.kind", "order": ["newton", "anm"], "within": ["law.index"]},
            "tangents is 2 for solver.kind = anm and 60 for newton where law.index = 0.5",
        ),
        (
            {"column": "tangents", "by": "law.index", "order": [1.0, 0.5]},
            "tangents is 2 for law.index = 0.5 and 40 for 1.0",
        ),
        ({"column": "tangents", "by": "solver.kind", "order": ["anm", "x"]}, "no row has solver.kind = x"),
        (
            {"column": "seconds", "by": "solver.kind", "order": ["anm", "newton"]},
            "seconds has no number for solver.kind = anm",
        ),
        (
            {"table": "work", "column": "law.index = 1", "where": {"solver.kind": "anm"}, "at_most": 5},
            "anm: law.index = 1 is diverged, and should be at most 5",
        ),
        ({"table": "work", "column": "law.index = 2", "at_most": 5}, "there is no column 'law.index = 2'; did you"),
    ],
)
def test_what_does_not_hold(fields, sentence):
    assert refutation(**fields).startswith(sentence)


def test_a_table_that_cannot_be_filled_bears_nothing_out():
    spec = TableSpec(name="work", rows="solver.kind", value="tangents")
    (finding,) = judged([Expectation(table="work", column="tangents", at_most=1)], [spec], RUNS)
    assert "several runs land in the cell solver.kind = 'newton'" in finding.refutation


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({}, "says nothing: give at_most, at_least, equals or order"),
        ({"order": ["a", "b"]}, "order lists values of the column that by names: give both"),
        ({"by": "a", "at_most": 1}, "order lists values of the column that by names: give both"),
        ({"within": "a", "at_most": 1}, "within divides the rows of an order, and there is none"),
        ({"order": ["a"], "by": "b"}, "order needs two values or more"),
    ],
)
def test_what_cannot_be_asserted(fields, sentence):
    with pytest.raises(ValidationError, match=sentence):
        Expectation(column="tangents", **fields)


def test_findings_are_sentences():
    said = Expectation(that="Newton factorises most.", column="tangents", at_least=50)
    plain = Expectation(column="tangents", where={"solver.kind": "anm"}, at_most=4, at_least=1)
    order = Expectation(column="tangents", by="solver.kind", order=("anm", "newton"))
    assert [str(finding) for finding in judged([said, plain, order], [], RUNS)] == [
        "not found, though expected: Newton factorises most: case b: tangents is 2, and should be at least 50",
        "found, as expected: tangents is at most 4.0 and at least 1.0 where solver.kind = anm",
        "found, as expected: tangents is growing along anm, newton",
    ]
