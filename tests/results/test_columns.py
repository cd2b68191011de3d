"""The described columns: names, units and symbols, and what is told of a name that is none."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping

import pytest

from nlsolve.results.columns import DIAGNOSTICS, FIELDS, FRAMES, RENAMED, RUNS, STEPS, Column, no_such_column
from nlsolve.results.parameters import LETTERS
from nlsolve.results.verdicts import is_error
from nlsolve.show.figures.style import axis_label, symbol

EVERY = [pytest.param(column, id=column.name) for frame in (*FRAMES.values(), DIAGNOSTICS) for column in frame.values()]


@pytest.mark.parametrize("column", EVERY)
def test_a_unit_stands_beside_the_meaning_and_not_in_it(column: Column) -> None:
    assert column.meaning
    assert not re.search(r"\[[^\]]*\]", column.meaning + column.unit)
    assert not column.relative_error or not column.unit


@pytest.mark.parametrize("frame", [RUNS, STEPS, FIELDS, DIAGNOSTICS], ids=["runs", "steps", "fields", "diagnostics"])
def test_a_frame_is_its_columns_by_name_in_order(frame: Mapping[str, Column]) -> None:
    assert [column.name for column in frame.values()] == list(frame)


@pytest.mark.parametrize(
    ("columns", "frame", "label"),
    [
        (["u", "v"], "fields", "$u$, $v$ [mm/s]"),
        (["u", "rate"], "fields", r"$u$ [mm/s], $\bar{\varepsilon}$ [1/s]"),
        (["residual_norm"], "steps", "relative residual"),
        (["torque", "residuals"], "runs", "torque [N mm/mm], residuals"),
        (["unit.jacobian"], "runs", "jacobian [s]"),
        (["solver.order", "law.kind"], "runs", "order, law"),
        (["range"], "runs", "range"),  # of `steps` only
    ],
)
def test_labels_of_axes(columns: list[str], frame: str, label: str) -> None:
    assert axis_label(columns, frame) == label


def test_symbols_belong_to_a_frame() -> None:
    assert (symbol("u", "fields"), symbol("u", "runs")) == ("$u$", "u")


def test_relative_errors_are_declared() -> None:
    assert {name for name in RUNS if is_error(name)} == {name for name in RUNS if re.search("_error($|_)", name)}
    assert not is_error("solver.forcing_error")  # a parameter, whatever it is called


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_is_answered_with_the_new_one(old: str) -> None:
    assert RENAMED[old] in {*RUNS, *STEPS}
    assert old not in {*RUNS, *STEPS, *FIELDS, *DIAGNOSTICS}
    assert no_such_column(old, RUNS) == f"this column is called {RENAMED[old]} now"


def test_a_component_is_answered_with_the_column_of_its_kind() -> None:
    told = no_such_column("solver.range", ["solver.range.part", "solver.range.kind"])
    assert told == "this is a component, whose name is in the column solver.range.kind"


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    assert no_such_column("secnds", RUNS) == "no such column of the results; did you mean 'seconds'?"


def test_results_load_no_matplotlib() -> None:
    """In a process of its own, which imports every module of nlsolve.results."""
    code = (
        "import pkgutil, sys, importlib, nlsolve.results as top\n"
        "names = [found.name for found in pkgutil.walk_packages(top.__path__, 'nlsolve.results.')]\n"
        "[importlib.import_module(name) for name in names]\n"
        "print(len(names) > 10, 'matplotlib' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.split() == ["True", "False"]


@pytest.mark.parametrize("column", [*RUNS.values(), *LETTERS.values()], ids=lambda column: column.name)
def test_what_a_paper_prints_of_a_column(column: Column) -> None:
    assert column.symbol.count("$") % 2 == 0
    assert 2 <= column.figures <= 3


def test_letters_are_of_parameters() -> None:
    assert all("." in name and name not in RUNS for name in LETTERS)
    assert LETTERS["solver.tolerance"].symbol == r"tolerance $\eta$"
