"""Where seconds come from, and what is said of a table or figure that shows them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RUNS, STEPS, is_timed
from nlsolve.results.costs.lanes import half_width, lane_of, on_seconds
from nlsolve.running.runner import run
from nlsolve.show.figures import FigureError, LineFigure, TradeFigure, draw
from nlsolve.show.figures.crossover import CrossoverFigure
from nlsolve.show.figures.solved import PerformanceFigure
from nlsolve.show.tables import TableSpec, build, built

BESIDE = "Seconds were taken beside other cases (lane shared)."
SEVERAL = r"its seconds come from several lanes \(2 shared, 1 alone\): time them in one, by \[timing\] lane = "


def row(lane: Any, **columns: Any) -> dict[str, Any]:
    return {"status": "converged", "seconds": 1.0, "lane": lane, **columns}


def exclusive(half_width: float, rounds: int = 7, load: float = 0.0) -> dict[str, Any]:
    ends = {"seconds_low": 1.0 - half_width, "seconds_high": 1.0 + half_width}
    return row("exclusive", rounds=rounds, load=load, **ends)


MIX = pd.DataFrame([row("shared", variant="a"), row("shared", variant="b"), row("alone", variant="c")]).assign(
    case=["1", "2", "3"], velocity_error=0.1, tangents=3, seconds_all=2.0
)


def table(**fields: Any) -> TableSpec:
    return TableSpec.model_validate({"name": "t", "rows": "variant", "value": "seconds", **fields})


def test_what_is_read_from_a_clock_is_marked():
    """All seconds but those that are predicted, and those of the simulated time."""
    assert {name for name in RUNS if name.startswith(("seconds", "unit."))} - {"seconds_predicted"} == {
        name for name in RUNS if is_timed(name)
    } - {"factor_solve_ratio"}
    assert [name for name in STEPS if STEPS[name].timed] == ["seconds"]
    assert not is_timed("solver.seconds"), "a parameter, whatever it is called"


def test_one_lane_needs_few_words():
    assert on_seconds([row("alone")], "one") == ()
    assert on_seconds([row(float("nan"))], "one") == (), "of an earlier nlsolve"
    assert on_seconds([row("shared"), row("shared")], "one") == (BESIDE,)
    assert on_seconds([], "one") == ()


def test_the_lane_of_a_failure_does_not_matter():
    assert on_seconds([row("alone"), row("shared", status="diverged"), {"status": "crashed"}], "one") == ()


def test_several_lanes_are_refused_or_told():
    runs = [row("exclusive"), row("shared"), row("shared")]
    with pytest.raises(StudyError, match=r"several lanes \(1 exclusive, 2 shared\): time them in one, by \[timing\]"):
        on_seconds(runs, "one")
    (told,) = on_seconds(runs, "mixed")
    assert told == "Seconds come from several lanes and compare only within one: 1 exclusive, 2 shared."
    assert lane_of(row(None)) == "unknown"


def test_the_exclusive_lane_tells_rounds_intervals_and_load():
    (told,) = on_seconds([exclusive(0.01), exclusive(0.024, rounds=12)], "one")
    assert told == ("Seconds are medians of 7 to 12 rounds in the exclusive lane; 95 % intervals are at most ± 2.4 %.")
    nothing = float("nan")
    (told,) = on_seconds([exclusive(0.01, 3), exclusive(nothing, 3)], "one")
    assert told.endswith("of 3 rounds in the exclusive lane; 95 % intervals are at most ± 1 %, and 1 of 2 have none.")
    (told,) = on_seconds([exclusive(nothing, 3)], "one")
    assert told.endswith("of 3 rounds in the exclusive lane; too few for an interval.")
    _, load = on_seconds([exclusive(0.01, load=0.4), exclusive(0.01, load=0.05)], "one")
    assert load == "Others took more than 10 % of the core of 1 of 2 cases (column load)."
    assert half_width(exclusive(0.02)) == pytest.approx(0.02)
    assert math.isnan(half_width({**exclusive(0.02), "seconds": 0.0}))


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"value": ["tangents", "seconds_all"]},
        {"value": "speedup", "against": {"variant": "a"}},
        {"rows": [], "value": "variant", "cheapest": {"within": [1.0]}},
    ],
    ids=str,
)
def test_a_table_does_not_mix_lanes_unless_it_says_so(fields: dict[str, Any]):
    with pytest.raises(StudyError, match=f"table 't': {SEVERAL}"):
        build(table(**fields), MIX)
    found = build(table(**fields, lanes="mixed"), MIX)
    assert found.notes == ("Seconds come from several lanes and compare only within one: 2 shared, 1 alone.",)
    assert build(table(**fields, where={"variant": ["a", "b"]}), MIX).notes == (BESIDE,)


def test_a_speedup_is_not_told_against_another_lane():
    with pytest.raises(StudyError, match="several lanes"):
        build(table(value="speedup", against={"variant": "c"}, where={"variant": "a"}), MIX)


def test_a_table_without_seconds_may_have_any_lanes():
    assert build(table(value="tangents"), MIX).notes == ()
    assert build(table(rows="lane", value=[], count=True), MIX).notes == ()


def test_a_refused_table_leaves_the_others():
    tables, sentences = built([table(), table(value="tangents", name="u")], MIX)
    assert [found.spec.name for found in tables] == ["u"]
    assert len(sentences) == 1


def test_a_note_stands_beneath_the_table_in_every_form():
    found = build(table(lanes="mixed"), MIX)
    (note,) = found.notes
    assert found.markdown().endswith(f"|\n\n{note}\n")
    assert f"\n{note}\n\\end{{minipage}}\n\\end{{table}}\n" in found.latex()
    assert found.rich()[-1].caption == note
    assert note not in found.csv()


@pytest.mark.parametrize(
    "figure",
    [
        TradeFigure(name="f"),
        LineFigure(name="f", source="runs", x="tangents", y=("seconds",)),
        LineFigure(name="f", x="step", y=("seconds",)),
        PerformanceFigure(name="f"),
        CrossoverFigure(name="f"),
    ],
    ids=lambda figure: f"{figure.kind} of {getattr(figure, 'source', 'runs')}",
)
def test_a_figure_does_not_mix_lanes_unless_it_says_so(figure: Any):
    nothing = pd.DataFrame()
    with pytest.raises(FigureError, match=f'figure "f": {SEVERAL}'):
        draw(figure, MIX, nothing, nothing)
    assert figure.model_copy(update={"lanes": "mixed"}).on_seconds(MIX)[0].startswith("Seconds come from several")
    assert figure.model_copy(update={"where": {"variant": "c"}}).on_seconds(MIX) == ()


def test_a_figure_without_seconds_may_have_any_lanes():
    assert LineFigure(name="f", source="runs", x="tangents", y=("velocity_error",)).on_seconds(MIX) == ()
    assert TradeFigure(name="f", x="tangents").on_seconds(MIX) == ()
    assert TradeFigure(name="f").on_seconds(pd.DataFrame()) == ()


def document(*kinds: str) -> dict[str, Any]:
    return {
        "question": "?",
        "scene": {"kind": "published", "problem": "powell-singular"},
        "sweep": [{"grid": {"solver.kind": list(kinds)}}],
        "table": [
            {"name": "seconds", "rows": "solver.kind", "value": "seconds"},
            {"name": "work", "rows": "solver.kind", "value": "residuals"},
        ],
        "figure": [{"kind": "line", "name": "trade", "source": "runs", "x": "residuals", "y": "seconds"}],
    }


def test_a_folder_of_several_lanes_shows_the_rest(tmp_path: Path):
    """A study that has grown, first run two cases at a time and then one by one."""
    first = run(document("newton", "broyden"), tmp_path, isolation="process", jobs=2)
    assert first.notes == ()
    assert first.tables()[0].notes == (BESIDE,)
    report = (tmp_path / "report.html").read_text()
    assert f"<p>{BESIDE}</p>" in report
    assert f"<figcaption>trade {BESIDE}" in report
    both = run(document("newton", "broyden", "modified-newton"), tmp_path, isolation="process", jobs=1)
    refused, drawn = both.notes
    assert refused.startswith("table 'seconds': its seconds come from several lanes (2 shared, 1 alone)")
    assert drawn.startswith('figure "trade": its seconds come from several lanes')
    told = CliRunner().invoke(app, ["table", str(tmp_path), "--json"])
    assert told.exit_code == 0
    assert list(json.loads(told.stdout)) == ["work"]
    assert refused in told.stderr
    named = CliRunner().invoke(app, ["table", str(tmp_path), "seconds"])
    assert named.exit_code == 2
    assert refused in named.stderr
