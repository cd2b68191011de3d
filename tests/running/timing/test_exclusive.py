"""The exclusive lane: case after case, round after round, resumed where it stopped, each on its core."""

from __future__ import annotations

import os
import statistics
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import exclusive_lane
import pandas as pd
import planted
import pytest
from fakes import registry_of, write_study
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.plugin import Step
from nlsolve.registry.problems import StudyError
from nlsolve.results.frames import Part
from nlsolve.running.engines import choice, local
from nlsolve.running.engines.engine import Event, Turn
from nlsolve.running.results import Results
from nlsolve.running.runner import run
from nlsolve.running.store.claims import claimed
from nlsolve.running.store.parts import Parts
from nlsolve.running.store.reading import output_file, status_of_folder
from nlsolve.running.store.standing import Standings
from nlsolve.running.store.store import Store
from nlsolve.running.timing.cores import CAN_PIN, cores_here
from nlsolve.running.timing.exclusive import ExclusiveTurns
from nlsolve.running.turns import Turns
from nlsolve.study.study import Study

LANE = {"lane": "exclusive", "precision": 0.03, "most_rounds": 30, "seconds": 600.0}


def study_of(folder: Path, orders: str = "[10, 20]", **timing: Any) -> Study:
    """Cases of one comparison, an order each."""
    path = write_study(folder, ("[10, 20]", orders), ("[1e-6, 1e-8]", "[1e-6]"))
    given = {f"timing.{name}": value for name, value in {**LANE, **timing}.items()}
    return Study.from_toml(path, given, registry=registry_of())


class Clocked:
    """A run on a folder, or without one, whose cases take the seconds that a test gives them."""

    def __init__(self, study: Study, folder: Path | None = None) -> None:
        self.study = study
        self.store = None if folder is None else Store(folder, study)
        self.turns = (ExclusiveTurns if study.timing.is_exclusive else Turns)(study, self.store)
        self.told: list[Event] = []
        self.each = self.turns.each(self.told.append)

    def rounds(self, seconds: dict[int, list[float]], turns: int = 10_000) -> list[int]:
        """Take turns until none is left, or so many; returns the orders of the cases in their order."""
        taken = []
        for turn in self.each:
            assert turn is not None
            order = turn.case.parameters["solver.order"]
            taken.append(order)
            self.end(turn, seconds[order].pop(0))
            if len(taken) == turns:
                break
        return taken

    def end(self, turn: Turn, seconds: float, **run: Any) -> None:
        measured = {"seconds": seconds, "seconds_all": seconds, "load": 0.0}
        told = {"status": "converged", "clock": "processor", "lane": "exclusive", "rounds": 1, **measured, **run}
        row = {"case": turn.case.id, **told, **turn.case.parameters}
        rounds = (measured,) if row["lane"] == "exclusive" else ()
        self.turns.end(turn, Part(row, pd.DataFrame(), pd.DataFrame(), rounds=rounds))

    def close(self) -> None:
        assert self.store is not None
        self.turns.close()

    def column(self, name: str) -> list[Any]:
        return [self.turns.parts[case.id].run[name] for case in self.study.cases]


def standing(folder: Path, study: Study) -> list[str]:
    """The word of each case of a study."""
    return [found.word for found in Standings(Parts(folder), study.timing).of_all(study.cases).values()]


def certain(times: int, value: float = 1.0) -> list[float]:
    return [value] * times


def wild(times: int) -> list[float]:
    return [1.0 + (number * 7 % 11) / 10 for number in range(times)]


def test_cases_take_turns_and_drop_out_together(tmp_path):
    clocked = Clocked(study_of(tmp_path))
    taken = clocked.rounds({10: certain(6), 20: certain(6, 2.0)})
    assert taken == [10, 20] * 6
    assert clocked.column("rounds") == [6, 6]
    assert clocked.column("seconds") == [1.0, 2.0]


