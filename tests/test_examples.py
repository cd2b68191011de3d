"""The examples run as they stand, are short, and use what is public only."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from nlsolve.registry.registry import Registry
from nlsolve.testing import check_law

EXAMPLES = Path(__file__).parent.parent / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
MOST_LINES = 40
PUBLIC = {"nlsolve", "nlsolve.plugin", "nlsolve.testing"}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_is_short_and_uses_public_names(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < MOST_LINES
    for node in ast.walk(ast.parse(text)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert {name for name in names if name.split(".")[0] == "nlsolve"} <= PUBLIC


def test_the_law_keeps_its_contract_and_prints_its_viscosity(capsys):
    module = runpy.run_path(str(EXAMPLES / "law_in_one_file.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.splitlines()[0].split()[:1] == ["μ"]
    check_law(module["Ellis"]())
    assert module["Ellis"]().viscosity(np.array([1.0])) == pytest.approx(50.0, rel=1e-15)


def test_the_law_is_a_plugin():
    module = ModuleType("law_in_one_file")
    module.__dict__.update(runpy.run_path(str(EXAMPLES / "law_in_one_file.py")))
    registry = Registry()
    registry.add(module, "example 1.0")
    assert list(registry.classes("law")) == ["ellis"]


def test_the_study_prints_its_table(capsys):
    results = runpy.run_path(str(EXAMPLES / "study_in_python.py"))["results"]
    assert (results.runs["status"] == "converged").all()
    table = results.table("work")
    assert table.loc["newton", "powell-singular"] > table.loc["modified-newton", "powell-singular"] > 0
    assert "the stopping test was met" in capsys.readouterr().out


def test_the_frames_read_with_pandas_hold_each_residual(capsys):
    frames = runpy.run_path(str(EXAMPLES / "results_in_pandas.py"))
    assert len(frames["runs"]) == 4
    last = frames["residuals"].groupby("scene.strength")["residual_norm"].last()
    assert (last < 1e-7).all()
    assert "3.5" in capsys.readouterr().out
