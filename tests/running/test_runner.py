"""Running a study: a row for every ending, a part for every finished case, nothing computed twice."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pytest
from fakes import COMPONENTS, STUDY, Box, fake_march, registry_of, write_study
from pydantic import BaseModel
from threadpoolctl import threadpool_info

import nlsolve
from nlsolve.plugin import InputFile
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import FIELDS, RUNS, STEPS
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.results import Results
from nlsolve.running.runner import Event, run
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.store import Store
from nlsolve.study.study import Study

FIGURE = '[[figure]]\nkind = "line"\nname = "range"\ny = "range"\ngroup = ["solver.order", "solver.tolerance"]\n[quick]'


class Read(BaseModel):
    """Nodes of a file."""

    kind: Literal["read"] = "read"
    path: InputFile


class ReadingBox(Box):
    """A box whose nodes are read."""

    nodes: Read


@pytest.fixture
def study(tmp_path) -> Study:
    return Study.from_toml(write_study(tmp_path), registry=registry_of())


@pytest.fixture(autouse=True)
def marched(monkeypatch) -> list:
    """The parts of the cases that were run; the run itself is replaced."""
    cases: list = []

    def march(parts, listen, clock, **way):
        cases.append(parts)
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    return cases


def failing_on(monkeypatch, number: int, error: BaseException) -> None:
    """The march of one case, by number from 1, raises."""
    count = 0

    def march(parts, listen, clock, **way):
        nonlocal count
        count += 1
        if count == number:
            raise error
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)


def test_in_memory(study, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    results = run(study)
    assert isinstance(results, Results)
    assert results.folder is None
    assert results.runs["tangents"].tolist() == [60, 80, 30, 40]
    assert results.runs["case"].tolist() == [case.id for case in study.cases]
    assert list(results.runs.columns) == [*RUNS, *study.cases[0].parameters]
    assert set(results.steps.columns) <= set(STEPS)
    assert results.steps.columns[0] == results.fields.columns[0] == "case"
    assert set(results.fields.columns) <= set(FIELDS)
    assert len(results.steps) == 8
    assert results.table("branches").loc[20, 1e-8] == 40
    assert sorted(tmp_path.rglob("*")) == before
    with pytest.raises(StudyError, match="no table 'branch'; did you mean 'branches'"):
        results.table("branch")


def test_files(tmp_path):
    study = Study.from_toml(write_study(tmp_path, ("[quick]", FIGURE)), registry=registry_of())
    results = run(study, tmp_path / "out")
    folder = tmp_path / "out"
    names = {
        str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file() and path.parent.name != "cases"
    }
    tables = {f"tables/branches{ending}" for ending in (".csv", ".md", ".tex")} | {"tables/preamble.tex"}
    figures = {"figures/range.png", "figures/range.pdf", "figures/range.csv"}
    frames = {"runs.parquet", "runs.csv", "steps.parquet", "steps.csv", "fields.parquet"}
    (environment,) = results.runs["environment"].unique()
    assert names == tables | figures | frames | {
        "study.json",
        "shown.json",
        "report.html",
        f"environments/{environment}.json",
    }
    assert results.notes == ()
    assert pd.read_parquet(folder / "runs.parquet")["tangents"].tolist() == [60, 80, 30, 40]
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "How many branches?" in report
    assert f"{environment}: 4 rows" in report


def test_two_tables_under_one_caption_are_both_in_the_report(tmp_path):
    twin = """[[table]]
name = "twin"
caption = "branches"
rows = "solver.order"
columns = "solver.tolerance"
value = "factorizations"

