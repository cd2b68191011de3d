"""Two runs on one folder: each case is computed by one of them, whatever becomes of the other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from fakes import registry_of, write_study

from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import Event, Turn
from nlsolve.running.store.claims import CLAIMS, Claims, claimed
from nlsolve.running.store.store import Store
from nlsolve.running.turns import Turns
from nlsolve.study.study import Study

HOLDER = """
import sys, time
from pathlib import Path
from nlsolve.running.store.claims import Claims
claims = Claims(Path(sys.argv[1]))
print(claims.take("a"), flush=True)
time.sleep(60)
"""


@pytest.fixture
def study(tmp_path) -> Study:
    return Study.from_toml(write_study(tmp_path), registry=registry_of())


def part(case, **run) -> Part:
    measured = {"status": "converged", "rounds": 1, "clock": "processor", "seconds": 1.0, "seconds_most": 1.0}
    return Part({"case": case.id, **measured, **run, **case.parameters}, pd.DataFrame(), pd.DataFrame())


class Run:
    """One run on the folder."""

    def __init__(self, folder: Path, study: Study) -> None:
        self.store = Store(folder, study)
        self.turns = Turns(study, self.store)
        self.told: list[Event] = []
        self.each = self.turns.each(self.told.append)

    def next(self) -> Turn:
        turn = next(self.each)
        assert turn is not None, "all that are left are held"
        return turn

    def end(self, turn: Turn, **run) -> None:
        self.turns.end(turn, part(turn.case, **run))


def test_a_claim_is_one_run_s_until_it_is_released(tmp_path):
    first, second = Claims(tmp_path), Claims(tmp_path)
    assert first.take("a")
    assert first.take("a")
    assert not second.take("a")
    assert second.take("b")
    assert claimed(tmp_path) == ["a", "b"]
    first.release("a")
    assert second.take("a")
    second.release_all()
    first.release("a")
    assert claimed(tmp_path) == []
    assert list((tmp_path / CLAIMS).iterdir()) == []


def test_a_claim_dies_with_its_owner(tmp_path):
    owner = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    with owner:
        assert owner.stdout.readline() == "True\n"
        assert not Claims(tmp_path).take("a")
        assert claimed(tmp_path) == ["a"]
        os.kill(owner.pid, signal.SIGKILL)
    assert claimed(tmp_path) == []
    assert Claims(tmp_path).take("a")


def test_a_lock_that_is_released_while_it_is_opened_is_no_claim(tmp_path, monkeypatch):
    """The file that the second run has opened is gone when it gets the lock: it opens the new one."""
    first, second = Claims(tmp_path), Claims(tmp_path)
    assert first.take("a")
    opened = []

    def opening(path, flags, *rest):
        opened.append(real(path, flags, *rest))
        if len(opened) == 1:
            first.release("a")
        return opened[-1]

    real = os.open
    monkeypatch.setattr("nlsolve.running.store.claims.os.open", opening)
    assert second.take("a")
    assert len(opened) == 2
    assert claimed(tmp_path) == ["a"]


def test_where_there_are_no_locks_every_claim_is_granted(tmp_path, monkeypatch):
    def refuse(file, kind):
        raise OSError(37, "No locks available")

    monkeypatch.setattr("nlsolve.running.store.claims.fcntl.flock", refuse)
    assert Claims(tmp_path).take("a")
    assert Claims(tmp_path).take("a")
    monkeypatch.setattr("nlsolve.running.store.claims.fcntl", None)
    assert Claims(tmp_path / "none").take("a")
    assert not (tmp_path / "none").exists()


def test_two_runs_take_different_cases_and_read_each_other_s(tmp_path, study):
    first, second = runs = [Run(tmp_path / "out", study) for _ in range(2)]
    taken = [(run, run.next()) for run in (first, second, first, second)]
    assert [turn.case.id for _, turn in taken] == [case.id for case in study.cases]
    assert next(first.each) is None, "the second run holds what is left"
    for run, turn in taken:
        run.end(turn, tangents=turn.number)
    for run in runs:
        assert list(run.each) == []
        assert len(run.told) == 2
        assert all(event.resumed for event in run.told)
        assert sorted(part.run["tangents"] for part in run.turns.parts.values()) == [1, 2, 3, 4]
    assert claimed(tmp_path / "out") == []


def test_a_case_that_another_run_has_just_seen_fail_is_not_tried_at_once(tmp_path, study):
    first, second = (Run(tmp_path / "out", study) for _ in range(2))
    turn = first.next()
    first.end(turn, status="crashed", rounds=None)
    assert second.next().case == study.cases[1]
    assert [event.case for event in second.told] == [turn.case]
    assert Run(tmp_path / "out", study).next().case == turn.case, "a later run tries it"


def test_the_cases_of_a_run_that_ended_are_taken_over(tmp_path, study):
    first, second = (Run(tmp_path / "out", study) for _ in range(2))
    lost = first.next()
    assert [second.next().number for _ in range(3)] == [2, 3, 4]
    assert next(second.each) is None
    first.store.close()
    assert second.next() == lost
    assert second.told == []


def test_rounds_of_a_case_come_one_after_the_other(tmp_path):
    study = Study.from_toml(write_study(tmp_path), {"timing.rounds": 2}, registry=registry_of())
    first, second = (Run(tmp_path / "out", study) for _ in range(2))
    held = first.next()
    others = [second.next() for _ in range(3)]
    assert next(second.each) is None, "their second rounds wait for their first"
    for turn in others:
        second.end(turn)
    again = [second.next() for _ in range(3)]
    assert [turn.case.id for turn in again] == [turn.case.id for turn in others]
    assert next(second.each) is None, "the first case is held, and its second round waits for its first"
    first.end(held)
    assert second.next().case == held.case
    assert [event.number for event in second.told] == [1]
    second.end(again[0])
    assert second.turns.parts[again[0].case.id].run["rounds"] == 2


def test_turns_without_a_folder_are_all_of_them(study):
    turns = Turns(study, None)
    found = [turn for turn in turns.each(lambda event: None) if turn is not None and turns.end(turn, part(turn.case))]
    assert [turn.number for turn in found] == [1, 2, 3, 4]


RUNNER = """
import sys, time
from fakes import fake_march, registry_of
from nlsolve.running import runner
from nlsolve.running.engines import execution
from nlsolve.study.study import Study

