"""Declared tables: layout, words, comparison with a paper, and the formats they are written in."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from rich.console import Console

from nlsolve.columns import RUNS
from nlsolve.errors import StudyError
from nlsolve.papers import verdict
from nlsolve.tables import TableSpec, build


def runs(**columns) -> pd.DataFrame:
    frame = pd.DataFrame(
        {
            "status": "converged",
            "solver.order": [10, 10, 20, 20],
            "solver.tolerance": [1e-6, 1e-8, 1e-6, 1e-8],
            "branches": [30.0, 40.0, 15.0, 20.0],
            "seconds": [1.5, 2.25, 1e-7, np.nan],
        }
    ).assign(**columns)
    return frame.reindex(columns=[*RUNS, *(name for name in frame if name not in RUNS)])


def spec(**fields) -> TableSpec:
    given = {"name": "t", "rows": "solver.order", "columns": "solver.tolerance", "value": "branches"}
    return TableSpec.model_validate(given | fields)


def test_one_value_by_rows_and_columns():
    table = build(spec(), runs())
    assert table.cells.to_numpy().tolist() == [[30.0, 40.0], [15.0, 20.0]]
    assert table.cells.loc[20, 1e-8] == 20
    assert (table.cells.index.name, table.cells.columns.name) == ("solver.order", "solver.tolerance")
    assert table.words.to_numpy().tolist() == [["30", "40"], ["15", "20"]]


def test_several_values_without_columns_and_several_rows():
    table = build(spec(columns=[], rows=["solver.order", "solver.tolerance"], value=["branches", "seconds"]), runs())
    assert list(table.cells.columns) == ["branches", "seconds"]
    assert table.cells.index.names == ["solver.order", "solver.tolerance"]
    assert table.words.loc[(10, 1e-8), "seconds"] == "2.25"
    assert table.words.loc[(20, 1e-6), "seconds"] == "1e-07"
    assert table.words.loc[(20, 1e-8), "seconds"] == "–"


def test_several_values_by_columns():
    table = build(spec(value=["branches", "seconds"]), runs())
    assert table.cells.shape == (2, 4)
    assert table.cells.loc[10, (1e-8, "seconds")] == 2.25
    assert "1e-08 · seconds" in table.markdown()


def test_where_and_order_of_appearance():
    table = build(spec(where={"solver.tolerance": 1e-8}), runs()[::-1])
    assert table.cells.index.tolist() == [20, 10]


def test_a_failed_case_shows_its_word():
    table = build(spec(), runs(status=["converged", "diverged", "crashed", "converged"]))
    assert table.words.to_numpy().tolist() == [["30", "diverged"], ["crashed", "20"]]


def test_a_format():
    assert build(spec(format=".1e"), runs()).words.iloc[0, 0] == "3.0e+01"
    with pytest.raises(ValidationError, match="Python format of a number"):
        spec(format="zz")


def test_several_runs_in_one_cell():
    with pytest.raises(StudyError, match=r"cell solver.order = 10; they differ in 'solver.tolerance': put it in rows"):
        build(spec(columns=[]), runs())


def test_unknown_names():
    with pytest.raises(StudyError, match="table 't': no such column of the results; did you mean 'branches'"):
        build(spec(value="brances"), runs())
    with pytest.raises(StudyError, match="no case has these values"):
        build(spec(where={"solver.order": 11}), runs())


def test_comparison_with_a_paper():
    paper = {"source": "someone 2015", "values": [[30, 60], [15, float("nan")]]}
    table = build(spec(paper=paper), runs())
    assert table.comparison is not None
    assert table.comparison.to_numpy().tolist() == [
        ["30 (30) within 25 %", "40 (60) same trend"],
        ["15 (15) within 25 %", "20"],
    ]
    assert "someone 2015" in next(reversed(table.frames()))
    assert set(table.files()) == {".csv", ".md", ".tex", "-paper.csv"}


@pytest.mark.parametrize(
    ("measured", "paper", "expected"),
    [
        ([[12.0]], [[10.0]], "within 25 %"),
        ([[12.6]], [[10.0]], "differs"),
        ([[20.0, 30.0], [25.0, 1.0]], [[10.0, 11.0], [12.0, 1.0]], "same trend"),
        ([[20.0, 30.0], [15.0, 1.0]], [[10.0, 11.0], [12.0, 1.0]], "differs"),
        ([[20.0, np.nan], [25.0, 1.0]], [[10.0, 5.0], [12.0, 1.0]], "same trend"),
        ([[20.0, 20.0]], [[10.0, 11.0]], "differs"),
        ([[np.nan, 30.0]], [[10.0, 11.0]], "differs"),
    ],
)
def test_verdicts(measured, paper, expected):
    assert verdict(np.array(measured), np.array(paper), 0, 0, 0.25) == expected


def test_a_failed_case_differs_from_the_paper():
    paper = {"source": "s", "values": [[30, 40], [15, 20]], "tolerance": 0.1}
    table = build(spec(paper=paper), runs(status=["diverged", "converged", "converged", "converged"]))
    assert table.comparison is not None
    assert table.comparison.iloc[0, 0] == "diverged (30) differs"
    assert table.comparison.iloc[1, 1] == "20 (20) within 10 %"


def test_formats():
    table = build(spec(caption="Branches of 100 % & more"), runs())
    assert table.csv() == "solver.order,solver.tolerance = 1e-06,solver.tolerance = 1e-08\n10,30.0,40.0\n20,15.0,20.0\n"
    assert table.markdown().splitlines()[2].replace(" ", "") == "|10|30|40|"
    latex = table.latex()
    for piece in (
        r"\toprule",
        r"\midrule",
        r"\bottomrule",
        r"\caption{Branches of 100 \% \& more}",
        "1e-06",
        "20 & 15",
    ):
        assert piece in latex
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(table.rich()[0])
    assert "solver.tolerance = 1e-06" in console.export_text()
    assert table.long()[0] == {"solver.order": "10", "solver.tolerance = 1e-06": 30.0, "solver.tolerance = 1e-08": 40.0}


def test_a_missing_parameter_is_a_dash():
    frame = runs(**{"solver.order": [10, 10, np.nan, np.nan]})
    assert build(spec(), frame).cells.index.tolist() == [10, "–"]


def test_names_of_files_are_plain():
    with pytest.raises(ValidationError, match="pattern"):
        spec(name="../t")