def test_a_case_that_is_certain_goes_on_beside_one_that_is_not(tmp_path):
    clocked = Clocked(study_of(tmp_path, most_rounds=9))
    taken = clocked.rounds({10: certain(9), 20: wild(9)})
    assert taken == [10, 20] * 9, "until the budget of rounds is spent"
    assert clocked.column("rounds") == [9, 9]
    assert clocked.column("seconds_low")[1] < clocked.column("seconds_high")[1]


def test_a_comparison_drops_out_of_the_rounds_of_the_others(tmp_path):
    """Other scenes are other comparisons."""
    text = Path(write_study(tmp_path)).read_text()
    text = text.replace('"solver.tolerance" = [1e-6, 1e-8]', '"scene.side" = ["left", "right"]')
    path = write_study(tmp_path, text=text.replace('columns = "solver.tolerance"', 'columns = "scene.side"'))
    study = Study.from_toml(path, {"timing.lane": "exclusive", "timing.most_rounds": 8}, registry=registry_of())
    clocked, taken = Clocked(study), []
    for turn in clocked.each:
        assert turn is not None
        side = turn.case.parameters["scene.side"]
        taken.append((turn.case.parameters["solver.order"], side))
        count = taken.count(taken[-1])
        clocked.end(turn, 1.0 if side == "left" else 1.0 + count)
    assert taken[:24] == [(10, "left"), (10, "right"), (20, "left"), (20, "right")] * 6
    assert taken[24:] == [(10, "right"), (20, "right")] * 2


@pytest.mark.parametrize("run", [{"status": "crashed"}, {"status": "diverged"}, {"lane": "alone"}])
def test_what_cannot_be_timed_is_run_once(tmp_path, run):
    clocked, taken = Clocked(study_of(tmp_path)), []
    for turn in clocked.each:
        assert turn is not None
        order = turn.case.parameters["solver.order"]
        taken.append(order)
        clocked.end(turn, 1.0, **(run if order == 20 else {}))
    assert taken == [10, 20, *[10] * 5]


def test_an_interrupted_round_is_resumed_in_its_middle(tmp_path):
    study = study_of(tmp_path, "[10, 20, 30]")
    first = Clocked(study, tmp_path / "out")
    given = {10: certain(6), 20: certain(6, 2.0), 30: certain(6, 3.0)}
    assert first.rounds(given, turns=10) == [10, 20, 30] * 3 + [10]
    first.close()
    assert set(standing(tmp_path / "out", study)) == {"timed again"}
    second = Clocked(study, tmp_path / "out")
    assert second.rounds(given) == [20, 30] + [10, 20, 30] * 2
    assert [event.case.parameters["solver.order"] for event in second.told] == [10]
    assert second.column("rounds") == [6, 6, 6]
    second.close()
    assert set(standing(tmp_path / "out", study)) == {"kept"}
    third = Clocked(study, tmp_path / "out")
    assert third.rounds({}) == []
    assert [event.resumed for event in third.told] == [True] * 3
    assert third.store is not None


def test_the_rounds_are_kept_so_that_a_median_goes_on(tmp_path):
    study = study_of(tmp_path, "[10]", most_rounds=7)
    first = Clocked(study, tmp_path / "out")
    first.rounds({10: [1.0, 9.0, 2.0]}, turns=3)
    first.close()
    second = Clocked(study, tmp_path / "out")
    second.rounds({10: [8.0, 3.0, 7.0, 4.0]})
    part = next(iter(second.turns.parts.values()))
    assert [measured["seconds"] for measured in part.rounds] == [1.0, 9.0, 2.0, 8.0, 3.0, 7.0, 4.0]
    assert (part.run["seconds"], part.run["seconds_low"], part.run["seconds_high"]) == (4.0, 1.0, 9.0)


