"""Which cases a run is for: by parameter, by ending, by id, and by shard."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest
from fakes import fake_march, registry_of, write_study
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.contracts.status import Status
from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import is_timed
from nlsolve.results.frames import Part
from nlsolve.running.portions.condition import is_like
from nlsolve.running.portions.portion import portion_of
from nlsolve.running.runner import load, run
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import Parts
from nlsolve.running.store.upkeep import merge_folders
from nlsolve.study.study import Study

SEVEN = {
    "question": "Who arrives?",
    "scene": {"kind": "published", "problem": "powell-singular"},
    "sweep": [
        {"grid": {"solver.kind": ["newton", "modified-newton", "anderson", "broyden", "picard", "robust", "anm"]}}
    ],
    "table": [{"name": "work", "rows": "solver.kind", "value": ["status", "residuals"]}],
    "expect": [{"column": "residuals", "at_least": 1}],
}


@pytest.fixture
def study(tmp_path) -> Study:
    """Orders 10 and 20 by tolerances 1e-6 and 1e-8."""
    return Study.from_toml(write_study(tmp_path), registry=registry_of())


@pytest.fixture
def marched(monkeypatch) -> list[Any]:
    """The parts of the cases that were run; the run itself is replaced."""
    cases: list[Any] = []

    def march(parts: Any, listen: Any, clock: Any, **way: Any) -> Any:
        cases.append(parts)
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    return cases


def chosen(study: Study, ending: Any = lambda case: "left", **wishes: Any) -> list[int]:
    """Numbers of the cases that are chosen, from 0."""
    given = {"only": (), "skip": (), "failed": False, "shard": None, **wishes}
    cases = portion_of(study, **given).cases(study, ending)
    return [study.cases.index(case) for case in cases]


@pytest.mark.parametrize(
    ("wishes", "numbers"),
    [
        ({"only": "solver.order=10"}, [0, 1]),
        ({"only": "solver.order = 1?"}, [0, 1]),
        ({"only": "solver.tolerance=0.000001"}, [0, 2]),
        ({"only": "solver.kind=a*"}, [0, 1, 2, 3]),
        ({"only": "solver.order=10 and solver.tolerance=1e-6"}, [0]),
        ({"only": ["solver.order=10", "solver.tolerance=1e-6"]}, [0, 1, 2]),
        ({"skip": "solver.order=10"}, [2, 3]),
        ({"only": "solver.order=20", "skip": ["solver.tolerance=1e-6"]}, [3]),
        ({"shard": "1/3"}, [0, 3]),
        ({"shard": "2/3"}, [1]),
        ({"shard": "5/5"}, []),
        ({"shard": "1/2", "skip": "solver.order=20"}, [0]),
        ({}, [0, 1, 2, 3]),
    ],
)
def test_cases_are_chosen_by_parameter_and_shard(study, wishes, numbers):
    assert chosen(study, **wishes) == numbers


def test_cases_are_chosen_by_ending_and_id(study):
    words = dict(zip((case.id for case in study.cases), ("converged", "crashed", "timed out", "left"), strict=True))

    def chosen_by(**wishes: Any) -> list[int]:
        return chosen(study, lambda case: words[case.id], **wishes)

    assert chosen_by(only="timed out") == [2]
    assert chosen_by(only="status=*e*d and solver.order=10") == [0, 1]
    assert chosen_by(skip=["left", "converged"]) == [1, 2]
    assert chosen_by(failed=True) == [1, 2]
    assert chosen_by(failed=True, shard="2/2") == [1]
    assert chosen_by(only=study.cases[3].id) == [3]
    assert chosen_by(skip=f"case={study.cases[3].id[:6]}") == [0, 1, 2]


@pytest.mark.parametrize(
    ("value", "wanted", "fits"),
    [(True, "true", True), (10, "10.0", True), (10, "1", False), ("[1, 2]", "[1, 2]", True), ("", "", True)],
)
def test_a_value_is_written_as_in_a_study(value, wanted, fits):
    assert is_like(value, wanted) is fits


MISTAKES = [
    (
        {"only": "solver.ordr=10"},
        r"only = 'solver.ordr=10': no such column of the results; did you mean 'solver.order'",
    ),
    ({"skip": "solver.order=11"}, r"skip = 'solver.order=11': no case has this solver.order; there are '10', '20'"),
    ({"only": "statsu=crashed"}, r"did you mean 'status'\?"),
    ({"only": "status=crashd"}, r"only = 'status=crashd': no such status; did you mean 'crashed'\?"),
    ({"only": "crashd"}, r"'crashd' is no status and the id of no case: write NAME=VALUE.*did you mean 'crashed'\?"),
    ({"only": ""}, r"only = '': '' is no status and the id of no case"),
    ({"only": "case=zzzz"}, r"only = 'case=zzzz': no case has this id; `nlsolve plan` lists the cases"),
    ({"shard": "0/3"}, r"shard = '0/3': expected i/n with i from 1 to n, such as 1/3 for the first of three"),
    ({"shard": "4/3"}, "expected i/n"),
    ({"shard": "third"}, "expected i/n"),
    ({"failed": True}, "how cases have ended is told by their results folder, and there is none: give out"),
    ({"skip": "converged"}, "there is none: give out"),
]


@pytest.mark.parametrize(("wishes", "sentence"), MISTAKES)
def test_a_wish_that_no_case_can_meet_is_a_sentence(study, wishes, sentence):
    with pytest.raises(StudyError, match=sentence):
        run(study, **wishes)


@pytest.mark.parametrize("options", [["--only", "solver.ordr=10"], ["--skip", "crashd"], ["--shard", "3"]])
def test_on_the_command_line_it_is_2(tmp_path, monkeypatch, options):
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    result = CliRunner().invoke(app, ["run", str(write_study(tmp_path)), "--out", str(tmp_path / "o"), *options])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "o").exists()


def test_what_is_not_chosen_is_kept_and_shown(study, tmp_path, marched):
    first = run(study, tmp_path / "out", only="solver.order=20")
    assert first.runs["solver.order"].tolist() == [20, 20]
    assert first.notes[-1] == "2 of 4 cases are finished"
    assert load(tmp_path / "out").notes == ("2 of 4 cases are finished",)
    second = run(study, tmp_path / "out", only="solver.tolerance=1e-6")
    assert len(marched) == 3
    assert second.runs["case"].tolist() == [study.cases[number].id for number in (0, 2, 3)]
    assert len(second.steps) == 6
    assert second.notes[-1] == "3 of 4 cases are finished"
    assert run(study, tmp_path / "out").notes == ()
    assert len(marched) == 4


def test_in_memory_there_are_the_chosen_cases(study, marched):
    results = run(study, shard="2/2")
    assert results.runs["case"].tolist() == [study.cases[number].id for number in (1, 3)]
    assert results.notes == ("2 of 4 cases are finished",)


def test_failed_cases_are_run_again_whatever_they_cost(study, tmp_path, marched):
    run(study, tmp_path)
    case = study.cases[1]
    row = {"case": case.id, "status": Status.TIMED_OUT.word, "limits.seconds": 9e9, "message": "planted"}
    part = Part(row, pd.DataFrame(), pd.DataFrame())
    Parts(tmp_path).save(identity_of(case), part, case.parameters)
    results = run(study, tmp_path, skip="timed out")
    assert results.runs["status"].tolist() == ["converged", "timed out", "converged", "converged"]
    assert len(marched) == 4
    again = run(study, tmp_path, failed=True)
    assert len(marched) == 5
    assert again.runs["status"].tolist() == ["converged"] * 4
    assert again.notes == ()
    assert len(run(study, tmp_path, failed=True).runs) == 4
    assert len(marched) == 5


def test_a_case_that_failed_before_its_plugin_was_mended_has_failed(study, tmp_path, marched):
    run(study, tmp_path)
    case, parts = study.cases[2], Parts(tmp_path)
    old = parts.entry(identity_of(case).key)
    assert old is not None
    (tmp_path / "cases" / f"{old.identity.key}.json").unlink()
    before = identity_of(case).__class__(case.id, {**old.identity.code, "nlsolve": "0"}, old.identity.files)
    row = {"case": case.id, "status": Status.CRASHED.word, "message": "planted"}
    parts.save(before, Part(row, pd.DataFrame(), pd.DataFrame()), case.parameters)
    assert run(study, tmp_path, failed=True).runs["status"].tolist() == ["converged"] * 4
    assert len(marched) == 5


def test_a_run_for_no_case_says_so(tmp_path, monkeypatch, marched):
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    result = CliRunner().invoke(app, ["run", str(write_study(tmp_path)), "--out", str(tmp_path / "o"), "--failed"])
    assert result.exit_code == 0, result.output
    assert "0 of 4 cases are finished" in result.stderr
    assert "0 cases: none has ended" in result.stderr
    assert marched == []


def test_what_a_study_expects_waits_for_all_cases(tmp_path):
    results = run(SEVEN, tmp_path, only="solver.kind=newton")
    assert results.findings == ()
    assert results.notes[-1] == "1 of 7 cases are finished; what the study expects is judged when all are"
    assert [finding.holds for finding in run(SEVEN, tmp_path).findings] == [True]


def without_seconds(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows without what a clock has measured."""
    measured = [name for name in runs if is_timed(name) or name in ("lane", "predicted", "seconds_predicted")]
    return runs.drop(columns=measured).reset_index(drop=True)


def test_shards_are_the_serial_run_row_for_row(tmp_path):
    """Into one folder, and into three that are merged."""
    serial = run(SEVEN, tmp_path / "serial", isolation="none")
    for number in (1, 2, 3):
        last = run(SEVEN, tmp_path / "one", shard=f"{number}/3")
        run(SEVEN, tmp_path / f"part-{number}", shard=f"{number}/3")
        merge_folders(tmp_path / f"part-{number}", tmp_path / "merged")
    for found in (last, load(tmp_path / "one"), load(tmp_path / "merged"), run(SEVEN, tmp_path / "merged")):
        pd.testing.assert_frame_equal(without_seconds(found.runs), without_seconds(serial.runs))
        pd.testing.assert_frame_equal(without_seconds(found.steps), without_seconds(serial.steps))
        assert found.notes == ()
    pd.testing.assert_frame_equal(last.table("work"), serial.table("work"))
