"""What a run would do: which cases, why, and how long they take, learned from those that have been run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from fakes import registry_of, write_study
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.contracts.status import Status
from nlsolve.registry.problems import StudyError
from nlsolve.results.frames import Part
from nlsolve.running.planning.experience import FEWEST_TO_HALVE, OVERHEAD, expectation
from nlsolve.running.planning.outlook import STARTUP, outlook_of
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.runner import run
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import Entry, Parts
from nlsolve.study.case import Case
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing

SOLVERS = ("newton", "modified-newton", "broyden", "anderson")


def grid(orders: tuple[float, ...] = (1e-2, 1e-4, 1e-8, 1e-10)) -> Study:
    """Solvers by tolerances."""
    return Study.from_dict(
        {
            "question": "How long?",
            "scene": {"kind": "published", "problem": "powell-singular"},
            "sweep": [{"grid": {"solver.kind": list(SOLVERS), "stop.tolerance": list(orders)}}],
        }
    )


def expected_seconds(
    cases: Sequence[Case], forecast: Mapping[str, float], known: Mapping[str, float]
) -> Mapping[str, float]:
    return expectation(cases, forecast, known).seconds


def true_seconds(case: Case) -> float:
    """A product of what the solver and the tolerance cost."""
    return (1.0 + 3.0 * SOLVERS.index(case.parameters["solver.kind"])) * -math.log10(case.parameters["stop.tolerance"])


def test_the_seconds_of_cases_follow_from_those_with_the_same_values():
    cases = grid().cases
    known = {case.id: true_seconds(case) for number, case in enumerate(cases) if number % 3 != 1}
    expected = expected_seconds(cases, dict.fromkeys([case.id for case in cases], 0.0), known)
    for case in cases:
        assert expected[case.id] == pytest.approx(true_seconds(case), rel=0.25)
        assert case.id not in known or expected[case.id] == known[case.id]


def test_a_value_that_no_known_case_has_lies_on_the_line_of_the_others():
    cases = grid((1e-2, 1e-4, 1e-8, 1e-16)).cases
    seconds = {case.id: case.parameters["stop.tolerance"] ** -0.25 for case in cases}
    known = {case.id: seconds[case.id] for case in cases if case.parameters["stop.tolerance"] > 1e-10}
    expected = expected_seconds(cases, dict.fromkeys([case.id for case in cases], 0.0), known)
    for case in cases:
        assert expected[case.id] == pytest.approx(seconds[case.id], rel=0.4)


def test_where_nothing_has_been_run_unit_costs_tell_and_each_case_has_an_overhead():
    cases = grid().cases
    forecast = {case.id: float(number) for number, case in enumerate(cases)}
    assert expected_seconds(cases, forecast, {}) == {case: seconds + OVERHEAD for case, seconds in forecast.items()}
    blind = expected_seconds(cases, {**forecast, cases[0].id: math.nan}, {cases[1].id: 7.0})
    assert blind == pytest.approx(dict.fromkeys(blind, 7.0)), "one case says the same of all"


def test_a_forecast_from_unit_costs_scales_what_is_known():
    cases = grid().cases
    forecast = {case.id: 10.0**number for number, case in enumerate(cases)}
    expected = expected_seconds(cases, forecast, {cases[3].id: 2.0 * (forecast[cases[3].id] + OVERHEAD)})
    assert expected[cases[6].id] == pytest.approx(2.0 * (forecast[cases[6].id] + OVERHEAD))


def test_the_interval_of_a_sum_is_as_wide_as_the_known_cases_are_hard_to_tell_from_each_other():
    cases = grid().cases
    costs = dict.fromkeys([case.id for case in cases], 0.0)
    told = {case.id: true_seconds(case) for case in cases[:12]}
    wild = {case: seconds * 10.0 ** (number % 3) for number, (case, seconds) in enumerate(told.items())}
    assert 1.0 < expectation(cases, costs, told).factor < expectation(cases, costs, wild).factor
    few = dict(list(told.items())[: FEWEST_TO_HALVE - 1])
    assert math.isnan(expectation(cases, costs, few).factor)


def entry_of(case: Case, elapsed: float, startup: float = 0.0, way: float = 0.0) -> Entry:
    """What is kept of a case that has worked for a tenth of the time."""
    measured = {"status": "converged", "seconds_all": elapsed / 10, "seconds_start": way / 10}
    return Entry(identity_of(case), measured, case.parameters, {}, 0.0, elapsed, startup=startup, way=way)


def costs_of(study: Study, start: float = 0.0) -> pd.DataFrame:
    """A forecast by which every case takes 2 s beside the way to its first state."""
    ids = [case.id for case in study.cases]
    return pd.DataFrame({"case": ids, "seconds_start": start, "seconds_all": 2.0 + start})


def test_what_the_first_case_of_a_process_waits_for_and_loads_belongs_to_the_start():
    study = grid()
    first, *later = study.cases[:6]
    last = {first.id: entry_of(first, 5.0, startup=1.5)} | {case.id: entry_of(case, 1.0) for case in later}
    outlook = outlook_of(study, costs_of(study), last)
    assert outlook.own.seconds[study.cases[7].id] == pytest.approx(1.0, rel=1e-6)
    assert outlook.startup == pytest.approx(1.5 + 5.0 - 1.0, rel=1e-6)
    left = [case.id for case in study.cases[6:]]
    assert outlook.span(left, 2)[0] == pytest.approx(outlook.startup + 10 * 1.0 / 2, rel=1e-6)
    assert outlook.span(left[:1], 2)[0] == pytest.approx(outlook.startup + 1.0, rel=1e-6), "no case is divided"
    alone = outlook_of(study, costs_of(study), {first.id: entry_of(first, 5.0, startup=1.5)})
    assert alone.own.seconds[study.cases[7].id] == pytest.approx(0.5 + OVERHEAD), "its work tells of the others"


def test_a_way_that_cases_share_is_expected_once_by_what_other_ways_took():
    swept = {"law.index": [0.5, 0.8], "solver.kind": ["newton", "broyden", "picard"]}
    study = Study.from_dict(
        {
            "question": "How long?",
            "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 1.2}},
            "law": {"kind": "power-law"},
            "discretizer": {"kind": "delaunay"},
            "sweep": [{"grid": swept}],
        }
    )
    costs, cases = costs_of(study, start=3.0), study.cases
    assert len({case.way_id for case in cases}) == 2
    known = {cases[0].id: entry_of(cases[0], 10.0, way=6.0), cases[1].id: entry_of(cases[1], 4.0)}
    outlook = outlook_of(study, costs, known)
    assert outlook.ways == {cases[3].id: pytest.approx(6.0)}, "the first way is there; the second takes as long"
    assert outlook.own.seconds[cases[2].id] == pytest.approx(4.0)
    assert outlook.seconds(cases[3].id) == pytest.approx(10.0)
    assert outlook_of(study, costs, {}).ways == dict.fromkeys([cases[0].id, cases[3].id], 3.0)


def part(**run: Any) -> Part:
    return Part({"status": "converged", "seconds": 1.0, "rounds": 1, **run}, pd.DataFrame(), pd.DataFrame())


def test_a_plan_is_for_the_cases_that_a_run_with_the_same_wishes_is_for(tmp_path):
    study, parts = grid(), Parts(tmp_path)
    words = ["converged", "timed out", "diverged"]
    for case, word in zip(study.cases, words, strict=False):
        parts.save(identity_of(case), part(case=case.id, status=word, clock="processor"), case.parameters, 3.0)

    def planned(**wishes: Any) -> list[str]:
        return list(plan_of(study, tmp_path, **wishes).cases["plan"])

    assert planned() == ["kept"] * 3 + ["new"] * 13
    assert planned(only="solver.kind=newton") == ["kept"] * 3 + ["new"]
    assert planned(only="solver.kind=newton", skip="converged") == ["kept", "kept", "new"]
    assert planned(failed=True) == ["retried (timed out)"]
    assert planned(retry=[Status.DIVERGED])[:4] == ["kept", "kept", "retried (diverged)", "new"]
    assert planned(shard="2/4") == ["kept", "new", "new", "new"]
    with pytest.raises(StudyError, match=r"solver\.kynd"):
        planned(only="solver.kynd=newton")


def test_a_plan_says_what_its_seconds_rest_on_and_how_many_cases_run_at_a_time(tmp_path):
    study = grid()
    before = plan_of(study, tmp_path, jobs=2)
    assert before.basis.startswith("forecast: 5 Newton iterations")
    assert before.seconds == pytest.approx(STARTUP + before.cases["seconds_expected"].sum() / 2)
    assert math.isnan(before.seconds_most)
    for case in study.cases[:4]:
        Parts(tmp_path).save(identity_of(case), part(case=case.id, clock="processor"), case.parameters, 3.0)
    after = plan_of(study, tmp_path, jobs=2)
    told = "forecast: from the seconds of 4 cases of this study in the folder, by what is swept, each within a factor 1"
    assert after.basis == told
    assert len(after.left) == 12
    assert after.seconds == pytest.approx(12 * 3.0 / 2, rel=0.3)
    assert plan_of(study, tmp_path, only="case=" + study.cases[5].id, jobs=2).jobs == 1


def test_several_cases_at_a_time_are_counted_before_they_are_timed(tmp_path, monkeypatch):
    costs = costs_of(grid())
    monkeypatch.setattr("nlsolve.running.planning.plan.forecast", lambda study: costs.copy())
    study = replace(grid(), timing=Timing(lane="exclusive"))
    one, two = (plan_of(study, tmp_path, jobs=jobs) for jobs in (1, 2))
    counting = STARTUP + len(study.cases) * (2.0 + OVERHEAD) / 2
    assert two.seconds == pytest.approx(one.seconds + counting)
    assert two.seconds_most == pytest.approx(one.seconds_most + counting)


def test_a_run_keeps_how_long_each_case_took(tmp_path):
    study = replace(grid(), cases=grid().cases[:2])
    run(study, tmp_path, isolation="none")
    for case in study.cases:
        entry = Parts(tmp_path).entry(identity_of(case).key)
        assert entry is not None
        assert entry.measured["seconds_all"] < entry.elapsed < 60.0


def test_a_run_keeps_what_each_case_has_waited_for(tmp_path):
    study = replace(grid(), cases=grid().cases[:3])
    run(study, tmp_path, jobs=1, isolation="process")
    first, *later = [Parts(tmp_path).entry(identity_of(case).key) for case in study.cases]
    assert first is not None
    assert 0.1 < first.startup < 60.0
    assert [entry.startup for entry in later if entry is not None] == [0.0, 0.0]


def test_the_command_takes_the_options_of_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    path = str(write_study(Path(tmp_path)))
    told = CliRunner().invoke(app, ["plan", path, "--only", "solver.order=10", "--shard", "1/2", "--jobs", "1"])
    assert "1 new (results in results/study)" in told.stdout
    assert "s to run 1 case (forecast" in told.stdout
    none = CliRunner().invoke(app, ["plan", path, "--failed"])
    assert "none chosen (results in results/study)" in none.stdout
    assert CliRunner().invoke(app, ["plan", path, "--retry", "tired"]).exit_code == 2
