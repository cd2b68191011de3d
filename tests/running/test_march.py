"""`nlsolve.march`: what is known of a flow at any point and time, and what is refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from nlsolve_laws import PowerLaw
from nlsolve_scenes import StirringTool

import nlsolve

STEADY: dict[str, Any] = {
    "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.5}},
    "law": {"kind": "power-law", "index": 1.0},
    "discretizer": {"kind": "delaunay"},
    "solver": {"kind": "newton"},
}
MARCHING = STEADY | {
    "physics": {"inertia": True},
    "time": {"horizon": 4e-4, "increment": 1e-4},
    "motion": {"nodes": "lagrangian"},
    "solver": {"kind": "modified-newton"},
}
POINTS = np.array([[2.0, 0.5], [-3.0, 1.0], [0.0, -4.5]])


@cache
def marched() -> nlsolve.March:
    return nlsolve.march(MARCHING)


def exact(points: np.ndarray) -> np.ndarray:
    found = StirringTool().exact(PowerLaw(index=1.0), points, 0.0)
    assert found is not None
    return found.velocity


def test_the_velocity_between_nodes_and_increments_is_that_of_the_flow():
    flow = marched()
    for time in (0.0, 1.3e-4, 4e-4):
        error = np.linalg.norm(flow.velocity(POINTS, time) - exact(POINTS)) / np.linalg.norm(exact(POINTS))
        assert error < 0.05, time


def test_at_the_nodes_it_is_the_state_but_for_the_smoothing_of_the_weights():
    flow = marched()
    assert flow.times.tolist() == pytest.approx([0.0, 1e-4, 2e-4, 3e-4, 4e-4])
    assert flow.nodes.shape == flow.velocities.shape == (5, flow.row["nodes"], 2)
    inside = np.hypot(*flow.nodes[2].T) < 5.0
    state = flow.velocities[2][inside]
    found = flow.velocity(flow.nodes[2][inside], 2e-4)
    assert np.linalg.norm(found - state) < 0.01 * np.linalg.norm(state)


def test_it_is_linear_in_time_between_the_increments():
    flow = marched()
    ends = [flow.velocity(POINTS, time) for time in (1e-4, 2e-4)]
    np.testing.assert_allclose(flow.velocity(POINTS, 1.25e-4), 0.75 * ends[0] + 0.25 * ends[1], rtol=1e-12)


def test_the_nodes_move_and_the_fields_are_those_a_study_records():
    flow = marched()
    assert np.abs(flow.nodes[-1] - flow.nodes[0]).max() > 0.01
    recorded = nlsolve.run({"question": "The same?", **MARCHING}).fields
    fields = flow.fields(4e-4)
    for name in ("x", "y", "u", "v", "exx", "rate"):
        np.testing.assert_allclose(fields[name], recorded[name], rtol=1e-9, atol=1e-9)
    assert flow.fields(1.4e-4)["time"].iloc[0] == pytest.approx(1e-4)


def test_outside_the_material_there_is_no_velocity():
    found = marched().velocity([[0.0, 0.0], [30.0, 0.0]], 1e-4)
    assert np.isnan(found).all()


def test_its_row_is_that_of_a_study():
    run = nlsolve.run({"question": "The same?", **MARCHING}).runs.iloc[0]
    for name in ("status", "tangents", "triangular_solves", "residual_norm", "velocity_error"):
        assert marched().row[name] == run[name]
    assert len(marched().steps) == run["iterations"] + run["increments"]


def test_a_steady_flow_has_one_state():
    flow = nlsolve.march(STEADY)
    assert flow.times.tolist() == [0.0]
    assert np.linalg.norm(flow.velocity(POINTS, 0.0) - exact(POINTS)) < 0.05 * np.linalg.norm(exact(POINTS))


def test_a_listener_is_told_of_every_increment():
    told: list[nlsolve.Progress] = []
    nlsolve.march(MARCHING, listen=told.append)
    assert [progress.increment for progress in told] == [1, 2, 3, 4]


def test_what_was_not_reached_or_is_no_place_is_refused():
    with pytest.raises(nlsolve.InputError, match=r"March.velocity: time = 1: t = 0 to 0.0004 s were solved"):
        marched().velocity(POINTS, 1.0)
    with pytest.raises(nlsolve.InputError, match=r"March.fields: time = -1"):
        marched().fields(-1.0)
    with pytest.raises(nlsolve.InputError, match=r"points of shape \(3,\): should be of shape \(T, 2\)"):
        marched().velocity([1.0, 2.0, 3.0], 1e-4)


def test_several_cases_or_no_flow_are_refused():
    with pytest.raises(nlsolve.StudyError, match="a march is of one case, and the study has 2: drop its sweeps"):
        nlsolve.march({**STEADY, "sweep": [{"grid": {"law.index": [1.0, 0.5]}}]})
    with pytest.raises(nlsolve.InputError, match="the scene 'bratu' is no flow"):
        nlsolve.march({"scene": {"kind": "bratu"}})
