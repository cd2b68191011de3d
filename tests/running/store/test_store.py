"""Results folders: whole files only, every case remembered by what determines it, honest when they cannot be used."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from fakes import registry_of, write_study

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS
from nlsolve.results.frames import Part
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import StoreError, merge
from nlsolve.running.store.reading import read_tables
from nlsolve.running.store.store import Store
from nlsolve.study.study import Study


@pytest.fixture
def study(tmp_path) -> Study:
    return Study.from_toml(write_study(tmp_path), registry=registry_of())


def part(study: Study, number: int = 0, **run) -> Part:
    case = study.cases[number]
    measured = {"status": "converged", "message": "", "tangents": 3, "rounds": 1, "clock": "processor"}
    return Part(
        {"case": case.id, **measured, **run, **case.parameters},
        pd.DataFrame({"case": case.id, "range": [1.0, None]}),
        pd.DataFrame({"case": [case.id], "u": [1.0]}),
    )


def key(study: Study, number: int = 0) -> str:
    return identity_of(study.cases[number]).key


def test_a_part_comes_back_as_it_was(tmp_path, study):
    store = Store(tmp_path / "out", study)
    kept = part(study, ordering=None, velocity_error=0.5)
    assert store.load(study.cases[0]) is None
    store.save(study.cases[0], kept)
    found = store.load(study.cases[0])
    assert found is not None
    assert found.run == kept.run
    pd.testing.assert_frame_equal(found.steps, kept.steps)
    pd.testing.assert_frame_equal(found.fields, kept.fields)
    assert not list((tmp_path / "out").rglob(".*")), "temporary files are gone"


def test_numbers_keep_every_digit_and_their_type(tmp_path, study):
    store = Store(tmp_path / "out", study)
    values = {"a": 0.1 + 0.2, "b": 1e-300, "c": float("inf"), "d": 7, "e": True, "f": None, "g": "é"}
    store.save(study.cases[0], part(study, nan=float("nan"), **values))
    found = store.load(study.cases[0])
    assert found is not None
    assert {name: found.run[name] for name in values} == values
    assert [type(found.run[name]) for name in values] == [type(value) for value in values.values()]
    assert found.run["nan"] != found.run["nan"]


@pytest.mark.parametrize("name", ["json", "steps.parquet", "fields.parquet"])
@pytest.mark.parametrize("damage", ["cut", "emptied", "removed", "overwritten"])
def test_a_damaged_part_does_not_count(tmp_path, study, name, damage):
    store = Store(tmp_path / "out", study)
    store.save(study.cases[0], part(study))
    path = tmp_path / "out" / "cases" / f"{key(study)}.{name}"
    if damage == "removed":
        path.unlink()
    else:
        content = path.read_bytes()
        path.write_bytes({"cut": content[:-20], "emptied": b"", "overwritten": b"[" * len(content)}[damage])
    assert store.load(study.cases[0]) is None


def test_a_crashed_case_and_a_stray_row_do_not_count(tmp_path, study):
    store = Store(tmp_path / "out", study)
    store.save(study.cases[0], part(study, status=Status.CRASHED.word))
    assert Store(tmp_path / "out", study).load(study.cases[0]) is None
    store.save(study.cases[0], part(study))
    cases = tmp_path / "out" / "cases"
    for name in ("json", "steps.parquet", "fields.parquet"):
        (cases / f"{key(study)}.{name}").rename(cases / f"{key(study, 1)}.{name}")
    assert store.load(study.cases[1]) is None


def test_a_folder_remembers_all_its_cases_and_a_study_shows_its_own(tmp_path, study):
    """One more value, another question, another parameter, and the first study again."""
    path = write_study(tmp_path)
    store = Store(tmp_path / "out", study)
    for number, case in enumerate(study.cases):
        store.save(case, part(study, number, tangents=number))
    asked = Study.from_toml(path, {"question": "Why?"}, registry=registry_of())
    other = Study.from_toml(path, {"law.index": 0.3}, registry=registry_of())
    grown = Study.from_toml(write_study(tmp_path, ("[10, 20]", "[5, 10, 20]")), registry=registry_of())

    def words(study: Study) -> list[str]:
        return list(plan_of(study, tmp_path / "out").cases["plan"])

    assert words(grown) == ["new", "new", "kept", "kept", "kept", "kept"]
    assert words(asked) == ["kept"] * 4
    assert words(other) == ["new"] * 4
    loaded = Store(tmp_path / "out", other).load(other.cases[0])
    assert loaded is None
    found = [Store(tmp_path / "out", grown).load(case) for case in grown.cases]
    assert [None if part is None else part.run["tangents"] for part in found] == [None, None, 0, 1, 2, 3]
    assert words(study) == ["kept"] * 4
    described, runs = read_tables(tmp_path / "out")
    assert (len(described.cases), len(runs)) == (6, 4)


def test_a_part_is_shown_under_the_names_of_the_study_that_asks(tmp_path):
    def named(name: str) -> Study:
        settings = f'each = [{{ name = "{name}", "solver.order" = 10 }}, {{ name = "b", "solver.order" = 20 }}]'
        grid = 'grid = { "solver.order" = [10, 20], "solver.tolerance" = [1e-6, 1e-8] }'
        table = ('rows = "solver.order"\ncolumns = "solver.tolerance"', 'rows = "variant"\ncolumns = "law.index"')
        return Study.from_toml(write_study(tmp_path, (grid, settings), table), registry=registry_of())

    first, again = named("a"), named("ten")
    store = Store(tmp_path / "out", first)
    store.save(first.cases[0], part(first))
    loaded = Store(tmp_path / "out", again).load(again.cases[0])
    assert loaded is not None
    assert loaded.run["variant"] == "ten"
    _, runs = read_tables(tmp_path / "out")
    assert runs["variant"].tolist() == ["ten"]


@pytest.mark.parametrize("status", ["crashed", "not applicable", "condensed"])
def test_a_part_without_a_usable_ending_is_computed_again(tmp_path, study, status):
    store = Store(tmp_path / "out", study)
    store.save(study.cases[0], part(study, 0))
    assert store.load(study.cases[0]) is not None
    store.save(study.cases[0], part(study, 0, status=status))
    assert Store(tmp_path / "out", study).load(study.cases[0]) is None


def test_why_a_case_is_run(tmp_path, study):
    store = Store(tmp_path / "out", study)
    store.save(study.cases[0], part(study, 0))
    store.save(study.cases[1], part(study, 1, status="crashed"))
    store.save(study.cases[2], part(study, 2))
    (tmp_path / "out" / "cases" / f"{key(study, 2)}.steps.parquet").unlink()
    words = list(plan_of(study, tmp_path / "out").cases["plan"])
    assert words == ["kept", "retried (crashed)", "damaged", "new"]
    timed = Study.from_toml(write_study(tmp_path), {"timing.rounds": 2}, registry=registry_of())
    assert plan_of(timed, tmp_path / "out").cases["plan"][0] == "timed again"
    assert plan_of(study, tmp_path / "nowhere").cases["plan"][0] == "new"
    assert not (tmp_path / "nowhere").exists()


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


def test_a_folder_of_an_older_nlsolve_is_one_sentence(tmp_path, study):
    (tmp_path / "out" / "cases").mkdir(parents=True)
    (tmp_path / "out" / "cases" / f"{study.cases[0].id}.runs.parquet").write_bytes(b"PAR1")
    for use in (lambda: Store(tmp_path / "out", study), lambda: read_tables(tmp_path / "out")):
        with pytest.raises(StoreError, match=r"written by an older nlsolve.*choose another folder with --out"):
            use()


@pytest.mark.parametrize("content", ["", "{", "{}", "[]", '{"name": 3, "question": "?", "cases": [1], "tables": []}'])
def test_a_damaged_description_costs_nothing_but_itself(tmp_path, study, content):
    store = Store(tmp_path / "out", study)
    store.save(study.cases[0], part(study))
    (tmp_path / "out" / "study.json").write_text(content)
    with pytest.raises(StoreError, match=r"study\.json cannot be read.*no case is lost: run the study again"):
        read_tables(tmp_path / "out")
    assert Store(tmp_path / "out", study).load(study.cases[0]) is not None
    assert len(read_tables(tmp_path / "out")[1]) == 1


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


def test_tables_are_read_from_the_parts(tmp_path, study):
    store = Store(tmp_path / "out", study)
    for number, case in enumerate(study.cases[:3]):
        store.save(case, part(study, number))
    described, runs = read_tables(tmp_path / "out")
    assert [table.name for table in described.tables] == ["branches"]
    assert runs["case"].tolist() == [case.id for case in study.cases[:3]]


def test_an_environment_is_stored_once(tmp_path, study):
    store = Store(tmp_path / "out", study)
    for number, case in enumerate(study.cases):
        store.save(case, Part(part(study, number).run, pd.DataFrame(), pd.DataFrame(), {"numpy": "2.0"}))
    (stored,) = (tmp_path / "out" / "environments").iterdir()
    assert json.loads(stored.read_text()) == {"numpy": "2.0"}
    assert store.parts.environment(stored.stem) == {"numpy": "2.0"}
    assert store.parts.environment("unknown") == {}
