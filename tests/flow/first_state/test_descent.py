"""The descent through linear triangles: the state of the continuation by fewer matrices, or the continuation itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases import FlowCase, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import HerschelBulkley, PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Broyden, Newton, Picard

from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.scene import Simulation, Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.continuation import VALUES, Start
from nlsolve.flow.first_state import descent as descending
from nlsolve.flow.first_state.descent import TOLERANCES, TOLERANCES_ON_FEWER, may_descend
from nlsolve.flow.march import FlowSimulation
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Cloud, Operators, Physics, TimeSteps
from nlsolve.solving.simulate import Record, run_case
from nlsolve.solving.stopping import Budget
from nlsolve.solving.way import Walk, Way
from nlsolve.solving.work.ledger import Ledger

COARSE = Rings(spacing=0.5)
MARCH = TimeSteps(horizon=1e-4, increment=1e-4)
CONTINUED = Start(values=VALUES)
FORMS = {
    "strong": MovingLeastSquares(),
    "conservative": MovingLeastSquares(form="conservative"),
    "triangles": LinearTriangles(),
}


def case(**parts: Any) -> FlowCase:
    return setup(StirringTool(nodes=COARSE), 0.1324, **({"time": MARCH, "solver": Broyden()} | parts))


def begun(parts: FlowCase) -> tuple[np.ndarray, list[Solve], int]:
    """Velocity of the first state, the problems solved on the way, and the matrices factorised for them."""
    ledger, tasks = Ledger(), list[Solve]()
    simulation = FlowSimulation(parts, Ledger().entry)
    walk = Walk(parts.linear, ledger, Way(()), lambda shared: None)
    solves = simulation.solves()
    task = next(solves)
    while task.preparation is not None:
        outcome: Outcome = walk.outcome(task)
        tasks.append(task)
        if outcome.converged:
            simulation.keep(task, outcome.state)
        task = solves.send(outcome)
    return simulation.state.velocity, tasks, ledger.counts["factorization"]


def discretizers_of(tasks: list[Solve]) -> list[int]:
    """Strain points of each problem: other operators have others."""
    return [len(task.problem.operators.strain.points) for task in tasks if isinstance(task.problem, Flow)]


# The state is that of the continuation.


@pytest.mark.parametrize("physics", [Physics(), Physics(penalty=1e2), Physics(penalty=1e4)], ids=["0", "1e2", "1e4"])
@pytest.mark.parametrize("form", FORMS)
def test_the_state_is_that_of_the_continuation_by_fewer_matrices(form: str, physics: Physics) -> None:
    """All count here, the cheap ones of the triangles too."""
    parts = case(discretizer=FORMS[form], physics=physics)
    found, tasks, matrices = begun(parts)
    known, stages, many = begun(replace(parts, start=CONTINUED))
    np.testing.assert_allclose(found, known, atol=1e-7 * np.abs(known).max())
    assert len(stages) == len(VALUES) + 1
    assert len(tasks) == len(TOLERANCES) + 1
    assert matrices <= 0.65 * many
    by_triangles, again, target = discretizers_of(tasks)
    assert by_triangles == again
    assert (target == again) is (form == "triangles")


@pytest.mark.parametrize("index", [0.1324, 0.3])
def test_the_case_itself_factorises_one_matrix_or_two(index: float) -> None:
    """The triangles' tangent is new at each iteration, K* of the last solve is kept."""
    solves: list[int] = []

    class Watched(SuperLU):
        def factorize(self, matrix: Any, previous: Any = None) -> Any:
            solves.append(matrix.nnz)
            return super().factorize(matrix, previous)

    begun(case(linear=Watched(ordering="mmd-ata"), law=PowerLaw(index=index, regularization=1e-3)))
    assert 1 <= sum(entries == max(solves) for entries in solves) <= 2
    assert min(solves) < 0.6 * max(solves)


