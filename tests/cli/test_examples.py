"""`nlsolve examples`: the shipped studies are listed with their questions, and copies of them run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.registry.problems import StudyError
from nlsolve.running.packing import shipped
from nlsolve.study.study import Study

STUDIES = Path(__file__).parents[2] / "studies"


def told(*words: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["examples", *words])
    return result.exit_code, result.stdout, result.stderr


def test_every_shipped_study_is_listed_with_its_question():
    code, said, _ = told()
    assert code == 0
    names = {path.relative_to(STUDIES).with_suffix("").as_posix() for path in STUDIES.rglob("*.toml")}
    assert {line.split()[0] for line in said.splitlines() if line and line[0] not in " `"} == names
    assert "How many tangents does a homotopy factorise" in said
    listed = json.loads(told("--json")[1])
    assert {study["name"] for study in listed} == names
    assert all(study["question"].endswith("?") for study in listed)


@pytest.mark.parametrize(("name", "file"), [("first", "first.toml"), ("paper/table-1", "table-1.toml")])
def test_a_copy_is_the_study(name: str, file: str, tmp_path: Path):
    code, said, _ = told(name, str(tmp_path))
    assert code == 0
    assert said.split("\n") == [str(tmp_path / file), "", f"nlsolve run {tmp_path / file} --quick", ""]
    assert (tmp_path / file).read_bytes() == (STUDIES / f"{name}.toml").read_bytes()
    assert Study.from_toml(tmp_path / file, quick=True).cases
    code, _, complaint = told(name, str(tmp_path))
    assert (code, complaint.endswith("is there already, and nothing was written: choose another name or folder\n")) == (
        2,
        True,
    )


def test_all_studies_are_copied_in_their_folders(tmp_path: Path):
    assert told("all", str(tmp_path))[0] == 0
    copies = {path.relative_to(tmp_path) for path in tmp_path.rglob("*.toml")}
    assert copies == {path.relative_to(STUDIES) for path in STUDIES.rglob("*.toml")}


def test_a_study_that_does_not_ship():
    assert told("frist") == (2, "", "frist: no study of this name ships; did you mean 'first'?\n")


def test_studies_that_are_missing_are_said_to_be(monkeypatch):
    monkeypatch.setattr(shipped, "PLACES", (Path("nowhere"),))
    with pytest.raises(StudyError, match=r"the shipped studies are missing, which belong in nowhere: install nlsolve"):
        shipped.shipped_studies()
