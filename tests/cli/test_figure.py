"""`nlsolve figure` draws the figures of a results folder again, without running anything."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from fakes import STUDY, fake_march, registry_of, write_study
from typer.testing import CliRunner

import nlsolve as house
from nlsolve.cli.app import app
from nlsolve.study.study import Study

FIGURES = """
[figures]
width = "double"
formats = "pdf"

[[figure]]
kind = "line"
name = "first"
source = "runs"
x = "solver.order"
y = "tangents"
group = "solver.tolerance"

[[figure]]
kind = "line"
name = "second"
width = "60 mm"
source = "runs"
x = "solver.order"
y = "tangents"
"""


@pytest.fixture(autouse=True)
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", fake_march)
    monkeypatch.chdir(tmp_path)
    study = write_study(tmp_path, text=STUDY + FIGURES)
    assert nlsolve("run", study, "--out", "o").exit_code == 0


def nlsolve(*arguments: object) -> Any:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert "Traceback" not in result.output
    return result


def width(path: str) -> float:
    """The width of a page of a PDF [mm]."""
    found = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+)", Path(path).read_bytes())
    assert found is not None
    return float(found[1]) / 72 * 25.4


def test_a_run_writes_what_the_study_says() -> None:
    assert sorted(path.name for path in Path("o/figures").iterdir()) == [
        "first.csv",
        "first.pdf",
        "second.csv",
        "second.pdf",
    ]
    assert width("o/figures/first.pdf") == pytest.approx(180, abs=0.3)
    assert width("o/figures/second.pdf") == pytest.approx(60, abs=0.3)


def test_the_look_of_a_run_can_be_set_by_hand(tmp_path: Path) -> None:
    again = nlsolve("run", tmp_path / "study.toml", "--out", "o", "--set", 'figures.width="84 mm"')
    assert again.stderr.count("converged before") == 4
    assert width("o/figures/first.pdf") == pytest.approx(84, abs=0.3)


def test_all_figures_are_drawn_again_as_the_study_says() -> None:
    before = Path("o/figures/first.pdf").read_bytes()
    Path("o/figures/first.pdf").unlink()
    told = nlsolve("figure", "o")
    assert told.exit_code == 0
    names = ("first.pdf", "first.csv", "second.pdf", "second.csv")
    assert told.stdout.split() == [f"o/figures/{name}" for name in names]
    assert Path("o/figures/first.pdf").read_bytes() == before


def test_one_figure_in_another_width_and_format_elsewhere() -> None:
    options = ("--width", "84mm", "--font-size", 8, "--font", "sans-serif", "--format", "pdf", "--format", "svg")
    told = nlsolve("figure", "o", "second", *options, "--to", "paper")
    assert told.stdout.split() == ["paper/second.pdf", "paper/second.svg", "paper/second.csv"]
    assert width("paper/second.pdf") == pytest.approx(84, abs=0.3)
    assert width("o/figures/second.pdf") == pytest.approx(60, abs=0.3)
    assert b"DejaVuSans" in Path("paper/second.pdf").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("o", "frist"), "o: there is no figure 'frist'; did you mean 'first'?"),
        (("o", "--width", "84"), "--width 84: should be single, double, or a length with its unit: 84 mm, "),
        (("o", "--format", "jpeg"), "--format jpeg: should be 'png', 'pdf', 'svg' or 'pgf'"),
        (("o", "--font-size", "99"), "--font-size 99.0: should be less than or equal to 24"),
        (("o", "first", "--font", "Nothing"), "font 'Nothing' is not installed; there are serif, sans-serif"),
        (("elsewhere",), "elsewhere: no finished cases can be read there"),
    ],
)
def test_what_cannot_be_drawn_is_a_sentence(arguments: tuple[str, ...], sentence: str) -> None:
    told = nlsolve("figure", *arguments)
    assert told.exit_code == 2
    assert sentence in told.stderr


def test_of_all_figures_those_that_cannot_be_drawn_are_told() -> None:
    told = nlsolve("figure", "o", "--font", "Nothing")
    assert told.exit_code == 0
    assert told.stderr.count("is not installed") == 2
    assert told.stdout == ""


def test_a_study_without_figures(tmp_path: Path) -> None:
    nlsolve("run", write_study(tmp_path), "--out", "bare")
    told = nlsolve("figure", "bare")
    assert (told.exit_code, told.stdout, told.stderr) == (0, "", "bare: its study declares no figures\n")


def test_loaded_results_have_the_figures_of_their_study(tmp_path: Path) -> None:
    declared = Study.from_toml(tmp_path / "study.toml").figures
    assert house.load("o").study.figures == declared
    assert [figure.width for figure in declared] == ["double", "60 mm"]


PAPER = r"\input{o/tables/work}\includegraphics{o/figures/first}\includegraphics{o/figures/second}"


@pytest.fixture
def paper(tmp_path: Path) -> Path:
    """A study with a table, run, and a paper with all that it has."""
    table = '\n[[table]]\nname = "work"\nrows = "solver.order"\ncolumns = "solver.tolerance"\nvalue = "tangents"\n'
    assert nlsolve("run", write_study(tmp_path, text=STUDY + FIGURES + table), "--out", "o").exit_code == 0
    path = tmp_path / "paper.tex"
    path.write_text(PAPER, encoding="utf-8")
    return path


def test_a_paper_as_the_results_say(paper: Path) -> None:
    told = nlsolve("table", "o", "--check", paper)
    assert (told.exit_code, told.stderr) == (0, "")
    assert [line.partition(": ")[2] for line in told.stdout.splitlines()] == [
        "table work: as the results say",
        "figure first: as the results say",
        "figure second: as the results say",
    ]
    told = nlsolve("figure", "o", "--check", paper, "--json")
    assert told.exit_code == 0
    assert [(row["figure"], row["reason"]) for row in json.loads(told.stdout)] == [("first", ""), ("second", "")]


def test_a_wider_figure_is_not_stale_and_one_of_other_cases_is(paper: Path, tmp_path: Path) -> None:
    nlsolve("figure", "o", "first", "--width", "60mm", "--to", "o/figures")
    assert nlsolve("figure", "o", "--check", paper).exit_code == 0
    fewer = FIGURES.replace(
        'group = "solver.tolerance"\n', 'group = "solver.tolerance"\nwhere = { "solver.order" = 10 }\n'
    )
    study = write_study(tmp_path, text=STUDY + fewer.replace('name = "second"', 'name = "third"'))
    assert nlsolve("run", study, "--out", "new").exit_code == 0
    told = nlsolve("figure", "new", "--check", paper)
    assert told.exit_code == 3
    assert [line.partition(": ")[2] for line in told.stdout.splitlines()] == [
        "figure first: stale, the results tell something else now; nlsolve figure new first draws it again",
        "figure second: the results have no such figure now; nlsolve figure new second draws it again",
    ]
    assert nlsolve("figure", "new", "first", "--check", paper).stdout.count("\n") == 1
