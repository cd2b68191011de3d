"""Results folders read without a study, put together, tidied up, and packed for a referee."""

from __future__ import annotations

import json
from pathlib import Path
from zipfile import ZipFile

import pandas as pd
import pytest
from fakes import STUDY, fake_march, registry_of, write_study
from typer.testing import CliRunner

import nlsolve
from nlsolve.cli.app import app
from nlsolve.running.store.claims import Claims
from nlsolve.running.store.identity import Identity, identity_of
from nlsolve.running.store.parts import Parts, StoreError
from nlsolve.running.store.reading import status_of_folder
from nlsolve.running.store.store import Store
from nlsolve.running.store.upkeep import Merged, merge_folders, superfluous
from nlsolve.study.study import Study


@pytest.fixture(autouse=True)
def fake(monkeypatch, tmp_path):
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", fake_march)
    monkeypatch.chdir(tmp_path)


def run(orders: str = "[10, 20]", out: str = "out", **overrides: object) -> Study:
    path = write_study(Path(), ("[10, 20]", orders))
    return nlsolve.run(path, out, overrides=overrides).study


def told(*arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == code, result.output
    return result.stdout if code == 0 else result.stderr


def names(folder: str) -> set[str]:
    return {str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file()}


def superseded(folder: str, study: Study, number: int = 0) -> Identity:
    """Rewrite the part of a case as another source would have written it, a day earlier."""
    identity = identity_of(study.cases[number])
    old = Identity(identity.case, {**identity.code, "nlsolve": "old"}, identity.files)
    parts = Parts(Path(folder))
    held = json.loads((Path(folder) / "cases" / f"{identity.key}.json").read_text())
    held |= {"identity": old.plain(), "written": held["written"] - 86400}
    for name in ("steps", "fields"):
        source = Path(folder) / "cases" / f"{identity.key}.{name}.parquet"
        source.with_name(f"{old.key}.{name}.parquet").write_bytes(source.read_bytes())
    (Path(folder) / "cases" / f"{old.key}.json").write_text(json.dumps(held))
    assert parts.entry(old.key) is not None
    return old


def test_a_folder_is_loaded_without_its_study_file():
    ran = nlsolve.run(write_study(Path()), "out")
    Path("study.toml").unlink()
    loaded = nlsolve.load("out")
    pd.testing.assert_frame_equal(loaded.runs, ran.runs, check_dtype=False)
    pd.testing.assert_frame_equal(loaded.steps, ran.steps, check_dtype=False)
    pd.testing.assert_frame_equal(loaded.fields, ran.fields, check_dtype=False)
    assert (loaded.study.name, loaded.study.question, loaded.notes) == ("study", "How many branches?", ())
    assert loaded.table("branches").loc[20, 1e-8] == 40


def test_what_is_finished_is_loaded_and_the_rest_is_told():
    study = run()
    (Path("out/cases") / f"{identity_of(study.cases[1]).key}.json").write_text("{")
    loaded = nlsolve.load("out")
    assert loaded.notes == ("3 of 4 cases are finished",)
    assert loaded.runs["tangents"].tolist() == [60, 30, 40]


def test_a_folder_without_a_description_gives_what_one_source_has_computed():
    study = run()
    superseded("out", study)
    Path("out/study.json").write_text("damaged")
    loaded = nlsolve.load("out")
    assert sorted(loaded.runs["tangents"]) == [30, 40, 60, 80]
    assert loaded.tables() == []
    (Path("out/cases") / f"{identity_of(study.cases[0]).key}.json").unlink()
    assert sorted(nlsolve.load("out").runs["tangents"]) == [30, 40, 80], "the old source is not mixed in"


def test_nothing_to_load_is_a_sentence():
    with pytest.raises(StoreError, match="nowhere: no finished cases can be read there"):
        nlsolve.load("nowhere")


def test_status_is_told_from_parts_and_claims():
    study = run()
    keys = [identity_of(case).key for case in study.cases]
    crashed = json.loads(Path(f"out/cases/{keys[1]}.json").read_text())
    crashed["measured"] |= {"status": "crashed", "message": "ZeroDivisionError: no"}
    Path(f"out/cases/{keys[1]}.json").write_text(json.dumps(crashed))
    for key in keys[2:]:
        Path(f"out/cases/{key}.json").unlink()
    superseded("out", study)
    claims = Claims(Path("out"))
    assert claims.take(keys[2])
    found = status_of_folder(Path("out"))
    assert (found.planned, found.endings) == (4, {"converged": 1, "crashed": 1})
    assert (found.running, found.left, found.others) == ((keys[2],), 1, 1)
    assert found.failures == {study.cases[1].id: "ZeroDivisionError: no"}
    document = json.loads(told("status", "out", "--json"))
    assert [document[name] for name in ("cases", "finished", "left", "others")] == [4, 2, 1, 1]
    text = told("status", "out")
    assert "out: How many branches?" in text
    assert "2 of 4 cases finished (1 converged, 1 crashed)" in text
    assert "1 running, 1 left" in text
    assert "1 case more, of other studies" in text
    claims.release_all()
    Path("out/study.json").unlink()
    unknown = told("status", "out").splitlines()
    assert unknown[0].endswith("what is left is not known")
    assert unknown[1:] == ["3 cases finished (2 converged, 1 crashed)", "0 running"]
    assert json.loads(told("status", "out", "--json"))["left"] is None
    assert "not a results folder" in told("status", "nowhere", code=2)


def test_folders_merge_by_copying():
    first, second = run("[10]", "a"), run("[20]", "b")
    assert merge_folders(Path("a"), Path("b")) == Merged(2, 0, 0)
    whole = run("[10, 20]", "b")
    assert len(list(Path("b/cases").glob("*.json"))) == 4
    assert {case.id for case in whole.cases} == {case.id for study in (first, second) for case in study.cases}
    assert told("merge", "a", "b") == "b: 0 cases copied from a, 2 there already\n"
    assert told("merge", "b", "new") == "new: 4 cases copied from b, 0 there already\n"
    assert nlsolve.load("new").runs["tangents"].tolist() == [60, 80, 30, 40]
    assert {name for name in names("b") if name.startswith(("cases/", "environments/"))} < names("new")
    assert "nowhere: not a results folder" in told("merge", "nowhere", "b", code=2)


def test_a_merge_takes_the_case_that_did_not_fail_and_leaves_out_damage():
    study = run(out="a")
    run(out="b")
    keys = [identity_of(case).key for case in study.cases]
    held = json.loads(Path(f"b/cases/{keys[0]}.json").read_text())
    held["measured"]["status"] = "crashed"
    Path(f"b/cases/{keys[0]}.json").write_text(json.dumps(held))
    Path(f"a/cases/{keys[1]}.json").write_text("{")
    assert "1 case copied from a, 2 there already, 1 damaged and left out" in told("merge", "a", "b")
    assert set(nlsolve.load("b").runs["status"]) == {"converged"}


def test_gc_removes_what_nothing_needs():
    study = run()
    before = names("out")
    old = superseded("out", study)
    Path("out/cases/.x.json.1234.partial").write_text("")
    Path("out/environments/unused.json").write_text("{}")
    Path("out/claims").mkdir(exist_ok=True)
    Path("out/claims/dead.lock").write_text("")
    Path("out/cases/stray.steps.parquet").write_text("")
    gone = names("out") - before
    assert {str(path.relative_to("out")) for path in superfluous(Path("out"))} == gone
    assert set(told("gc", "out", "--dry-run").split()) == {f"out/{name}" for name in gone}
    assert f"out: {len(gone)} files removed" in told("gc", "out")
    assert names("out") == before
    assert Parts(Path("out")).entry(old.key) is None
    assert told("gc", "out") == "out: 0 files removed, 0 MB\n"


def test_gc_keeps_the_cases_of_other_studies_unless_it_is_told():
    run()
    run("[10]")
    assert superfluous(Path("out")) == []
    assert len(superfluous(Path("out"), others=True)) == 2 * 3
    assert "6 files removed" in told("gc", "out", "--others")
    assert len(nlsolve.load("out").runs) == 2
    Path("out/study.json").unlink()
    assert superfluous(Path("out")) == []
    assert "which tells the study's own cases" in told("gc", "out", "--others", code=2)
    assert "not a results folder" in told("gc", "nowhere", code=2)


def test_gc_leaves_a_run_alone():
    study = run()
    identity = identity_of(study.cases[0])
    Path(f"out/cases/{identity.key}.json").unlink()
    Path("out/cases/.x.json.1234.partial").write_text("")
    claims = Claims(Path("out"))
    assert claims.take(identity.key)
    assert superfluous(Path("out")) == []
    claims.release_all()
    assert len(superfluous(Path("out"))) == 3


def test_an_export_can_be_run_again(tmp_path):
    run("[10, 20]", "results/study")
    run("[5]", "results/study")
    path = write_study(Path())
    assert told("export", str(path), "--set", "law.index=0.5").startswith("study.zip: ")
    with ZipFile("study.zip") as pack:
        pack.extractall("there")
    assert "nlsolve run study.toml --out results --set law.index=0.5" in Path("there/README.txt").read_text()
    assert "numpy: " in Path("there/versions.txt").read_text()
    assert Path("there/study.toml").read_text() == STUDY
    assert len(list(Path("there/results/cases").glob("*.json"))) == 4, "of this study only"
    document = json.loads(told("plan", "there/study.toml", "--out", "there/results", "--json"))
    assert {row["plan"] for row in document["cases"]} == {"kept"}
    assert "nothing of this study is finished there" in told("export", str(path), "--out", "nowhere", code=2)
    assert "cannot be written there" in told("export", str(path), "--to", "study.toml/x.zip", code=2)


def test_an_export_has_the_files_that_the_study_reads(monkeypatch, tmp_path):
    """Those whose names lead out of the folder are told."""
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", fake_march)
    Path("nodes").mkdir()
    Path("nodes/a.csv").write_text("x,y,group\n")
    Path("b.csv").write_text("x,y,group\n")
    outside = Path("b.csv").resolve()
    scene = 'scene = { kind = "channel", nodes = { kind = "file", path = "nodes/a.csv" } }\n'
    rest = 'question = "?"\nlaw.kind = "power-law"\ndiscretizer.kind = "mls"\nsolver.kind = "newton"\n'
    sweep = f'[[sweep]]\ngrid = {{ "scene.nodes.path" = ["nodes/a.csv", "{outside}"] }}\n'
    Path("study.toml").write_text(rest + scene + sweep)
    nlsolve.run("study.toml", "out")
    result = CliRunner().invoke(app, ["export", "study.toml", "--out", "out", "--to", "z.zip"])
    assert result.exit_code == 0
    assert f"{outside} is not in the zip" in result.stderr
    with ZipFile("z.zip") as pack:
        assert "nodes/a.csv" in pack.namelist()


def test_a_store_reads_what_was_merged():
    study = run(out="a")
    merge_folders(Path("a"), Path("b"))
    assert all(Store(Path("b"), study).load(case) is not None for case in study.cases)