def test_a_comparison_that_has_grown_begins_anew(tmp_path):
    first = Clocked(study_of(tmp_path), tmp_path / "out")
    first.rounds({10: certain(6), 20: certain(6)})
    first.close()
    grown = study_of(tmp_path, "[10, 20, 30]")
    assert standing(tmp_path / "out", grown) == ["timed again", "timed again", "new"]
    second = Clocked(grown, tmp_path / "out")
    assert second.rounds({order: certain(6, 2.0) for order in (10, 20, 30)}) == [10, 20, 30] * 6
    assert second.column("rounds") == [6, 6, 6]
    assert second.column("seconds") == [2.0] * 3


def test_seconds_of_another_lane_are_taken_again(tmp_path):
    shared = study_of(tmp_path, lane="shared")
    before = Clocked(shared, tmp_path / "out")
    for case in shared.cases:
        before.end(Turn(case, 1, 1), 5.0, lane="shared")
    before.close()
    assert set(standing(tmp_path / "out", study_of(tmp_path))) == {"timed again"}
    after = Clocked(study_of(tmp_path), tmp_path / "out")
    assert after.rounds({10: certain(6), 20: certain(6)}) == [10, 20] * 6
    after.close()
    assert set(standing(tmp_path / "out", shared)) == {"kept"}, "but not the other way round"


def test_a_second_run_on_the_folder_waits_for_the_lane(tmp_path):
    study = study_of(tmp_path)
    first, second = Clocked(study, tmp_path / "out"), Clocked(study, tmp_path / "out")
    given = {10: certain(6), 20: certain(6)}
    assert first.rounds(given, turns=3) == [10, 20, 10]
    assert next(second.each) is None
    assert claimed(tmp_path / "out") == ["exclusive"]
    assert status_of_folder(tmp_path / "out").running == ()
    first.close()
    assert second.rounds(given) == [20, *[10, 20] * 4], "it goes on where the first was stopped"


def test_a_case_that_a_run_without_the_lane_computes_is_waited_for(tmp_path):
    clocked, other = Clocked(study_of(tmp_path), tmp_path / "out"), Store(tmp_path / "out", study_of(tmp_path))
    case = clocked.study.cases[0]
    assert other.begin(case)
    assert next(clocked.each) is None
    other.end(case)
    turn = next(clocked.each)
    assert turn is not None
    assert turn.case == case
    assert len(status_of_folder(tmp_path / "out").running) == 1


def document(*solvers: Any, **timing: Any) -> dict[str, Any]:
    return {
        "question": "Which takes longer?",
        "scene": {"kind": "published", "problem": "powell-singular"},
        "timing": {"lane": "exclusive", "most_rounds": 6, **timing},
        "sweep": [{"grid": {"solver": list(solvers)}}],
        "table": [{"name": "work", "rows": "solver.kind", "value": ["residuals", "seconds"]}],
    }


class Counted(planted.Planted):
    """Prints how often it has been run in its process."""

    kind: Literal["counted"] = "counted"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        self.kept.append(None)
        print(len(self.kept))
        return super().steps(problem, tangent, start)


@pytest.fixture(scope="module")
def timed(tmp_path_factory) -> Results:
    """Two cases of a real worker, the first of which counts its runs; and one that cannot be timed."""
    solvers = (Counted(), {"kind": "newton"}, planted.Raises())
    return run(document(*solvers), tmp_path_factory.mktemp("timed"), isolation="process")


def test_rows_of_the_lane_say_so(timed):
    runs = timed.runs.set_index("solver.kind").loc[["counted", "newton"]]
    assert runs["lane"].tolist() == ["exclusive"] * 2
    assert runs["rounds"].tolist() == [6, 6]
    assert (runs["seconds_low"] <= runs["seconds"]).all()
    assert (runs["seconds"] <= runs["seconds_high"]).all()
    assert (runs["seconds_high"] <= runs["seconds_most"]).all()
    parts = [name for name in runs if name.startswith("seconds_") and name.split("_")[1] in ADDING]
    assert (abs(runs[parts].sum(axis=1) - runs["seconds"]) < 1e-9).all(), "they are of one round"


ADDING = ("factorization", "triangular", "jacobian", "residual", "series", "own")