def march(parts, listen, clock, **way):
    with open(sys.argv[3], "a") as file:
        print(parts.solver.order, file=file)
    time.sleep(0.02)
    return fake_march(parts, listen)

execution.run_case = march
study = Study.from_toml(sys.argv[1], registry=registry_of())
results = runner.run(study, sys.argv[2], isolation="none")
assert results.runs["case"].tolist() == [case.id for case in study.cases]
print(len(results.runs))
"""


def started(tmp_path: Path, study: Path, log: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    arguments = [sys.executable, "-c", RUNNER, str(study), str(tmp_path / "out"), str(tmp_path / log)]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def forty(tmp_path: Path) -> Path:
    orders = ", ".join(str(order) for order in range(2, 42))
    return write_study(tmp_path, ("[10, 20]", f"[{orders}]"), ("[1e-6, 1e-8]", "[1e-6]"))


def assert_whole(folder: Path, cases: int) -> None:
    """One part a case, each complete; no frame is torn."""
    parts = sorted(path.name.partition("-")[0] for path in (folder / "cases").glob("*.json"))
    assert len(parts) == len(set(parts)) == cases
    runs = pd.read_parquet(folder / "runs.parquet")
    assert sorted(runs["case"]) == parts
    assert len(pd.read_csv(folder / "steps.csv")) == len(pd.read_parquet(folder / "steps.parquet")) == 2 * cases
    assert len(pd.read_parquet(folder / "fields.parquet")) == 2 * cases
    assert list((folder / CLAIMS).iterdir()) == []


@pytest.mark.slow
def test_two_processes_on_one_folder_compute_each_case_once(tmp_path):
    study = forty(tmp_path)
    runs = [started(tmp_path, study, log) for log in ("first", "second")]
    told = [run.communicate(timeout=900) for run in runs]
    assert [out for out, _ in told] == ["40\n", "40\n"], told
    computed = [(tmp_path / log).read_text().split() for log in ("first", "second")]
    assert sorted(map(int, computed[0] + computed[1])) == list(range(2, 42))
    assert_whole(tmp_path / "out", 40)


@pytest.mark.slow
def test_a_runner_killed_at_ten_moments_loses_the_running_case_only(tmp_path):
    study, computed = forty(tmp_path), []
    for number in range(10):
        run = started(tmp_path, study, "log")
        before = len(computed)
        while len(computed) < min(before + 3, 36):
            time.sleep(0.003 * (number + 1))
            computed = (tmp_path / "log").read_text().split() if (tmp_path / "log").exists() else []
        run.kill()
        run.communicate()
        computed = (tmp_path / "log").read_text().split()
        assert all(path.stat().st_size for path in (tmp_path / "out" / "cases").glob("[!.]*"))
    out, error = started(tmp_path, study, "log").communicate(timeout=900)
    assert out == "40\n", error
    computed = (tmp_path / "log").read_text().split()
    assert len(computed) <= 40 + 10, "at most the case that was running is computed again"
    assert set(map(int, computed)) == set(range(2, 42))
    assert_whole(tmp_path / "out", 40)
