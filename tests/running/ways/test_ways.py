"""Cases that share the way to their first state: one solves it, the others wait, and a folder keeps it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import nlsolve
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status
from nlsolve.results.aggregates import shared_ways
from nlsolve.results.columns import RUNS
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.store.identity import way_of
from nlsolve.running.store.upkeep import superfluous
from nlsolve.running.ways.files import read_way, way_path, write_way
from nlsolve.running.ways.ways import Ways
from nlsolve.solving.way import Stretch, Way
from nlsolve.study.study import Study

DOCUMENT: dict[str, Any] = {
    "question": "Do they share it?",
    "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
    "physics": {"inertia": True, "penalty": 100.0},
    "time": {"horizon": 2e-4, "increment": 1e-4},
    "motion": {"nodes": "lagrangian"},
    "law": {"kind": "power-law", "index": 0.3, "regularization": 1e-2},
    "discretizer": {"kind": "mls"},
    "sweep": [{"grid": {"solver": [{"kind": "newton"}, {"kind": "modified-newton"}, {"kind": "broyden"}]}}],
}
WAY = Way(
    (
        Stretch(
            "a",
            Outcome(
                Status.CONVERGED, "the stopping test was met", np.arange(3.0), 1e-12, ({}, {}), counts={"jacobians": 1}
            ),
            {"factorization": 2},
            {"stage": 0.5},
        ),
        Stretch("b", Outcome(Status.DIVERGED, "far off", np.ones(3), np.inf, blame={"blame_x": 1.0}), {}, {}),
    )
)


@pytest.fixture(scope="module")
def study() -> Study:
    return Study.from_dict(DOCUMENT)


@pytest.fixture(params=["memory", "folder"])
def ways(request: Any, study: Study, tmp_path: Path) -> Iterator[Ways]:
    found = Ways(study.cases, None if request.param == "memory" else tmp_path)
    yield found
    found.close()


def test_the_others_wait_for_the_one_that_solves_the_way(ways: Ways, study: Study) -> None:
    first, second, third = study.cases
    assert ways.is_open(first)
    assert ways.begin(first) is None
    assert not ways.is_open(second)
    assert ways.is_open(first)
    ways.keep(first, WAY)
    assert ways.is_open(second)
    assert ways.is_open(third)
    assert ways.begin(second) is WAY


def test_another_case_tries_where_the_first_did_not_arrive(ways: Ways, study: Study) -> None:
    first, second, _ = study.cases
    ways.begin(first)
    ways.end(second)
    assert not ways.is_open(second)
    ways.end(first)
    assert ways.is_open(second)
    assert ways.begin(second) is None


def test_two_runs_on_a_folder_solve_a_way_once(study: Study, tmp_path: Path) -> None:
    here, there = Ways(study.cases, tmp_path), Ways(study.cases, tmp_path)
    first, second, _ = study.cases
    assert here.is_open(first)
    here.begin(first)
    assert not there.is_open(second)
    here.keep(first, WAY)
    assert there.is_open(second)
    told = there.begin(second)
    assert told is not None
    assert told.stretches[0].start == "a"


def test_a_run_that_ends_gives_up_what_it_solves(study: Study, tmp_path: Path) -> None:
    here, there = Ways(study.cases, tmp_path), Ways(study.cases, tmp_path)
    assert here.is_open(study.cases[0])
    assert not there.is_open(study.cases[1])
    here.close()
    assert there.is_open(study.cases[1])


def test_cases_share_a_way_where_only_their_methods_differ(study: Study) -> None:
    names = {way_of(case) for case in study.cases}
    assert len(names) == 1
    longer, other = (
        Study.from_dict(DOCUMENT, changes).cases[0] for changes in ({"time.horizon": 5e-4}, {"law.index": 0.4})
    )
    assert way_of(longer) in names, "how long a march is has no part in its beginning"
    assert way_of(other) not in names
    assert way_of(Study.from_dict(DOCUMENT, {"start.at": "rest"}).cases[0]) == ""


def test_a_plan_counts_the_way_once(study: Study, tmp_path: Path) -> None:
    frame = plan_of(study, tmp_path).cases
    assert frame["seconds_start"].nunique() == 1
    first, *others = frame["seconds_expected"]
    assert all(other == pytest.approx(first - frame["seconds_start"][0]) for other in others)


def test_a_way_that_one_case_alone_has_is_not_kept(study: Study, tmp_path: Path) -> None:
    """It is solved in every timing round: perhaps the study compares ways."""
    alone = Ways(study.cases[:1], tmp_path)
    assert alone.begin(study.cases[0]) is None
    alone.keep(study.cases[0], WAY)
    assert alone.begin(study.cases[0]) is None
    assert list(tmp_path.iterdir()) == []


def test_a_way_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_way(tmp_path, "x", WAY)
    found = read_way(tmp_path, "x")
    assert found is not None
    for one, other in zip(found.stretches, WAY.stretches, strict=True):
        assert (one.start, one.counts, one.seconds) == (other.start, other.counts, other.seconds)
        assert np.array_equal(one.outcome.state, other.outcome.state)
        told = [
            vars(replace(each.outcome, state=None, residual_absolute=0.0, newton_correction=0.0))
            for each in (one, other)
        ]
        assert told[0] == told[1]


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04", b"nothing of the kind"])
def test_a_damaged_way_is_solved_again(damage: bytes, study: Study, tmp_path: Path) -> None:
    path = way_path(tmp_path, way_of(study.cases[0]))
    path.parent.mkdir()
    path.write_bytes(damage)
    assert read_way(tmp_path, path.stem) is None
    assert Ways(study.cases, tmp_path).begin(study.cases[0]) is None


def without_seconds(runs: pd.DataFrame) -> pd.DataFrame:
    measured = [name for name in RUNS if name.startswith("seconds") or name in ("factor_solve_ratio", "lane")]
    return runs.drop(columns=measured)


@pytest.fixture(scope="module")
def alone() -> pd.DataFrame:
    """The rows of the cases, each of which has solved its way for itself."""
    cases = DOCUMENT["sweep"][0]["grid"]["solver"]
    rows = [nlsolve.run({**DOCUMENT, "sweep": [{"grid": {"solver": [each]}}]}, isolation="none").runs for each in cases]
    return pd.concat(rows, ignore_index=True)


@pytest.mark.parametrize(
    "engine",
    [
        {"isolation": "none"},
        {"isolation": "process", "jobs": 1},
        {"isolation": "process", "jobs": 2},
        {"engine": "dask", "jobs": 2},
    ],
    ids=["in process", "one worker", "two workers", "dask"],
)
def test_a_shared_way_gives_the_same_rows_on_every_engine(
    engine: dict[str, Any], alone: pd.DataFrame, tmp_path: Path
) -> None:
    runs = nlsolve.run(DOCUMENT, tmp_path, **engine).runs
    pd.testing.assert_frame_equal(without_seconds(runs), without_seconds(alone))
    assert runs["seconds_start"].nunique() == 1, "one case has solved the way"
    assert alone["seconds_start"].nunique() == 3
    assert read_way(tmp_path, runs["start_way"][0]) is not None


def test_a_case_that_is_added_later_takes_the_way_of_the_folder(tmp_path: Path) -> None:
    first = nlsolve.run(DOCUMENT, tmp_path, isolation="none").runs
    solvers = [*DOCUMENT["sweep"][0]["grid"]["solver"], {"kind": "anm", "order": 12}]
    grown = nlsolve.run({**DOCUMENT, "sweep": [{"grid": {"solver": solvers}}]}, tmp_path, isolation="none").runs
    assert grown["seconds_start"].tolist() == [first["seconds_start"][0]] * 4


def test_the_work_that_is_shared_is_told_once(tmp_path: Path) -> None:
    runs = nlsolve.run(DOCUMENT, tmp_path, isolation="none").runs
    work = runs["start_factorizations"][0]
    assert f"3 cases share one way to a first state: in all {work} factorisations" in shared_ways(runs)
    assert shared_ways(runs) in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert shared_ways(runs[:1]) == ""
    other = runs.assign(start_way="other", seconds_start=1.0)
    assert f"6 cases share 2 ways to first states: in all {2 * work} " in shared_ways(pd.concat([runs, other]))


def test_a_way_without_a_row_is_superfluous(tmp_path: Path) -> None:
    runs = nlsolve.run(DOCUMENT, tmp_path, isolation="none").runs
    write_way(tmp_path, "old", WAY)
    assert way_path(tmp_path, "old") in superfluous(tmp_path)
    assert way_path(tmp_path, runs["start_way"][0]) not in superfluous(tmp_path)
