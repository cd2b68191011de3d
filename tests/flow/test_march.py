"""The march: increments, moving nodes, what is recorded, and how it ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import agreement
import numpy as np
import pandas as pd
import pytest
from cases import FlowCase, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_rules import Cubic, Energy, FullSteps, NonMonotone
from nlsolve_rules.refresh import EveryIteration, EveryM, Never, PoorContraction, RangeUnderOne
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Anderson, Broyden, Newton, NewtonKrylov, Picard, PseudoTransient, TrustRegion
from nlsolve_solvers.external import ScipyRoot
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

from nlsolve import SolveError, Status
from nlsolve.flow.continuation import VALUES, Start
from nlsolve.plugin import Cloud, NodeMotion, Operators, Physics, Recording, Step, TimeSteps
from nlsolve.results.columns import FIELDS, RUNS, STEPS
from nlsolve.solving.simulate import Progress, Record
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import Budget, StoppingTest

COARSE = Rings(spacing=0.5)
DT = 1e-4


FIXED = NodeMotion()


def marching(steps: int, index: float = 0.5, increment: float = DT, **parts: Any) -> FlowCase:
    """A spin marched for some increments, on nodes that move with the material but for the parts given."""
    time = TimeSteps(horizon=steps * increment, increment=increment)
    moving = {"time": time, "motion": NodeMotion(nodes="lagrangian")}
    return setup(StirringTool(nodes=COARSE), index, **(moving | parts))


def times(steps: int, increment: float = DT) -> tuple[float, ...]:
    return tuple(k * increment for k in range(steps + 1))


def every(steps: int, increment: float = DT) -> Recording:
    return Recording(times=times(steps, increment))


def field(record: Record, time: float) -> pd.DataFrame:
    frame = record.fields
    return frame[np.isclose(frame["time"], time, atol=0.1 * DT)]


# Steady scenes.


@pytest.mark.parametrize("index", [1.0, 0.5, 0.3, 0.1324])
def test_steady_spin_converges(index: float) -> None:
    record = march(setup(StirringTool(nodes=COARSE), index))
    row = record.summary
    assert row["status"] == "converged"
    assert (row["increments"], row["time"], row["nodes"]) == (1, 0.0, 466)
    assert row["unknowns"] == 2 * (466 - 18 - 75)
    assert row["residual_norm"] <= 1e-10
    assert row["velocity_error"] < 0.15
    assert row["torque_error"] < 0.15
    assert len(record.fields) == 466
    assert pd.isna(row["validity_time"])


def test_columns_are_those_documented() -> None:
    record = march(marching(2, record=Recording(probe=(2.0, 0.0))))
    assert set(record.summary) <= set(RUNS)
    assert list(record.steps.columns) == [column for column in STEPS if column != "case"]
    assert set(record.fields.columns) == set(FIELDS) - {"case", "unknown", "value"}


def test_continuation_is_counted_apart() -> None:
    direct = march(setup(StirringTool(nodes=COARSE), 0.3, start=Start(values=())))
    led = march(setup(StirringTool(nodes=COARSE), 0.3, start=Start(values=VALUES)))
    assert direct.summary["start_factorizations"] == 0
    assert led.summary["start_factorizations"] > 0
    assert led.summary["start_triangular_solves"] == led.summary["start_factorizations"]
    assert led.summary["factorizations"] < direct.summary["factorizations"]
    assert led.summary["velocity_error"] == pytest.approx(direct.summary["velocity_error"], rel=1e-5)


def test_continuation_may_go_by_the_regularisation() -> None:
    start = Start(by="regularization", values=(100.0, 10.0, 1.0))
    row = march(setup(StirringTool(nodes=COARSE), 0.3, start=start)).summary
    other = march(setup(StirringTool(nodes=COARSE), 0.3)).summary
    assert row["status"] == "converged"
    assert row["velocity_error"] == pytest.approx(other["velocity_error"], rel=1e-5)


class Watched(Newton):
    """Newton's method, which tells where it was begun."""

    def steps(self, problem: Any, tangent: Any, start: np.ndarray) -> Iterator[Step]:
        BEGUN.append(start.copy())
        yield from super().steps(problem, tangent, start)


BEGUN: list[np.ndarray] = []


def guesses(case: FlowCase, **start: Any) -> list[np.ndarray]:
    """Where the case's own method began."""
    BEGUN.clear()
    watched = replace(case, solver=Watched(), start=Start(**start))
    assert march(watched).summary["status"] == "converged"
    return list(BEGUN)