@pytest.mark.skipif(not CAN_PIN, reason="no process is kept on a core here")
def test_the_worker_is_on_a_core_of_its_own(timed):
    cores = set(timed.runs["core"].dropna())
    assert len(cores) == 1
    assert cores <= cores_here()
    assert timed.runs["load"].dropna().between(0.0, 1.0).all()


def test_the_worker_is_warm(timed):
    """The process has run the case once more than there are rounds; what is kept is printed by the last run alone."""
    file = output_file(timed.folder, timed.runs.set_index("solver.kind").loc["counted", "case"])
    assert file is not None
    assert file.read_text() == "7\n"


def test_a_failure_is_a_row_of_the_lane_too(timed):
    assert timed.runs.set_index("solver.kind").loc["raises", "status"] == "crashed"


def test_the_rounds_of_a_run_are_in_its_parts(timed):
    parts = Parts(timed.folder)
    kept = [entry.rounds for key in parts.names() if (entry := parts.entry(key)) is not None and entry.rounds]
    assert [len(rounds) for rounds in kept] == [6, 6]
    medians = sorted(statistics.median_low(measured["seconds"] for measured in rounds) for rounds in kept)
    assert sorted(timed.runs["seconds"].dropna()) == medians


def test_the_note_beneath_the_table_tells_rounds_and_intervals(timed):
    (table,) = timed.tables()
    assert table.notes[0].startswith(
        "Seconds are medians of 6 rounds in the exclusive lane; 95 % intervals are at most ±"
    )


class Moves(planted.Planted):
    """Leaves its core."""

    kind: Literal["moves"] = "moves"

    def misbehave(self) -> None:
        os.sched_setaffinity(0, range(os.cpu_count() or 1))


@pytest.mark.skipif(len(cores_here()) < 2, reason="there is no other core")
def test_a_case_that_leaves_its_core_leaves_the_lane_alone(tmp_path):
    runs = run(document(Moves(), {"kind": "newton"}), tmp_path, isolation="process").runs
    assert runs["lane"].tolist() == ["alone", "exclusive"]
    assert runs["core"].notna().tolist() == [False, True]
    assert runs["rounds"].tolist() == [1, 6]


@pytest.mark.skipif(not CAN_PIN, reason="no process is kept on a core here")
def test_the_runner_is_kept_off_the_core_and_let_back(tmp_path):
    mine, seen = cores_here(), []
    results = run(
        document({"kind": "newton"}), tmp_path, isolation="process", listen=lambda event: seen.append(cores_here())
    )
    (core,) = set(results.runs["core"])
    assert set(seen) == {mine - {core} or mine}
    assert cores_here() == mine
    assert (results.notes == ()) == (len(mine) > 1)


def test_where_no_process_is_kept_on_a_core_a_note_says_so(monkeypatch):
    monkeypatch.setattr(local, "cores_here", frozenset)
    results = run(document({"kind": "newton"}), isolation="process")
    assert results.notes == (
        "this system keeps no process on a core: the cases were timed on whichever core they were given",
    )
    assert results.runs["rounds"].tolist() == [6]


def test_where_there_is_one_core_only_a_note_says_so(monkeypatch):
    monkeypatch.setattr(local, "cores_here", lambda: frozenset({max(mine)}))
    mine = cores_here()
    results = run(document({"kind": "newton"}, most_rounds=1), isolation="process")
    assert results.notes == ("there is one core only: what runs the study was on it too while cases were timed",)
    os.sched_setaffinity(0, mine)


