"""A study that names a reference: one more case a scene, and the distance of all others from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import nlsolve
from nlsolve import Study
from nlsolve.registry.problems import StudyError
from nlsolve.results.frames import Frames
from nlsolve.results.reference_error import with_reference_errors

STUDY: dict[str, Any] = {
    "question": "How far from the reference?",
    "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
    "law": {"kind": "power-law", "index": 0.5, "regularization": 1e-2},
    "discretizer": {"kind": "delaunay"},
    "solver": {"kind": "newton"},
    "sweep": [
        {
            "each": [
                {"name": "rough", "stop.tolerance": 1e-2},
                {"name": "fine", "stop.tolerance": 1e-8, "solver.kind": "modified-newton", "refresh.limit": 0.3},
            ]
        },
        {"grid": {"law.index": [0.5, 0.3]}},
    ],
    "reference": {
        "solver": {"kind": "newton"},
        "refresh": {"kind": "every-iteration"},
        "stop": {"tolerance": 1e-12},
    },
}


def test_every_scene_gets_one_reference_and_every_case_names_its_own() -> None:
    study = Study.from_dict(STUDY)
    references = [case for case in study.cases if not case.reference]
    assert len(study.cases) == 6
    assert [case.parameters["variant"] for case in references] == ["reference", "reference"]
    assert [case.parts.stop.tolerance for case in references] == [1e-12, 1e-12]
    by_id = {case.id: case for case in study.cases}
    for case in study.cases[2:]:
        assert by_id[case.reference].parts.law == case.parts.law
        assert by_id[case.reference].parts.solver.kind_name() == "newton"
        assert by_id[case.reference].parts.refresh.kind_name() == "every-iteration"


def test_the_error_is_the_distance_of_the_recorded_velocities() -> None:
    results = nlsolve.run(STUDY)
    runs = results.runs.set_index("case")
    for case in results.study.cases[2:]:
        v, exact = (
            results.fields[results.fields["case"] == name][["u", "v"]].to_numpy() for name in (case.id, case.reference)
        )
        expected = np.linalg.norm(v - exact) / np.linalg.norm(exact)
        assert runs.loc[case.id, "reference_error"] == pytest.approx(expected, rel=1e-12)
    rough, fine = (runs[runs["variant"] == name]["reference_error"] for name in ("rough", "fine"))
    assert (fine.to_numpy() < 1e-6).all()
    assert (rough.to_numpy() > 1e-5).all()
    assert runs[runs["variant"] == "reference"]["reference_error"].isna().all()


def test_a_case_that_is_the_reference_is_not_run_twice() -> None:
    study = Study.from_dict(
        {name: value for name, value in STUDY.items() if name not in ("sweep", "refresh")}
        | {"reference": {"stop": {"tolerance": 1e-8}}, "stop": {"tolerance": 1e-8}}
    )
    (case,) = study.cases
    assert case.reference == case.id


def test_what_is_set_by_hand_holds_for_the_reference_too_but_for_what_the_reference_settles() -> None:
    study = Study.from_dict(STUDY, {"scene.angular_speed": 50.0, "stop.tolerance": 1e-3})
    assert {case.parts.scene.model_dump()["angular_speed"] for case in study.cases} == {50.0}
    assert {case.parts.stop.tolerance for case in study.cases if not case.reference} == {1e-12}
    assert {case.parts.stop.tolerance for case in study.cases if case.reference} == {1e-3}


def test_a_wrong_reference_is_told() -> None:
    with pytest.raises(StudyError, match=r"solver\.kind = 'nevton'.*did you mean 'newton'"):
        Study.from_dict({**STUDY, "reference": {"solver": {"kind": "nevton"}}})


def test_runs_that_ended_at_another_time_have_no_error() -> None:
    fields = pd.DataFrame({"case": ["a", "b", "b"], "time": [0.1, 0.1, 0.2], "u": 1.0, "v": 0.0})
    runs = pd.DataFrame({"case": ["a", "b", "c"]})
    frames = with_reference_errors(Frames(runs, pd.DataFrame(), fields), {"a": "b", "c": "b"})
    assert frames.runs["reference_error"].isna().all()