def test_a_perturbation_has_its_size_relative_to_the_velocity() -> None:
    """‖guess − undisturbed guess‖₂ = ε ‖V‖₂: after continuation the state it led to, from rest the walls' velocity."""
    case = setup(StirringTool(nodes=COARSE))
    wall = 150.0 * np.sqrt(18)  # 18 nodes on the tool, 150 mm/s each
    (rest,), (moved,) = guesses(case, values=()), guesses(case, values=(), perturbation=0.03, seed=1)
    np.testing.assert_array_equal(rest, 0.0)
    assert np.linalg.norm(moved) == pytest.approx(0.03 * wall, rel=1e-12)
    (plain,), (moved,) = guesses(case, values=(1.0,)), guesses(case, values=(1.0,), perturbation=0.03)
    whole = np.hypot(wall, np.linalg.norm(plain))
    assert np.linalg.norm(moved - plain) == pytest.approx(0.03 * whole, rel=1e-12)


def test_a_perturbation_follows_from_its_seed_and_the_increment() -> None:
    case = marching(3, motion=FIXED)
    still = guesses(case)
    one, again = (guesses(case, perturbation=1e-3, seed=1) for _ in range(2))
    other = guesses(case, perturbation=1e-3, seed=2)
    np.testing.assert_array_equal(one, again)
    changes = [guess - plain for guess, plain in zip(one, still, strict=True)]
    assert len(changes) == 3
    assert np.linalg.norm(changes[0] - changes[1]) > np.linalg.norm(changes[0])  # drawn anew for each increment
    assert np.linalg.norm(other[0] - one[0]) > 1e-3


def test_a_perturbation_changes_the_way_and_not_the_solution() -> None:
    plain = march(marching(2, 0.3, motion=FIXED, record=every(2)))
    moved = march(marching(2, 0.3, motion=FIXED, record=every(2), start=Start(perturbation=0.01)))
    assert plain.summary["factorizations"] == 0
    assert moved.summary["factorizations"] > 0
    assert plain.summary["start_factorizations"] == moved.summary["start_factorizations"]
    gap = field(plain, 2 * DT)["u"].to_numpy() - field(moved, 2 * DT)["u"].to_numpy()
    assert np.abs(gap).max() < 1e-6 * 150.0


def test_without_a_perturbation_there_is_nothing_to_draw() -> None:
    assert Start(seed=3) == Start()
    assert Start(perturbation=0.1, seed=3) != Start(perturbation=0.1)
    with pytest.raises(ValidationError, match="perturbation"):
        Start(perturbation=-0.1, seed=3)


RIVALS = [
    (Newton(globalization=FullSteps()), EveryIteration()),
    (Newton(), EveryIteration()),
    (Newton(globalization=NonMonotone()), EveryIteration()),
    (Newton(globalization=Cubic()), EveryIteration()),
    (ModifiedNewton(), PoorContraction()),
    (Anderson(), PoorContraction()),
    (Broyden(), PoorContraction()),
    (Picard(), EveryIteration()),
    (NewtonKrylov(), PoorContraction()),
    (TrustRegion(), PoorContraction()),
    (PseudoTransient(), EveryIteration()),
    (AsymptoticNumericalMethod(), RangeUnderOne()),
    (AsymptoticNumericalMethod(extrapolation="pade", range="pade-pair"), RangeUnderOne()),
    (ScipyRoot(), PoorContraction()),
]


@pytest.mark.parametrize(("solver", "refresh"), RIVALS)
def test_from_rest_every_method_ends_in_the_solution_or_in_a_sentence(solver: Any, refresh: Any) -> None:
    """n = 0.1324 without continuation: all work is the method's own, and what it ends in is verified."""
    stop, start = StoppingTest(tolerance=1e-8), Start(values=())
    parts: dict[str, Any] = {"discretizer": LinearTriangles(), "solver": solver, "refresh": refresh}
    row = march(setup(StirringTool(nodes=COARSE), 0.1324, stop=stop, start=start, **parts)).summary
    assert row["start_factorizations"] == row["start_residuals"] == 0
    if row["status"] == "converged":
        assert row["residual_norm"] <= 1e-8
        assert row["velocity_error"] == pytest.approx(0.006126, abs=2e-5)  # triangles have one root only
        assert row["factorizations"] > 0
    else:
        assert row["status"] in {"diverged", "stagnated", "budget spent", "non finite", "range exhausted"}
        assert row["residual_norm"] > 1e-8
        assert row["message"].startswith(Status[row["status"].upper().replace(" ", "_")].sentence)