def test_several_cases_at_a_time_are_counted_first_and_those_that_arrive_timed_alone(tmp_path):
    """What does not arrive is run once, beside others; the folder has nothing that was counted twice."""
    told: list[Event] = []
    methods = ({"kind": "newton"}, {"kind": "modified-newton"}, planted.Raises())
    seven: dict[str, Any] = {
        "most_rounds": 7,
        "precision": 1e-9,
    }  # never reached: six rounds would do for a calm machine
    results = run(document(*methods, **seven), tmp_path, listen=told.append, isolation="process", jobs=2)
    assert results.runs["lane"].tolist()[:2] == ["exclusive"] * 2
    assert results.runs["rounds"].tolist()[:2] == [7, 7]
    assert results.runs["status"].tolist() == ["converged", "converged", "crashed"]
    ended = [event for event in told if event.run is not None]
    assert [event.run["lane"] for event in ended if event.run is not None and "lane" in event.run] == (
        ["shared"] * 2 + ["exclusive"] * 14
    )
    assert sorted(event.number for event in ended) == list(range(1, 18))
    alone = run(document(*methods[:2], **seven), isolation="process").runs
    assert alone["factorizations"].tolist() == results.runs["factorizations"].tolist()[:2]
    again = run(document(*methods[:2], **seven), tmp_path, isolation="process", jobs=2)
    assert again.runs["seconds"].tolist() == results.runs["seconds"].tolist()[:2], "nothing is left to count or to time"


def test_a_component_of_the_running_script_is_not_in_the_lane(monkeypatch):
    monkeypatch.setattr(planted.Sound, "__module__", "__main__")
    results = run(document({"kind": "newton"}, planted.Sound()), isolation="process")
    assert results.runs["lane"].tolist() == ["exclusive", "alone"]
    assert results.tables() == []
    assert results.notes[-1].startswith("solver 'sound' cannot go to another process")
    with pytest.raises(StudyError, match=r"table 'work': its seconds come from several lanes \(1 exclusive, 1 alone\)"):
        results.table("work")


@pytest.mark.parametrize(
    ("wishes", "named"),
    [
        ({"isolation": "none"}, "isolation = 'none'"),
        ({"engine": "dask"}, "engine = 'dask'"),
        ({"debugger": print, "isolation": None}, "a debugger"),
    ],
)
def test_wishes_that_do_not_go_with_the_lane(wishes, named):
    with pytest.raises(
        StudyError, match=f"one case at a time in a worker process of this machine, and {named} does not"
    ):
        run(document({"kind": "newton"}), **{"isolation": "process", **wishes})


def test_a_system_without_worker_processes_has_no_such_lane(monkeypatch):
    monkeypatch.setattr(choice, "os", SimpleNamespace(name="nt"))
    with pytest.raises(StudyError, match="needs worker processes, which this system does not have"):
        choice.engine_for(Study.from_dict(document({"kind": "newton"})).timing, "process")


@pytest.mark.slow
def test_a_ratio_is_the_same_beside_busy_cores():
    """Newton's method over Broyden's within 10 %. It asks for a machine that is calm otherwise."""
    idle, loaded = (exclusive_lane.timed(30.0, processes) for processes in (0, max(1, len(cores_here()) - 1)))
    assert (pd.concat([idle, loaded])["lane"] == "exclusive").all()
    assert exclusive_lane.ratio(loaded) == pytest.approx(exclusive_lane.ratio(idle), rel=0.1)


@pytest.mark.parametrize(("jobs", "lane"), [(1, "alone"), (2, "shared")])
def test_other_rows_tell_their_lanes_too(jobs, lane):
    study = {**document({"kind": "newton"}, {"kind": "broyden"}), "timing": {}}
    assert run(study, isolation="process", jobs=jobs).runs["lane"].tolist() == [lane] * 2
    assert run(study, isolation="none").runs["lane"].tolist() == ["alone"] * 2


def test_plan_tells_how_long_the_lane_takes(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        'question = "?"\n[scene]\nkind = "published"\nproblem = "powell-singular"\n[solver]\nkind = "newton"\n'
        '[timing]\nlane = "exclusive"\n'
    )
    told = CliRunner().invoke(app, ["plan", str(path), "--out", str(tmp_path / "out")])
    assert told.exit_code == 0
    assert " s to time 1 case in rounds (forecast: " in told.stdout
