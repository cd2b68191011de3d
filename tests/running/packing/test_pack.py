"""A study that is exported runs elsewhere as it is, with its plugins of one file and the studies that it extends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pandas as pd
import pytest
from fakes import solver_text
from typer.testing import CliRunner

import nlsolve
from nlsolve.cli.app import app
from nlsolve.running.packing.study_files import StudyFiles

BASE = 'scene = { kind = "published", problem = "powell-singular" }\n'
STUDY = """question = "Do they run elsewhere?"
extends = "../shared/base.toml"
plugins = ["../shared/one.py", "./two.py", '../three.py']
[[sweep]]
grid = { "solver.kind" = ["one", "two", "three", "four", "newton"] }
[[table]]
name = "work"
rows = "solver.kind"
value = "iterations"
"""


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """A study in a folder beside the one of the study that it extends, with a plugin in each way that there is."""
    place = tmp_path / "here" / "studies"
    place.mkdir(parents=True)
    (tmp_path / "here" / "shared").mkdir()
    places = {"one": "shared/one.py", "two": "studies/two.py", "three": "three.py", "four": "studies/four.py"}
    for kind, file in places.items():
        (tmp_path / "here" / file).write_text(solver_text(kind), encoding="utf-8")
    (tmp_path / "here" / "shared" / "base.toml").write_text(BASE, encoding="utf-8")
    (place / "study.toml").write_text(STUDY, encoding="utf-8")
    monkeypatch.chdir(place)
    return tmp_path


def command(folder: Path, *words: str) -> str:
    """What a command prints in a process of its own in a folder."""
    program = str(Path(sys.executable).with_name("nlsolve"))
    return subprocess.run([program, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def test_an_exported_study_gives_the_same_rows_elsewhere(here):
    command(Path(), "run", "study.toml", "--plugin", "four.py")
    told = CliRunner().invoke(app, ["export", "study.toml", "--plugin", "four.py"])
    assert told.exit_code == 0, told.output
    assert "not in the zip" not in told.stderr
    there = here / "there"
    with ZipFile("study.zip") as pack:
        names = set(pack.namelist())
        pack.extractall(there)
    files = {"study.toml", "beside/base.toml", "beside/one.py", "two.py", "beside/three.py", "beside/four.py"}
    assert files < names
    (here / "here").rename(here / "gone")
    options = ["--plugin", "beside/four.py"]
    assert "nlsolve run study.toml --out results --plugin beside/four.py" in (there / "README.txt").read_text()
    assert "5 kept (results in results)" in command(there, "plan", "study.toml", "--out", "results", *options)
    command(there, "run", "study.toml", "--out", "again", *options)
    rows = [nlsolve.load(there / name).runs.astype(object) for name in ("results", "again")]
    assert len(rows[0]) == 5
    seconds = [name for name in rows[0] if name.startswith("seconds") or name in ("factor_solve_ratio", "lane")]
    pd.testing.assert_frame_equal(*(frame.drop(columns=seconds) for frame in rows))


def test_a_study_that_is_extended_brings_its_plugins(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    (tmp_path / "b" / "x.py").write_text("", encoding="utf-8")
    (tmp_path / "b" / "base.toml").write_text('plugins = ["x.py"]\n', encoding="utf-8")
    study = tmp_path / "a" / "study.toml"
    study.write_text('extends = "../b/base.toml"\n', encoding="utf-8")
    files = StudyFiles(study, "study.toml")
    assert files.texts["study.toml"] == 'extends = "beside/base.toml"\n'
    assert files.texts["beside/base.toml"] == 'plugins = ["x.py"]\n'
    assert list(files.plugins) == ["beside/x.py"]


def test_plugins_of_one_name_keep_it(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "x.py").write_text("", encoding="utf-8")
    study = tmp_path / "a" / "study.toml"
    study.write_text(f'plugins = ["{tmp_path}/a/x.py", "../b/x.py"]\n', encoding="utf-8")
    files = StudyFiles(study, "study.toml")
    assert files.texts == {"study.toml": 'plugins = ["beside/x.py", "beside-2/x.py"]\n'}
    assert sorted(files.plugins) == ["beside-2/x.py", "beside/x.py"]
    assert files.add_plugin(tmp_path / "b" / "x.py") == "beside-2/x.py"


def test_a_name_that_cannot_be_changed_is_told(tmp_path):
    (tmp_path / "x.py").write_text("", encoding="utf-8")
    (tmp_path / "a").mkdir()
    study = tmp_path / "a" / "study.toml"
    study.write_text('plugins = ["..\\u002Fx.py"]\n', encoding="utf-8")
    files = StudyFiles(study, "study.toml")
    assert [path.resolve() for path in files.missing] == [tmp_path / "x.py"]
    assert files.plugins == {}