def test_a_yield_stress_is_reached_as_well() -> None:
    law = HerschelBulkley(index=0.3, yield_stress=40.0)
    found, tasks, _ = begun(case(law=law))
    known, _, _ = begun(case(law=law, start=CONTINUED))
    assert len(tasks) == len(TOLERANCES) + 1
    np.testing.assert_allclose(found, known, atol=1e-7 * np.abs(known).max())


def test_a_pressure_is_iterated_at_the_end_with_one_kept_tangent() -> None:
    physics = Physics(penalty=30.0, divergence_tolerance=1e-3)
    once, _, matrices = begun(case(physics=Physics(penalty=30.0)))
    found, tasks, more = begun(case(physics=physics))
    known, _, _ = begun(case(physics=physics, start=CONTINUED))
    assert len(tasks) > len(TOLERANCES) + 1
    assert more - matrices < len(tasks) - len(TOLERANCES) - 1
    assert not np.allclose(found, once, atol=1e-5 * np.abs(known).max())
    np.testing.assert_allclose(found, known, atol=1e-5 * np.abs(known).max())


def test_convection_leaves_no_potential_and_the_way_is_the_same() -> None:
    physics = Physics(penalty=1e2, convection=True, density=1e-6)
    found, tasks, _ = begun(case(physics=physics))
    known, _, _ = begun(case(physics=physics, start=CONTINUED))
    assert len(tasks) == len(TOLERANCES) + 1
    np.testing.assert_allclose(found, known, atol=1e-7 * np.abs(known).max())