def test_a_potential_is_descended_from_rest_and_from_any_disturbed_start() -> None:
    """Triangles make R the gradient of a convex potential: one root, and a search on the slope that cannot fail."""
    parts: dict[str, Any] = {"discretizer": LinearTriangles(), "solver": Newton(globalization=Energy())}
    starts = [Start(values=())] + [Start(values=(), perturbation=10.0, seed=seed) for seed in range(3)]
    rows = [march(setup(StirringTool(nodes=COARSE), 0.1324, start=start, **parts)).summary for start in starts]
    assert [row["status"] for row in rows] == ["converged"] * 4
    errors = [row["velocity_error"] for row in rows]
    np.testing.assert_allclose(errors, errors[0], rtol=1e-4)


def test_a_potential_is_not_there_from_rest_either() -> None:
    row = march(
        setup(StirringTool(nodes=COARSE), solver=Newton(globalization=Energy()), start=Start(values=()))
    ).summary
    assert row["status"] == "not applicable"
    assert "conservative discretizer" in row["message"]


def test_a_start_by_an_unknown_field_is_a_mistake_of_the_caller() -> None:
    with pytest.raises(ValueError, match=r"start\.by = 'indx'"):
        march(setup(StirringTool(nodes=COARSE), start=Start(by="indx")))


def test_torque_of_a_fine_cloud_is_the_exact_one() -> None:
    row = march(setup(StirringTool(), 1.0)).summary
    assert row["torque"] == pytest.approx(165636.716, rel=2e-3)
    assert row["torque_error"] == pytest.approx(abs(row["torque"] / 165636.716 - 1.0), abs=1e-7)


def test_torque_does_not_depend_on_the_sign_of_the_pressure() -> None:
    """A penalty adds a pressure, and a pressure on a circle has no moment."""
    with_penalty = march(setup(StirringTool(nodes=COARSE), 1.0, physics=Physics(penalty=100.0))).summary
    without = march(setup(StirringTool(nodes=COARSE), 1.0)).summary
    assert with_penalty["torque"] == pytest.approx(without["torque"], rel=1e-2)
    assert abs(with_penalty["force_x"]) < 1e-2 * without["torque"] / 1.5


# Marching.


def test_homotopy_and_newton_march_the_same_way_at_every_increment() -> None:
    """Lagrangian nodes, ten increments: velocities agree to 1e-6 of the tool speed, nodes to what that moves them."""
    steps = 10
    common: dict[str, Any] = {"stop": StoppingTest(tolerance=1e-9), "record": every(steps)}
    newton = march(marching(steps, 0.3, **common))
    anm = march(marching(steps, 0.3, solver=AsymptoticNumericalMethod(), refresh=RangeUnderOne(), **common))
    modified = march(marching(steps, 0.3, solver=ModifiedNewton(), refresh=PoorContraction(), **common))
    assert newton.summary["status"] == anm.summary["status"] == modified.summary["status"] == "converged"
    for time in times(steps):
        reference = field(newton, time)
        assert len(reference) == 466
        for other in (anm, modified):
            found = field(other, time)
            for component in "uv":
                gap = np.abs(found[component].to_numpy() - reference[component].to_numpy()).max()
                assert gap <= 1e-6 * 150.0
            assert np.abs(found[["x", "y"]].to_numpy() - reference[["x", "y"]].to_numpy()).max() <= 1e-6
    assert anm.summary["factorizations"] < newton.summary["factorizations"]