[quick]"""
    run(Study.from_toml(write_study(tmp_path, ("[quick]", twin)), registry=registry_of()), tmp_path / "out")
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h2>branches</h2>" in report
    assert "<h2>branches (twin)</h2>" in report


def test_a_second_run_computes_nothing_and_says_the_same(study, tmp_path, marched):
    first = run(study, tmp_path / "out")
    again = run(study, tmp_path / "out")
    assert len(marched) == 4
    pd.testing.assert_frame_equal(first.runs, again.runs, check_dtype=False)
    pd.testing.assert_frame_equal(first.steps, again.steps)


@pytest.mark.parametrize("gone", ["report.html", "tables/branches.csv", "steps.parquet", "shown.json"])
def test_what_is_shown_is_made_again_when_it_is_gone_or_damaged(study, tmp_path, gone, marched):
    first = run(study, tmp_path / "out")
    content = (tmp_path / "out" / gone).read_bytes()
    (tmp_path / "out" / gone).unlink()
    again = run(study, tmp_path / "out")
    assert (tmp_path / "out" / gone).exists()
    if not gone.endswith(("html", "json")):  # these have times in them
        assert (tmp_path / "out" / gone).read_bytes() == content
    pd.testing.assert_frame_equal(first.runs, again.runs, check_dtype=False)
    assert len(marched) == 4


def test_a_second_run_writes_nothing(study, tmp_path):
    run(study, tmp_path / "out")
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*") if path.name != "study.json"}
    again = run(study, tmp_path / "out")
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert again.table("branches").loc[20, 1e-8] == 40
    retitled = Study.from_toml(write_study(tmp_path, ('name = "branches"', 'name = "b"')), registry=registry_of())
    run(retitled, tmp_path / "out")
    assert (tmp_path / "out" / "tables" / "b.csv").exists()


def test_a_damaged_part_is_run_again(study, tmp_path, marched):
    run(study, tmp_path / "out")
    (tmp_path / "out" / "cases" / f"{identity_of(study.cases[2]).key}.steps.parquet").write_bytes(b"PAR1")
    results = run(study, tmp_path / "out")
    assert [parts.solver.order for parts in marched[4:]] == [20]
    assert results.runs["case"].tolist() == [case.id for case in study.cases]


def test_a_crash_is_a_row_that_says_what_and_where(study, tmp_path, monkeypatch, marched):
    failing_on(monkeypatch, 2, ZeroDivisionError("by a plugin"))
    results = run(study, tmp_path / "out")
    assert results.runs["status"].tolist() == ["converged", "crashed", "converged", "converged"]
    assert results.crashed == 1
    message = results.runs["message"].iloc[1]
    assert message.startswith("ZeroDivisionError: by a plugin (")
    assert f"{Path(__file__).name}:" in message
    assert results.runs["solver.tolerance"].iloc[1] == 1e-8
    assert np.isnan(results.runs["tangents"].iloc[1])
    assert results.table("branches").loc[10, 1e-8] == "crashed"
    failing_on(monkeypatch, 99, ZeroDivisionError())
    assert run(study, tmp_path / "out").runs["status"].tolist() == ["converged"] * 4


def test_an_interruption_leaves_what_is_finished(study, tmp_path, monkeypatch, marched):
    march = nlsolve.running.engines.execution.run_case
    failing_on(monkeypatch, 3, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run(study, tmp_path / "out")
    assert pd.read_parquet(tmp_path / "out" / "runs.parquet")["tangents"].tolist() == [60, 80]
    assert len(pd.read_csv(tmp_path / "out" / "steps.csv")) == 4
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    assert run(study, tmp_path / "out").runs["tangents"].tolist() == [60, 80, 30, 40]
    assert len(marched) == 2, "the two finished cases were not run again"


def test_the_frames_are_not_written_anew_for_every_case(study, tmp_path, monkeypatch):
    """Parts are kept one by one; a thousand short cases would spend their time on writing what is written again."""
    written = []
    write = Store.write_frames
    monkeypatch.setattr(Store, "write_frames", lambda store, frames: written.append(write(store, frames)))
    run(study, tmp_path / "out")
    assert len(written) == 1
    monkeypatch.setattr("nlsolve.running.runner.SECONDS_BETWEEN_FRAMES", -1.0)
    run(study, tmp_path / "other")
    assert len(written) == 1 + len(study.cases) + 1


def test_a_grown_study_computes_what_is_new(study, tmp_path, marched):
    """One more value, then another question and table, then a setting by hand, then the first study again."""
    run(study, tmp_path / "out")
    path = write_study(tmp_path, ("[10, 20]", "[10, 15, 20]"), ("How many", "How few"), ('name = "b', 'name = "c'))
    grown = run(Study.from_toml(path, registry=registry_of()), tmp_path / "out")
    assert [parts.solver.order for parts in marched[4:]] == [15, 15]
    assert grown.runs["tangents"].tolist() == [60, 80, 40, 53, 30, 40]
    run(Study.from_toml(path, {"law.index": 0.3}, registry=registry_of()), tmp_path / "out")
    assert len(marched) == 12
    again = run(study, tmp_path / "out")
    assert len(marched) == 12
    assert again.runs["case"].tolist() == [case.id for case in study.cases]
    assert pd.read_parquet(tmp_path / "out" / "runs.parquet")["tangents"].tolist() == [60, 80, 30, 40]


def test_a_case_whose_file_changes_while_it_runs_is_not_kept(tmp_path, monkeypatch):
    place = tmp_path / "nodes.csv"
    place.write_text("old", encoding="utf-8")
    nodes = ('kind = "box"', f'kind = "box"\nnodes = {{ kind = "read", path = "{place}" }}')
    study = Study.from_toml(write_study(tmp_path, nodes), registry=registry_of(ReadingBox, *COMPONENTS[1:]))

    def march(parts, listen, clock, **way):
        place.write_text("new", encoding="utf-8")
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    assert len(run(study, tmp_path / "out").runs) == 4
    words = dict(plan_of(study, tmp_path / "out").cases[["case", "plan"]].to_numpy())
    assert list(words.values()) == ["new", "kept", "kept", "kept"], "the first case began with the old file"


def test_events(study, tmp_path):
    events: list[Event] = []
    run(study, tmp_path / "out", listen=events.append)
    assert [(e.number, e.progress is not None, e.run is not None) for e in events[:3]] == [
        (1, False, False),
        (1, True, False),
        (1, False, True),
    ]
    assert len(events) == 12
    events.clear()
    run(study, tmp_path / "out", listen=events.append)
    assert [(e.number, e.resumed) for e in events] == [(1, True), (2, True), (3, True), (4, True)]


def test_a_case_has_one_thread(study, monkeypatch):
    seen = []

    def march(parts, listen, clock, **way):
        seen.extend(pool["num_threads"] for pool in threadpool_info())
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    run(study)
    assert seen
    assert set(seen) == {1}


def test_a_figure_that_cannot_be_drawn_is_a_note(tmp_path):
    figure = FIGURE.replace('"range"\ngroup', '"contraction"\ngroup')
    study = Study.from_toml(write_study(tmp_path, ("[quick]", figure)), registry=registry_of())
    results = run(study, tmp_path / "out")
    (note,) = results.notes
    assert "contraction" in note
    assert len(results.runs) == 4


def test_paths_dictionaries_and_studies(tmp_path, study, monkeypatch):
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    path = write_study(tmp_path)
    assert len(run(path).runs) == 4
    assert run(str(path), quick=True).runs["scene.side"].tolist() == ["right"]
    assert run(path, overrides={"solver.order": 5}).runs["tangents"].tolist() == [120, 160]
    document = {
        "question": "?",
        "scene": {"kind": "box"},
        "law": {"kind": "honey"},
        "discretizer": {"kind": "grid"},
        "solver": {"kind": "newton"},
    }
    assert len(nlsolve.run(document).runs) == 1
    with pytest.raises(StudyError, match="applied when a study is read"):
        run(study, quick=True)


def test_cases_with_other_parameters_share_a_frame(tmp_path):
    sweep = 'grid = { solver = [{ kind = "newton" }, { kind = "anm" }] }\n'
    study = Study.from_toml(write_study(tmp_path, text=STUDY[: STUDY.index("grid = ")] + sweep), registry=registry_of())
    results = run(study, tmp_path / "out")
    assert results.runs["solver.kind"].tolist() == ["newton", "anm"]
    assert results.runs["solver.order"].isna().tolist() == [True, False]
