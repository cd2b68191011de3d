"""A march that begins at rest: V = 0 inside at t = 0, and the first increment is the method's own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from cases import FlowCase, setup
from nlsolve_laws import Bingham, PowerLaw
from nlsolve_rules.predictors import Polynomial, Previous
from nlsolve_rules.refresh import EveryIteration, PoorContraction, RangeUnderOne
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Broyden, Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

import nlsolve
from nlsolve.contracts.scene import Misfit
from nlsolve.flow.continuation import Start
from nlsolve.flow.march import FlowSimulation
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import NodeMotion, Physics, Recording, TimeSteps
from nlsolve.running.forecast import forecast
from nlsolve.solving.simulate import Progress, Record, run_case
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.work.ledger import Ledger

DT = 1e-4
SPEED = 150.0  # of the tool's wall [mm/s]
REST = Start(at="rest")
MOVING = NodeMotion(nodes="lagrangian")


def marching(steps: int, index: float = 0.3, **parts: Any) -> FlowCase:
    """A spin on coarse rings that begins at rest and records every increment, but for the parts given."""
    given: dict[str, Any] = {
        "time": TimeSteps(horizon=steps * DT),
        "record": Recording(times=tuple(k * DT for k in range(steps + 1))),
        "stop": StoppingTest(tolerance=1e-9),
        "start": REST,
    }
    return setup(StirringTool(nodes=Rings(spacing=0.5)), index, **(given | parts))


def recorded(record: Record, *columns: str) -> list[np.ndarray]:
    """The named columns of the fields at t = 0 and at the end of each increment, one (N, c) each."""
    return [frame[list(columns)].to_numpy(dtype=float) for _, frame in record.fields.groupby("time")]


METHODS = [
    (Newton(), EveryIteration()),
    (ModifiedNewton(), PoorContraction()),
    (Broyden(), PoorContraction()),
    (AsymptoticNumericalMethod(order=10), RangeUnderOne()),
    (AsymptoticNumericalMethod(order=20), RangeUnderOne()),
]


@pytest.mark.parametrize(("solver", "refresh"), METHODS)
def test_the_first_increment_is_the_methods_own_and_leads_to_the_state(solver: Any, refresh: Any) -> None:
    """Quasi-static on fixed nodes: each increment is the flow that continuation reaches, whatever was before."""
    case = marching(3, solver=solver, refresh=refresh)
    rest, led = run_case(case), run_case(replace(case, start=Start()))
    row, other = rest.summary, led.summary
    assert row["status"] == other["status"] == "converged"
    assert row["start_factorizations"] == row["start_triangular_solves"] == row["start_residuals"] == 0
    assert row["seconds_start"] == 0.0
    first = rest.steps.query("increment == 1")
    assert first["tangents"].max() == row["tangents"] == row["factorizations"] > 1
    assert first["triangular_solves"].max() == row["triangular_solves"]  # later increments begin at their solution
    assert other["factorizations"] == 0
    assert row["validity_time"] == 0.0
    for k in (1, 2, 3):
        gap = recorded(rest, "u", "v")[k] - recorded(led, "u", "v")[k]
        assert np.abs(gap).max() < 1e-6 * SPEED


def test_fields_at_the_beginning_are_those_of_rest_beside_moving_walls() -> None:
    start = run_case(marching(1)).fields.query("time == 0")
    inside, tool = start.query("boundary == ''"), start.query("boundary == 'tool'")
    assert (inside[["u", "v"]] == 0.0).all(axis=None)
    np.testing.assert_allclose(tool["u"], -100.0 * tool["y"], atol=1e-12)
    np.testing.assert_allclose(tool["v"], 100.0 * tool["x"], atol=1e-12)
    assert (start.query("boundary == 'plate'")[["u", "v"]] == 0.0).all(axis=None)


def quasi_static(case: FlowCase) -> Flow:
    """The flow of a case on its cloud at t = 0, without inertia."""
    simulation = FlowSimulation(replace(case, physics=Physics()), Ledger().entry)
    simulation.begin()
    return simulation.state.flow_of(case.law)


def test_with_inertia_the_first_increment_starts_from_the_velocity_of_rest() -> None:
    """R(V₁) + ρ V₁/Δt = 0 with R of the quasi-static flow, and V_k tends to the flow as k grows."""
    density = 1e-2
    case = marching(4, physics=Physics(inertia=True, density=density), stop=StoppingTest(tolerance=1e-12))
    velocities = recorded(run_case(case), "u", "v")
    flow = quasi_static(case)
    u = flow.unknowns(velocities[1])
    force = density / DT * u
    assert np.linalg.norm(flow.residual(u) + force) < 1e-8 * np.linalg.norm(force)
    steady = recorded(run_case(replace(case, start=Start())), "u", "v")[0]
    gaps = [np.abs(velocity - steady).max() for velocity in velocities]
    assert (np.diff(gaps) < 0.0).all()
    assert gaps[1] > 1e-2 * SPEED


def test_the_papers_inertia_is_too_small_to_be_seen() -> None:
    case = marching(1, physics=Physics(inertia=True))
    gap = recorded(run_case(case), "u", "v")[1] - recorded(run_case(replace(case, start=Start())), "u", "v")[1]
    assert np.abs(gap).max() < 1e-6 * SPEED


def test_nodes_inside_stay_in_the_first_increment_and_the_wall_turns() -> None:
    """x₁ = x₀ and x₂ = x₁ + 3/2 Δt V₁ inside, the path of a velocity that grows linearly from rest within Δt."""
    record = run_case(marching(3, 0.1324, motion=MOVING))
    x, v = recorded(record, "x", "y"), recorded(record, "u", "v")
    boundary = record.fields.query("time == 0")["boundary"].to_numpy()
    inside, tool = boundary == "", boundary == "tool"
    np.testing.assert_array_equal(x[1][inside], x[0][inside])
    np.testing.assert_allclose(x[2][inside], x[1][inside] + 1.5 * DT * v[1][inside], atol=1e-14)
    cosine, sine = np.cos(100.0 * DT), np.sin(100.0 * DT)
    np.testing.assert_allclose(x[1][tool], x[0][tool] @ np.array([[cosine, sine], [-sine, cosine]]), atol=1e-14)
    assert record.summary["cloud_quality"] > 0.97


def test_markers_follow_a_velocity_that_grows_linearly_in_the_first_increment() -> None:
    """In a steady swirl they are half an increment behind those of a march that began with the flow."""
    steps = 4
    case = marching(steps, 0.5, motion=NodeMotion(markers=True))
    turned = []
    for start in (REST, Start()):
        places = recorded(run_case(replace(case, start=start)), "x0", "y0", "marker_x", "marker_y")[-1]
        angles = np.angle((places[:, 2] + 1j * places[:, 3]) / (places[:, 0] + 1j * places[:, 1]))
        near = (np.hypot(places[:, 0], places[:, 1]) > 1.6) & (np.hypot(places[:, 0], places[:, 1]) < 2.6)
        turned.append(angles[near])
    np.testing.assert_allclose(turned[0] / turned[1], (steps - 0.5) / steps, rtol=1e-3)


def test_a_predictor_does_not_extrapolate_from_rest() -> None:
    case = marching(3, 0.3, motion=MOVING)
    begun = [
        run_case(replace(case, predictor=predictor)).steps.query("step == 0")["residual_norm"].to_numpy()
        for predictor in (Previous(), Polynomial(degree=1))
    ]
    np.testing.assert_array_equal(begun[0][:2], begun[1][:2])
    assert begun[0][2] != begun[1][2]


def test_progress_counts_the_work_of_the_first_increment() -> None:
    heard: list[Progress] = []
    row = run_case(marching(2), heard.append).summary
    assert [(told.increment, told.increments) for told in heard] == [(1, 2), (2, 2)]
    assert 1 < heard[0].tangents <= heard[1].tangents == row["tangents"]


def test_the_pressure_is_iterated_from_rest_too() -> None:
    physics = Physics(penalty=100.0, divergence_tolerance=1e-6)
    row = run_case(marching(1, 0.5, physics=physics)).summary
    assert row["status"] == "converged"
    assert row["pressure_iterations"] > 0
    assert row["divergence"] <= 1e-6


def test_a_first_increment_that_fails_leaves_nothing_measured() -> None:
    row = run_case(marching(2, budget=Budget(iterations=1))).summary
    assert row["status"] == "budget spent"
    assert (row["increments"], row["time"], row["iterations"]) == (0, 0.0, 1)
    assert pd.isna(row["validity_time"])
    assert "velocity_error" not in row
    assert row["residual_absolute"] > row["residual_norm"] > 1e-9
    assert "the residual is largest at" in row["message"]


def test_a_march_in_python_has_the_state_of_rest_first() -> None:
    study = {
        "scene": {"kind": "stirring-tool", "motion": "spin", "nodes": {"kind": "rings", "spacing": 0.75}},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "mls"},
        "solver": {"kind": "newton"},
        "time": {"horizon": 2 * DT},
        "start": {"at": "rest"},
    }
    found = nlsolve.march(study)
    np.testing.assert_allclose(found.times, [0.0, DT, 2 * DT])
    assert np.linalg.norm(found.velocities[0], axis=1).max() == pytest.approx(SPEED)
    (place,) = np.array([[4.5, 0.0]])
    begun, half, there = (found.velocity([place], time)[0, 1] for time in (0.0, 0.5 * DT, DT))
    assert abs(begun) < 1e-12
    assert half == pytest.approx(0.5 * there)


# What is known, or refused, before anything is solved.


def test_there_are_no_stages_to_forecast() -> None:
    case = marching(5)

    def stages(start: Start) -> int:
        return FlowSimulation(replace(case, start=start), Ledger().entry).workload().stages

    assert stages(case.start) == 0
    assert stages(Start(values=(1.0, 0.5))) == 3  # n = 1, 0.5 and 0.3
    assert stages(Start()) == 1  # the descent
    problem, u = FlowSimulation(case, Ledger().entry).sample()
    assert np.isfinite(problem.residual(u)).all()
    study = nlsolve.Study.from_dict(
        {
            "question": "What does it cost?",
            "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
            "law": {"kind": "power-law", "index": 0.5},
            "discretizer": {"kind": "mls"},
            "solver": {"kind": "newton"},
            "time": {"horizon": 2 * DT},
            "sweep": [{"grid": {"start.at": ["state", "rest"]}}],
        }
    )
    seconds = forecast(study).set_index("start.at")["seconds_start"]
    assert seconds["rest"] == 0.0 < seconds["state"]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("by", "load"),
        ("values", ()),
        ("values", (1.0,)),
        ("adaptive", True),
        ("tolerance", 1e-6),
        ("solver", Broyden()),
    ],
)
def test_rest_and_a_continuation_contradict_each_other(field: str, value: Any) -> None:
    with pytest.raises(ValidationError, match=rf'{field}: a march from rest has no continuation: .* at = "state"'):
        Start(at="rest", **{field: value})


def test_a_march_from_rest_may_be_perturbed() -> None:
    case = marching(1)
    moved = run_case(replace(case, start=Start(at="rest", perturbation=0.01)))
    assert moved.summary["status"] == "converged"
    plain = run_case(case)
    assert moved.steps["residual_norm"].iloc[0] != plain.steps["residual_norm"].iloc[0]
    assert moved.summary["velocity_error"] == pytest.approx(plain.summary["velocity_error"], rel=1e-5)


def test_a_steady_scene_has_no_increment_to_begin() -> None:
    case = marching(1, time=TimeSteps())
    with pytest.raises(Misfit, match=r"start\.at: a steady scene has no increment .* values = \[\]"):
        case.scene.check(case)


@pytest.mark.parametrize("index", [0.1324, 0.5])
def test_a_law_that_is_not_finite_at_rest_is_refused(index: float) -> None:
    case = marching(1, law=PowerLaw(index=index, regularization=0.0))
    with pytest.raises(Misfit, match=r"start\.at: .* no finite viscosity at ε̄ = 0.* law\.regularization > 0"):
        case.scene.check(case)
    case.scene.check(replace(case, start=Start()))


def test_a_law_without_the_usual_field_needs_no_continuation_from_rest() -> None:
    """Bingham's law is not continued by its index: a start by continuation must say by what, one from rest need not."""
    case = marching(1, law=Bingham())
    case.scene.check(case)
    with pytest.raises(Misfit, match=r"start\.by"):
        case.scene.check(replace(case, start=Start()))
