"""Results folders: whole files only, one study each, resumed, and honest when they cannot be used."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from fakes import registry_of, write_study

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS
from nlsolve.running.store import Part, Store, StoreError, merge, read_tables
from nlsolve.study.study import Study


@pytest.fixture
def study(tmp_path) -> Study:
    return Study.from_toml(write_study(tmp_path), registry=registry_of())


def part(study: Study, number: int = 0, **run) -> Part:
    case = study.cases[number]
    row = {"case": case.id, "status": "converged", "message": "", "tangents": 3, **run, **case.parameters}
    return Part(
        row, pd.DataFrame({"case": case.id, "range": [1.0, None]}), pd.DataFrame({"case": [case.id], "u": [1.0]})
    )


def test_a_part_comes_back_as_it_was(tmp_path, study):
    store = Store(tmp_path / "out", study)
    kept = part(study, ordering=None, velocity_error=0.5)
    assert store.load(study.cases[0].id) is None
    store.save(kept)
    found = store.load(study.cases[0].id)
    assert found is not None
    assert found.run == kept.run
    pd.testing.assert_frame_equal(found.steps, kept.steps)
    assert not list((tmp_path / "out").rglob(".*")), "temporary files are gone"


@pytest.mark.parametrize("name", ["runs", "steps", "fields"])
@pytest.mark.parametrize("damage", ["cut", "emptied", "removed"])
def test_a_damaged_part_does_not_count(tmp_path, study, name, damage):
    store = Store(tmp_path / "out", study)
    store.save(part(study))
    path = tmp_path / "out" / "cases" / f"{study.cases[0].id}.{name}.parquet"
    if damage == "removed":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-20] if damage == "cut" else b"")
    assert store.load(study.cases[0].id) is None


def test_a_crashed_case_and_a_stray_row_do_not_count(tmp_path, study):
    store = Store(tmp_path / "out", study)
    store.save(part(study, status=Status.CRASHED.word))
    assert store.load(study.cases[0].id) is None
    store.save(part(study))
    cases = tmp_path / "out" / "cases"
    for name in ("runs", "steps", "fields"):
        (cases / f"{study.cases[0].id}.{name}.parquet").rename(cases / f"{study.cases[1].id}.{name}.parquet")
    assert store.load(study.cases[1].id) is None


def test_another_study_or_other_settings(tmp_path, study):
    Store(tmp_path / "out", study)
    Store(tmp_path / "out", study)
    path = write_study(tmp_path)
    other = Study.from_toml(path, {"law.index": 0.3}, registry=registry_of())
    with pytest.raises(StoreError, match=r"another study.*choose another folder with --out"):
        Store(tmp_path / "out", other)
    asked = Study.from_toml(path, {"question": "Why?"}, registry=registry_of())
    with pytest.raises(StoreError, match="How many branches"):
        Store(tmp_path / "out", asked)
    retitled = Study.from_toml(write_study(tmp_path, ('name = "branches"', 'name = "b"')), registry=registry_of())
    Store(tmp_path / "out", retitled)
    assert json.loads((tmp_path / "out" / "study.json").read_text())["tables"][0]["name"] == "b"


@pytest.mark.parametrize("status", ["crashed", "not applicable", "condensed"])
def test_a_part_without_a_usable_ending_is_computed_again(tmp_path, study, status):
    store = Store(tmp_path / "out", study)
    store.save(part(study, 0))
    assert store.load(study.cases[0].id) is not None
    store.save(part(study, 0, status=status))
    assert store.load(study.cases[0].id) is None


def test_a_folder_that_cannot_be_written(tmp_path, study):
    (tmp_path / "file").write_text("")
    with pytest.raises(
        StoreError, match=r"cannot be written there \(Not a directory\): choose another folder with --out"
    ):
        Store(tmp_path / "file" / "out", study)


def test_a_folder_of_something_else(tmp_path, study):
    (tmp_path / "study.json").write_text("[]")
    with pytest.raises(StoreError, match="not a results folder"):
        Store(tmp_path, study)
    with pytest.raises(StoreError, match=r"not a results folder: it has no readable study\.json"):
        read_tables(tmp_path / "nowhere")
    Store(tmp_path / "out", study)
    with pytest.raises(StoreError, match="no finished cases"):
        read_tables(tmp_path / "out")


def test_merged_frames_have_documented_columns_first(study):
    frames = merge([part(study, 0), part(study, 1)])
    assert list(frames.runs.columns[: len(RUNS)]) == list(RUNS)
    assert list(frames.runs.columns[len(RUNS) :]) == list(study.cases[0].parameters)
    assert frames.runs["case"].tolist() == [case.id for case in study.cases[:2]]
    assert len(frames.steps) == 4
    empty = merge([Part({"case": "x", "status": "crashed"}, pd.DataFrame(), pd.DataFrame())])
    assert (len(empty.runs), len(empty.steps)) == (1, 0)
    assert "range" in empty.steps


def test_files_and_mixed_parameters(tmp_path, study):
    store = Store(tmp_path / "out", study)
    frames = merge([part(study, 0, **{"odd": 1}), part(study, 1, **{"odd": "one"}), part(study, 2)])
    store.write_frames(frames)
    folder = tmp_path / "out"
    assert {path.name for path in folder.iterdir() if path.is_file()} == {
        "study.json",
        "runs.parquet",
        "runs.csv",
        "steps.parquet",
        "steps.csv",
        "fields.parquet",
    }
    assert pd.read_parquet(folder / "runs.parquet")["odd"].tolist()[:2] == ["1", "one"]
    assert pd.read_csv(folder / "runs.csv")["tangents"].tolist() == [3, 3, 3]
    specs, runs = read_tables(folder)
    assert (specs[0].name, len(runs)) == ("branches", 3)