def test_tool_nodes_turn_by_exactly_omega_t() -> None:
    steps = 5
    record = march(marching(steps, record=every(steps)))
    for time in times(steps):
        tool = field(record, time).query("boundary == 'tool'")
        angle = 100.0 * time
        turned = tool[["x0", "y0"]].to_numpy() @ np.array(
            [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        )
        np.testing.assert_allclose(tool[["x", "y"]].to_numpy(), turned, atol=1e-13)
        plate = field(record, time).query("boundary == 'plate'")
        np.testing.assert_array_equal(plate[["x", "y"]].to_numpy(), plate[["x0", "y0"]].to_numpy())


def test_inner_nodes_move_by_a_second_order_rule() -> None:
    """Adams-Bashforth: x_{k+1} = x_k + Δt (3 v_k − v_{k−1})/2, read off the recorded places and velocities."""
    steps = 4
    record = march(marching(steps, increment=1e-3, record=every(steps, 1e-3)))
    frames = [part for _, part in record.fields.groupby("time")]
    assert len(frames) == steps + 1
    x = [part.query("boundary == ''")[["x", "y"]].to_numpy() for part in frames]
    v = [part.query("boundary == ''")[["u", "v"]].to_numpy() for part in frames]
    np.testing.assert_allclose(x[1], x[0] + 1e-3 * v[0], atol=1e-12)
    for k in range(1, steps):
        np.testing.assert_allclose(x[k + 1], x[k] + 0.5e-3 * (3.0 * v[k] - v[k - 1]), atol=1e-12)


def test_fixed_nodes_stay_and_the_quasi_static_state_with_them() -> None:
    record = march(marching(3, motion=FIXED, record=every(3)))
    frame = record.fields
    np.testing.assert_array_equal(frame[["x", "y"]].to_numpy(), frame[["x0", "y0"]].to_numpy())
    assert record.summary["increments"] == 3
    assert record.summary["factorizations"] == 0  # each increment begins at its own solution


def test_inertia_is_negligible_but_there() -> None:
    """Re ~ 1e-4 or less: the field stays put, and the solve is not the quasi-static one."""
    still = march(marching(2, 1.0, motion=FIXED, record=every(2)))
    heavy = march(marching(2, 1.0, physics=Physics(inertia=True, density=1.0), motion=FIXED, record=every(2)))
    light = march(marching(2, 1.0, physics=Physics(inertia=True), motion=FIXED, record=every(2)))
    u, w = field(still, 2 * DT), field(light, 2 * DT)
    assert np.abs(u["u"].to_numpy() - w["u"].to_numpy()).max() < 1e-6 * 150.0
    assert heavy.summary["status"] == "converged"


def test_probe_is_the_nearest_inner_node_followed_in_time() -> None:
    steps = 4
    record = march(marching(steps, record=Recording(times=times(steps), probe=(1.4, 0.1))))
    accepted = record.steps[record.steps["accepted"]]
    assert len(accepted) == steps
    first = field(record, 0.0)
    inner = first[first["boundary"] == ""]
    node = inner.iloc[int(np.hypot(inner["x"] - 1.4, inner["y"] - 0.1).argmin())]["node"]
    for time, x, y, u, v in accepted[["time", "probe_x", "probe_y", "probe_u", "probe_v"]].to_numpy():
        row = field(record, time).set_index("node").loc[node]
        np.testing.assert_array_equal([x, y, u, v], row[["x", "y", "u", "v"]].to_numpy(dtype=float))
    assert record.steps.loc[~record.steps["accepted"], "probe_x"].isna().all()


def test_one_step_of_every_increment_is_accepted_and_all_are_told() -> None:
    heard: list[Progress] = []
    record = march(marching(3), heard.append)
    assert [progress.increment for progress in heard] == [1, 2, 3]
    assert record.steps.groupby("increment")["accepted"].sum().tolist() == [1, 1, 1]
    iterations = record.steps.groupby("increment")["step"].max().sum()
    assert record.summary["iterations"] == iterations == record.summary["factorizations"]
    assert record.summary["iterations"] == record.summary["triangular_solves"]


def test_the_absolute_residual_of_a_march_is_the_largest_accepted() -> None:
    """In N/mm³: ‖R‖₂ of the problem at each step, and the relative residual times the size of its forces."""
    record = march(marching(3, stop=StoppingTest(tolerance=1e-6)))
    accepted = record.steps[record.steps["accepted"]]
    assert record.summary["residual_absolute"] == accepted["residual_absolute"].max()
    assert record.problem is not None
    assert record.state is not None
    last = np.linalg.norm(record.problem.residual(record.state))
    assert accepted["residual_absolute"].iloc[-1] == pytest.approx(last, rel=1e-12)
    assert (record.steps["residual_absolute"] > record.steps["residual_norm"]).all()


# Branches and validity: how long the first tangent of the march served.


def test_a_tangent_that_is_never_renewed_is_valid_to_the_end() -> None:
    record = march(marching(4, 1.0, solver=ModifiedNewton(), refresh=Never()))
    assert record.summary["tangents"] == 1
    assert record.summary["factorizations"] == 1
    assert record.summary["validity_time"] == pytest.approx(4 * DT)


def test_validity_ends_with_the_last_increment_the_first_tangent_served_alone() -> None:
    """Renewed after every m iterations: in the increment in which that falls the first tangent no longer serves."""
    record = march(marching(6, solver=ModifiedNewton(), refresh=EveryM(m=9)))
    steps = record.steps
    renewed = int(steps.loc[steps["tangents"] > 1, "increment"].min())
    assert renewed > 1
    assert record.summary["validity_time"] == pytest.approx((renewed - 1) * DT)
    assert record.summary["tangents"] == steps["tangents"].max()


def test_a_tangent_renewed_in_the_first_increment_was_valid_for_none() -> None:
    record = march(marching(3, 0.3, solver=Newton(), refresh=EveryIteration()))
    assert record.steps.query("increment == 1")["tangents"].max() > 1
    assert record.summary["validity_time"] == 0.0


# Endings.


class CollapsesAfter(MovingLeastSquares):
    """Gives up on the clouds after the first few."""

    count: int = 2

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        turned = np.arctan2(cloud.nodes[0, 1], cloud.nodes[0, 0])
        if turned > (self.count + 0.5) * 100.0 * DT:
            raise SolveError(Status.BAD_CLOUD, "two nodes met")
        return super().operators(cloud, volumetric)


def test_a_cloud_that_collapses_leaves_the_increments_done() -> None:
    record = march(marching(6, discretizer=CollapsesAfter(count=2)))
    assert record.summary["status"] == "bad cloud"
    assert "two nodes met" in record.summary["message"]
    assert record.summary["increments"] == 2
    assert record.steps["increment"].max() == 2
    assert record.summary["velocity_error"] < 0.2  # of the last solved increment


def test_the_time_reached_is_that_of_the_last_increment_solved() -> None:
    record = march(marching(6, discretizer=CollapsesAfter(count=2)))
    assert record.summary["time"] == pytest.approx(2 * DT)


def test_validity_does_not_reach_beyond_what_was_solved() -> None:
    parts = {"solver": ModifiedNewton(), "refresh": Never(), "discretizer": CollapsesAfter(count=2)}
    record = march(marching(6, 1.0, **parts))
    assert record.summary["validity_time"] == pytest.approx(2 * DT)


def test_an_increment_that_does_not_converge_ends_the_march_with_its_rows() -> None:
    """A budget of one chord iteration is too little once the nodes have moved."""
    stop = StoppingTest(tolerance=1e-10)
    record = march(
        marching(
            5,
            0.3,
            stop=stop,
            budget=Budget(iterations=60),
            refresh=Never(),
            solver=Newton(globalization={"kind": "none"}),
        )
    )
    assert record.summary["status"] == "converged"
    short = march(marching(5, 0.3, stop=stop, start=Start(tolerance=1e-2), budget=Budget(iterations=2)))
    assert short.summary["status"] == "budget spent"
    assert "iterations allowed" in short.summary["message"]
    assert short.summary["increments"] < 5
    last = short.steps[short.steps["increment"] == short.steps["increment"].max()]
    assert not last["accepted"].any()
    assert short.summary["nodes"] == 466


def test_a_first_state_that_fails_says_where() -> None:
    record = march(marching(2, 0.1324, budget=Budget(iterations=1)))
    assert record.summary["status"] == "budget spent"
    assert "on the way to the first state" in record.summary["message"]
    assert record.summary["increments"] == 0
    assert record.fields.empty


def test_a_cloud_that_cannot_be_made_leaves_a_row() -> None:
    row = march(setup(StirringTool(nodes=COARSE), discretizer=MovingLeastSquares(radius=0.3))).summary
    assert row["status"] == "bad cloud"
    assert "neighbours of the point" in row["message"]
    assert row["nodes"] == 466


def test_channel_on_its_default_grid_converges() -> None:
    """The regular grid: neighbours of a stress point come in ties."""
    law = PowerLaw(index=0.5, regularization=1e-3)
    row = march(setup(Channel(), law=law)).summary
    assert row["status"] == "converged", row["message"]
    assert row["velocity_error"] < 1e-2


@pytest.mark.slow
def test_the_homotopy_agrees_with_newton_on_the_papers_nodes() -> None:
    """1780 moving nodes, 20 increments: to 1e-6 mm/s at every node and increment."""
    differences = agreement.largest_differences()
    homotopy = next(values for name, values in differences.items() if name.startswith("anm"))
    assert len(homotopy) == agreement.INCREMENTS
    assert homotopy.max() < 1e-6
