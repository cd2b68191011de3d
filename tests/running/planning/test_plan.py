"""What a run would do: which cases, why, and how long they take, learned from those that have been run."""

from __future__ import annotations

import math
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
from nlsolve.running.planning.experience import OVERHEAD, seconds_expected
from nlsolve.running.planning.plan import plan_of
from nlsolve.running.runner import run
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import Parts
from nlsolve.study.case import Case
from nlsolve.study.study import Study

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


def true_seconds(case: Case) -> float:
    """A product of what the solver and the tolerance cost."""
    return (1.0 + 3.0 * SOLVERS.index(case.parameters["solver.kind"])) * -math.log10(case.parameters["stop.tolerance"])


def test_the_seconds_of_cases_follow_from_those_with_the_same_values():
    cases = grid().cases
    known = {case.id: true_seconds(case) for number, case in enumerate(cases) if number % 3 != 1}
    expected = seconds_expected(cases, dict.fromkeys([case.id for case in cases], 0.0), known)
    for case in cases:
        assert expected[case.id] == pytest.approx(true_seconds(case), rel=0.25)
        assert case.id not in known or expected[case.id] == known[case.id]


def test_a_value_that_no_known_case_has_lies_on_the_line_of_the_others():
    cases = grid((1e-2, 1e-4, 1e-8, 1e-16)).cases
    seconds = {case.id: case.parameters["stop.tolerance"] ** -0.25 for case in cases}
    known = {case.id: seconds[case.id] for case in cases if case.parameters["stop.tolerance"] > 1e-10}
    expected = seconds_expected(cases, dict.fromkeys([case.id for case in cases], 0.0), known)
    for case in cases:
        assert expected[case.id] == pytest.approx(seconds[case.id], rel=0.4)


def test_where_nothing_has_been_run_unit_costs_tell_and_each_case_has_an_overhead():
    cases = grid().cases
    forecast = {case.id: float(number) for number, case in enumerate(cases)}
    assert seconds_expected(cases, forecast, {}) == {case: seconds + OVERHEAD for case, seconds in forecast.items()}
    blind = seconds_expected(cases, {**forecast, cases[0].id: math.nan}, {cases[1].id: 7.0})
    assert blind == pytest.approx(dict.fromkeys(blind, 7.0)), "one case says the same of all"


def test_a_forecast_from_unit_costs_scales_what_is_known():
    cases = grid().cases
    forecast = {case.id: 10.0**number for number, case in enumerate(cases)}
    expected = seconds_expected(cases, forecast, {cases[3].id: 2.0 * (forecast[cases[3].id] + OVERHEAD)})
    assert expected[cases[6].id] == pytest.approx(2.0 * (forecast[cases[6].id] + OVERHEAD))


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
    assert before.seconds == pytest.approx(before.cases["seconds_expected"].sum() / 2)
    for case in study.cases[:4]:
        Parts(tmp_path).save(identity_of(case), part(case=case.id, clock="processor"), case.parameters, 3.0)
    after = plan_of(study, tmp_path, jobs=2)
    assert after.basis == "forecast: from the seconds of 4 cases of this study in the folder, by what is swept"
    assert len(after.left) == 12
    assert after.seconds == pytest.approx(12 * 3.0 / 2, rel=0.3)
    assert plan_of(study, tmp_path, only="case=" + study.cases[5].id, jobs=2).jobs == 1


def test_a_run_keeps_how_long_each_case_took(tmp_path):
    study = replace(grid(), cases=grid().cases[:2])
    run(study, tmp_path, isolation="none")
    for case in study.cases:
        entry = Parts(tmp_path).entry(identity_of(case).key)
        assert entry is not None
        assert entry.measured["seconds_all"] < entry.elapsed < 60.0


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
