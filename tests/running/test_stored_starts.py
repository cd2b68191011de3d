"""A case that begins with the stored state of another: what is counted, and what is said where there is none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import nlsolve
from nlsolve.running.planning.plan import plan_of
from nlsolve.study.study import Study

FLOW = {
    "question": "What does it cost from there?",
    "scene": {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.75}},
    "law": {"kind": "power-law", "index": 0.5, "regularization": 1e-3},
    "discretizer": {"kind": "mls"},
    "solver": {"kind": "newton"},
}
BRATU = {"question": "What is u?", "scene": {"kind": "bratu"}, "solver": {"kind": "newton"}}


@pytest.fixture(scope="module")
def stored(tmp_path_factory) -> tuple[Path, str, str]:
    """A folder with a flow and a system, and their cases."""
    folder = tmp_path_factory.mktemp("stored")
    flow = nlsolve.run(FLOW, folder, isolation="none")
    system = nlsolve.run(BRATU, folder, isolation="none")
    return folder, flow.runs["case"][0], system.runs["case"][0]


def begun_with(document: dict[str, object], folder: Path, case: str, **more: object) -> nlsolve.Results:
    start = {"stored": {"results": str(folder), "case": case}}
    return nlsolve.run({**document, "start": start, **more}, isolation="none")


def test_a_flow_that_begins_with_its_own_solution_needs_no_step_and_no_continuation(stored):
    folder, flow, _ = stored
    run = begun_with(FLOW, folder, flow).runs.iloc[0]
    assert run["status"] == "converged"
    assert (run["iterations"], run["factorizations"], run["start_factorizations"]) == (0, 0, 0)
    assert (run["start.stored.results"], run["start.stored.case"]) == (str(folder), flow)


def test_a_flow_of_another_law_or_other_nodes_begins_nearer_than_from_rest(stored):
    folder, flow, _ = stored
    harder = {**FLOW, "law": {"kind": "power-law", "index": 0.4, "regularization": 1e-3}}
    finer = {**FLOW, "scene": {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.5}}}
    for document in (harder, finer):
        from_rest = nlsolve.run({**document, "start": {"values": []}}, isolation="none")
        found = begun_with(document, folder, flow)
        assert set(found.runs["status"]) == set(from_rest.runs["status"]) == {"converged"}
        assert 0 < found.runs["iterations"][0] < from_rest.runs["iterations"][0]
        np.testing.assert_allclose(found.state(0), from_rest.state(0), atol=1e-4 * np.abs(from_rest.state(0)).max())


def test_a_march_solves_its_first_state_from_the_stored_one_and_counts_that_apart(stored):
    folder, flow, _ = stored
    march = {"time": {"horizon": 1e-4, "increment": 1e-4}, "physics": {"inertia": True}}
    found, usual = begun_with(FLOW, folder, flow, **march), nlsolve.run({**FLOW, **march}, isolation="none")
    assert found.runs["start_factorizations"][0] < usual.runs["start_factorizations"][0]
    np.testing.assert_allclose(found.state(0), usual.state(0), atol=1e-6 * np.abs(usual.state(0)).max())


def test_a_system_begins_with_a_stored_state(stored):
    folder, _, system = stored
    found = begun_with(BRATU, folder, system)
    assert (found.runs["status"][0], found.runs["iterations"][0]) == ("converged", 0)


@pytest.mark.parametrize(
    ("document", "case", "sentence"),
    [
        (FLOW, "nothing", "the state of case nothing in {folder} is not there: run the study of that folder, or name"),
        (FLOW, "system", "is of a system, and this scene is a flow: name a case of a flow"),
        (BRATU, "flow", "is of a flow, and this scene is a system: name a case of a system"),
        ({**BRATU, "scene": {"kind": "bratu", "nodes": 5}}, "system", "unknowns, and this system has"),
    ],
)
def test_a_state_that_does_not_serve_is_a_row_with_a_sentence(stored, document, case: str, sentence: str):
    folder, flow, system = stored
    run = begun_with(document, folder, {"flow": flow, "system": system}.get(case, case)).runs.iloc[0]
    assert run["status"] == "not applicable"
    assert "start.stored: the state of case" in run["message"]
    assert sentence.format(folder=folder) in run["message"]


def test_a_case_is_run_again_when_its_stored_state_has_changed_or_appears(stored, tmp_path):
    _, flow, _ = stored
    document = {**FLOW, "start": {"stored": {"results": str(tmp_path / "first"), "case": flow}}}
    results = tmp_path / "second"
    early = nlsolve.run(document, results, isolation="none")
    assert early.runs["status"][0] == "not applicable"
    nlsolve.run(FLOW, tmp_path / "first", isolation="none")
    late = nlsolve.run(document, results, isolation="none")
    assert (late.runs["status"][0], late.runs["iterations"][0]) == ("converged", 0)
    assert list(late.runs["case"]) == list(early.runs["case"]), "the case is the same, its input is another"
    assert list(plan_of(Study.from_dict(document), results, [], [], [], False, None, None).cases["plan"]) == ["kept"]
    (state,) = (tmp_path / "first" / "cases").glob(f"{flow}-*.fields.parquet")
    state.write_bytes(b"damaged")
    planned = plan_of(Study.from_dict(document), results, [], [], [], False, None, None).cases["plan"]
    assert list(planned) == [f"changed file {state}"]
    damaged = nlsolve.run(document, results, isolation="none")
    assert "is damaged: run the study of that folder" in damaged.runs["message"][0]


@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        ({"at": "rest"}, "stored: a march from rest begins with V = 0: leave it out"),
        (
            {"values": [1.0]},
            "values: a march from a stored state has no continuation: leave it out, or leave stored out",
        ),
        ({"stored": {"results": "r"}}, "case: required, and missing"),
    ],
)
def test_what_does_not_go_together_is_said(start: dict[str, object], sentence: str):
    document = {**FLOW, "start": {"stored": {"results": "r", "case": "c"}, **start}}
    with pytest.raises(nlsolve.StudyError) as caught:
        Study.from_dict(document)
    assert sentence in str(caught.value), json.dumps(str(caught.value))