@pytest.mark.parametrize("form", FORMS)
def test_many_nodes_begin_with_the_solution_on_fewer_of_them(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same state; on all nodes a few steps are left, and on the fewest the descent begins at rest."""
    parts = case(discretizer=FORMS[form], physics=Physics(penalty=1e2), law=PowerLaw(index=0.5))
    known, from_rest, _ = begun(parts)
    monkeypatch.setattr(descending, "MANY", 150)
    found, tasks, _ = begun(parts)
    np.testing.assert_allclose(found, known, atol=1e-7 * np.abs(known).max())
    unknowns = [len(task.start) for task in tasks]
    assert len(tasks) == len(from_rest) + len(TOLERANCES_ON_FEWER)
    assert unknowns == sorted(unknowns)
    first = next(task for task in tasks if len(task.start) == len(from_rest[0].start))
    assert isinstance(first.problem, Flow)
    guess = first.problem.velocity(first.start)
    assert np.linalg.norm(guess - known) < 0.5 * np.linalg.norm(known)  # 116 nodes are few


def test_where_fewer_nodes_carry_no_flow_all_of_them_begin_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(cloud: Cloud) -> None:
        raise SolveError(Status.BAD_CLOUD, "a node belongs to no triangle of the cloud")

    known, tasks, _ = begun(case())
    monkeypatch.setattr(descending, "MANY", 150)
    monkeypatch.setattr(descending, "thinned", refused)
    found, others, _ = begun(case())
    assert len(others) == len(tasks)
    np.testing.assert_array_equal(found, known)


# Where it is not taken.


@pytest.mark.parametrize(
    "parts",
    [
        {"start": CONTINUED},
        {"start": Start(values=(1.0,))},
        {"start": Start(adaptive=True)},
        {"start": Start(by="regularization", values=(10.0,))},
        {"start": Start(solver=Picard())},
        {"law": PowerLaw(index=1.0)},
        {"physics": Physics(penalty=1e2, penalty_unit="local")},
    ],
    ids=["usual values", "values", "adaptive", "by", "solver", "Newtonian", "local penalty"],
)
def test_a_way_that_is_said_or_that_decides_is_left_alone(parts: dict[str, Any]) -> None:
    given = case(**parts)
    assert not may_descend(given, given.start.stages(given.law))
    _, tasks, _ = begun(given)
    assert len(set(discretizers_of(tasks))) == 1


@pytest.mark.parametrize("start", [Start(), Start(tolerance=1e-6)], ids=["nothing", "tolerance"])
def test_a_way_that_is_left_open_is_taken(start: Start) -> None:
    parts = case(start=start)
    assert may_descend(parts, start.stages(parts.law))


@pytest.mark.parametrize("form", FORMS)
def test_the_method_of_a_steady_scene_begins_where_the_continuation_would_lead_it(form: str) -> None:
    """At n = 0.2, the stage before its own: its work and its result are the same, the way there is shorter."""
    parts = case(time=TimeSteps(), discretizer=FORMS[form])
    found, known = (run_case(replace(parts, start=start)).summary for start in (Start(), CONTINUED))
    assert found["start_factorizations"] <= 0.65 * known["start_factorizations"]
    for name in ("factorizations", "iterations", "residuals"):
        assert found[name] == known[name]
    assert found["velocity_error"] == pytest.approx(known["velocity_error"], rel=1e-6)


def test_a_steady_scene_that_is_one_stage_from_the_linear_one_is_continued() -> None:
    """n = 0.7, after n = 1."""
    parts = case(time=TimeSteps(), law=PowerLaw(index=0.7))
    found, known = (run_case(replace(parts, start=start)).summary for start in (Start(), CONTINUED))
    for name in ("start_factorizations", "factorizations", "iterations", "residual_norm", "velocity_error"):
        assert found[name] == known[name]


def test_a_pressure_is_iterated_by_the_method_of_a_steady_scene_alone() -> None:
    parts = case(time=TimeSteps(), solver=Newton(), physics=Physics(penalty=30.0, divergence_tolerance=1e-3))
    found, known = (run_case(replace(parts, start=start)).summary for start in (Start(), CONTINUED))
    assert found["pressure_iterations"] == known["pressure_iterations"] > 0
    assert found["velocity_error"] == pytest.approx(known["velocity_error"], rel=1e-6)


# Where it fails.


def record_of(parts: FlowCase) -> tuple[Record, Simulation]:
    seen: list[Simulation] = []
    return run_case(parts, watch=seen.append), seen[-1]


def assert_continued(parts: FlowCase, wasted: int) -> None:
    """The march goes on from the state of the continuation, after `wasted` factorisations."""
    (record, _), (known, _) = record_of(parts), record_of(replace(parts, start=CONTINUED))
    assert record.summary["status"] == "converged"
    np.testing.assert_array_equal(record.outcome.state, known.outcome.state)
    assert record.summary["start_factorizations"] == known.summary["start_factorizations"] + wasted


def test_too_few_iterations_for_it_lead_to_the_continuation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(descending, "MOST", 2)
    assert_continued(case(), wasted=2)


def test_a_state_that_the_case_does_not_reach_from_the_triangles_leads_to_the_continuation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Lost(Broyden):
        def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
            yield from ()

    monkeypatch.setattr(descending.METHOD, "validate_python", lambda table: Lost())
    parts = case()
    found = record_of(parts)[0].summary
    known = record_of(replace(parts, start=CONTINUED))[0].summary
    assert found["status"] == known["status"] == "converged"
    assert found["velocity_error"] == known["velocity_error"]
    assert found["start_factorizations"] > known["start_factorizations"]


def test_nodes_without_triangles_lead_to_the_continuation(monkeypatch: pytest.MonkeyPatch) -> None:
    class Refusing(LinearTriangles):
        def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
            raise SolveError(Status.BAD_CLOUD, "all nodes lie on one line")

    monkeypatch.setattr(descending, "linear_triangles", Refusing)
    assert_continued(case(), wasted=0)


def test_a_law_without_a_viscosity_at_rest_is_continued() -> None:
    """ε₀ = 0: the first residual of the triangles is not finite, and n = 1 has one."""
    assert_continued(case(law=PowerLaw(index=0.5, regularization=0.0)), wasted=0)


def test_what_fails_by_both_is_told_of_the_continuation() -> None:
    record = run_case(case(budget=Budget(iterations=3)))
    assert record.summary["status"] == "budget spent"
    assert "on the way to the first state, at index = " in record.summary["message"]
