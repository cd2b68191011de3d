"""Declared tables: layout, words, comparison with a paper, and the formats they are written in."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from rich.console import Console

from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RUNS
from nlsolve.results.published_values import verdict
from nlsolve.show.tables import TableSpec, build, check


def runs(**columns) -> pd.DataFrame:
    frame = pd.DataFrame(
        {
            "status": "converged",
            "solver.order": [10, 10, 20, 20],
            "solver.tolerance": [1e-6, 1e-8, 1e-6, 1e-8],
            "tangents": [30.0, 40.0, 15.0, 20.0],
            "seconds": [1.5, 2.25, 1e-7, np.nan],
        }
    ).assign(**columns)
    return frame.reindex(columns=[*RUNS, *(name for name in frame if name not in RUNS)])


def spec(**fields) -> TableSpec:
    given = {"name": "t", "rows": "solver.order", "columns": "solver.tolerance", "value": "tangents"}
    return TableSpec.model_validate(given | fields)


def test_one_value_by_rows_and_columns():
    table = build(spec(), runs())
    assert table.cells.to_numpy().tolist() == [[30.0, 40.0], [15.0, 20.0]]
    assert table.cells.loc[20, 1e-8] == 20
    assert (table.cells.index.name, table.cells.columns.name) == ("solver.order", "solver.tolerance")
    assert table.words.to_numpy().tolist() == [["30", "40"], ["15", "20"]]


def test_several_values_without_columns_and_several_rows():
    table = build(spec(columns=[], rows=["solver.order", "solver.tolerance"], value=["tangents", "seconds"]), runs())
    assert list(table.cells.columns) == ["tangents", "seconds"]
    assert table.cells.index.names == ["solver.order", "solver.tolerance"]
    assert table.words.loc[(10, 1e-8), "seconds"] == "2.25"
    assert table.words.loc[(20, 1e-6), "seconds"] == "1e-07"
    assert table.words.loc[(20, 1e-8), "seconds"] == "–"


def test_several_values_by_columns():
    table = build(spec(value=["tangents", "seconds"]), runs())
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
    with pytest.raises(StudyError, match=r"table 't': value = 'tangens': no such .*; did you mean 'tangents'"):
        build(spec(value="tangens"), runs())
    with pytest.raises(StudyError, match=r"^table 't': value = 'branches': this column is called tangents now$"):
        build(spec(value="branches"), runs())
    with pytest.raises(StudyError, match=r"no case has these values: solver\.order = 11"):
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
        r"{$10^{-6}$}",
        "$20$ & 15",
    ):
        assert piece in latex
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(table.rich()[0])
    assert "solver.tolerance = 1e-06" in console.export_text()
    assert table.long()[0] == {"solver.order": "10", "solver.tolerance = 1e-06": 30.0, "solver.tolerance = 1e-08": 40.0}


def test_a_missing_parameter_is_a_dash():
    frame = runs(**{"solver.order": [10, 10, np.nan, np.nan]})
    assert build(spec(), frame).cells.index.tolist() == [10, "–"]


def judged() -> pd.DataFrame:
    """Four runs of known error and one that diverged."""
    frame = pd.DataFrame(
        {
            "status": ["converged"] * 4 + ["diverged"],
            "variant": ["a", "b", "c", "d", "e"],
            "solver.kind": ["anm", "anm", "newton", "newton", "newton"],
            "solver.exact": [True, False, True, False, True],
            "seconds": [2.0, 1.0, 3.0, 0.5, 0.1],
            "velocity_error": [0.0005, 0.008, 0.0009, 0.2, np.nan],
            "doubt": ["", "too coarse", np.nan, "", ""],
        }
    )
    return frame.reindex(columns=[*dict.fromkeys((*RUNS, *frame))])


CHEAPEST = {"cost": "seconds", "error": "velocity_error", "within": [0.01, 0.001]}


def test_the_cheapest_within_an_error():
    table = build(spec(rows=[], columns=[], value=["variant", "seconds"], cheapest=CHEAPEST), judged())
    assert table.cells.index.tolist() == ["1 %", "0.1 %"]
    assert table.cells.index.name == "within"
    assert table.words.to_numpy().tolist() == [["b", "1"], ["a", "2"]]
    assert table.markdown().splitlines()[2].replace(" ", "") == "|1%|b|1|"


def test_the_cheapest_of_each_group_and_none():
    table = build(spec(rows="solver.kind", columns=[], value=["variant", "solver.exact"], cheapest=CHEAPEST), judged())
    assert table.cells.index.tolist() == [("1 %", "anm"), ("1 %", "newton"), ("0.1 %", "anm"), ("0.1 %", "newton")]
    assert table.words["variant"].tolist() == ["b", "c", "a", "c"]
    assert table.words["solver.exact"].tolist() == ["no", "yes", "yes", "yes"]
    strict = CHEAPEST | {"within": [1e-3, 6e-4]}
    table = build(spec(rows=[], columns="solver.kind", value="variant", cheapest=strict), judged())
    assert table.words.to_numpy().tolist() == [["a", "c"], ["a", "–"]]
    by_residual = CHEAPEST | {"error": "seconds", "within": [1.5]}
    assert build(spec(rows=[], columns=[], value="variant", cheapest=by_residual), judged()).cells.index[0] == "1.5"


def test_counts_of_outcomes():
    table = build(spec(rows="solver.kind", columns="outcome", value=[], count=True), judged())
    assert table.cells.columns.tolist() == ["right", "doubted", "wrong", "diverged"]
    assert table.cells.to_numpy().tolist() == [[1, 1, 0, 0], [1, 0, 1, 1]]
    table = build(spec(rows="status", columns=[], value=[], count=True), judged())
    assert table.cells["runs"].to_dict() == {"converged": 4, "diverged": 1}


def test_false_successes_are_a_table():
    table = build(spec(rows="variant", columns=[], value="outcome"), judged())
    assert table.cells["outcome"].tolist() == ["right", "doubted", "right", "wrong", "diverged"]
    wrong = spec(rows="variant", columns=[], value="velocity_error", where={"outcome": "wrong"})
    assert build(wrong, judged()).cells.index.tolist() == ["d"]
    lenient = spec(rows="variant", columns=[], value="outcome", accepted=0.3)
    assert build(lenient, judged()).cells.loc["d", "outcome"] == "right"


def test_shares_solved_and_their_intervals():
    """By hand, z² = 2.7055: 2 of 2 from N/(N + z²) = 0.425; 1 of 3: (0.7843 ± 0.6354)/1.9018. z² = 0.455: 1/1.455."""
    table = build(spec(rows="solver.kind", columns=[], value="solved"), judged().assign(residual_norm=1e-9))
    assert table.words["solved"].to_dict() == {"anm": "1.00 [0.43, 1.00]", "newton": "0.33 [0.08, 0.75]"}
    assert table.csv() == 'solver.kind,solved\nanm,"1.00 [0.43, 1.00]"\nnewton,"0.33 [0.08, 0.75]"\n'
    table = build(
        spec(rows="solver.kind", columns="solver.exact", value="solved", format=".0%", interval=0.5, accepted=0.3),
        judged().assign(residual_norm=1e-9),
    )
    assert table.words.to_numpy().tolist() == [
        ["100% [69%, 100%]", "100% [69%, 100%]"],
        ["50% [28%, 72%]", "100% [69%, 100%]"],
    ]
    assert table.words.loc["newton", True] == "50% [28%, 72%]"


def test_what_no_one_verified_is_not_solved():
    table = build(spec(rows="solver.kind", columns=[], value="solved"), judged())
    assert table.words["solved"].tolist() == ["0.00 [0.00, 0.57]", "0.00 [0.00, 0.47]"]
    solved = spec(rows="variant", columns=[], value="seconds", where={"solved": True})
    assert build(solved, judged().assign(residual_norm=1e-9)).cells.index.tolist() == ["a", "b", "c"]


def test_where_with_several_values():
    table = build(spec(where={"solver.order": [20, 10, 7], "solver.tolerance": [1e-8]}), runs())
    assert table.cells.to_numpy().tolist() == [[40.0], [20.0]]
    with pytest.raises(StudyError, match=r"no case has these values: solver\.order = \[7, 8\]"):
        build(spec(where={"solver.order": [7, 8]}), runs())


def test_before_a_run_outcomes_counts_and_winners_are_unknown_but_not_wrong():
    cases = [{"solver.order": 1}, {"solver.order": 1}]
    for fields in (
        {"columns": "outcome", "value": [], "count": True},
        {"columns": [], "value": "seconds", "cheapest": {}},
        {"columns": [], "value": [], "count": True},
        {"columns": [], "value": "solved"},
    ):
        assert check(spec(**fields), cases) == []
    (problem,) = check(spec(columns=[], value="seconds", cheapest={"cost": "secnds"}), cases)
    assert (problem.place, problem.value) == (("cheapest", "cost"), "secnds")
    assert "did you mean 'seconds'?" in problem.expected


def test_a_kept_declaration_reads_back_the_same():
    declared = spec(columns=[], value="variant", cheapest=CHEAPEST)
    assert TableSpec.model_validate(declared.model_dump(mode="json")) == declared


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"count": True}, "count = true shows numbers of runs; drop value"),
        ({"count": True, "value": [], "cheapest": {}}, "drop cheapest"),
        ({"value": []}, "value is required, and missing"),
        ({"rows": []}, "rows is required, and missing"),
        ({"cheapest": {}, "paper": {"source": "s", "values": [[1]]}}, "not with cheapest or shares"),
        ({"value": "solved", "paper": {"source": "s", "values": [[1]]}}, "not with cheapest or shares"),
        ({"value": ["solved", "seconds"]}, 'value = "solved" shows shares.*drop the other values'),
        ({"value": "solved", "cheapest": {}}, 'value = "solved" shows shares.*drop cheapest'),
        ({"interval": 1.0}, "less than 1"),
        ({"value": "speedup"}, "a speedup compares with a run: say with which"),
        ({"cheapest": {"within": []}}, "at least 1 item"),
        ({"accepted": 0}, "greater than 0"),
    ],
)
def test_declarations_that_contradict_themselves(fields, sentence):
    with pytest.raises(ValidationError, match=sentence):
        spec(**fields)


def test_names_of_files_are_plain():
    with pytest.raises(ValidationError, match="pattern"):
        spec(name="../t")


# Speed beside a run.


def test_a_speedup_is_seconds_over_seconds_in_the_same_column():
    table = build(spec(value="speedup", against={"solver.order": 10}), runs(seconds=[3.0, 8.0, 1.5, 2.0]))
    assert table.cells.to_numpy().tolist() == [[1.0, 1.0], [2.0, 4.0]]


def test_a_run_has_no_speedup_without_the_other_or_where_one_failed():
    given = {"value": "speedup", "against": {"solver.order": 10}}
    table = build(spec(**given), runs(status=["diverged", "converged", "converged", "diverged"]))
    assert table.words.to_numpy().tolist() == [["diverged", "1"], ["–", "diverged"]]
    absent = build(spec(value="speedup", against={"solver.order": 99}), runs())
    assert absent.words.to_numpy().tolist() == [["–", "–"], ["–", "–"]]


def test_a_speedup_against_an_unknown_column():
    (problem,) = check(
        spec(value="speedup", against={"solver.ordr": 10}), [{"solver.order": 10, "solver.tolerance": 1}]
    )
    assert problem.place == ("against",)
    assert "did you mean 'solver.order'?" in problem.expected
