"""R(v) = ρ (v − v_k)/Δt − S s(B v) − S_θ λ B_θ v − f : terms, Jacobian, expansion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases import near, run, setup, spin_flow
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_rules.refresh import EveryIteration
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton

from nlsolve import Status
from nlsolve.contracts.continuum.cloud import node_major
from nlsolve.contracts.continuum.law import stress
from nlsolve.flow.momentum import Flow, Inertia
from nlsolve.plugin import Physics, PointOperators
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import Budget
from nlsolve.testing import check_problem

SCENE = StirringTool(nodes=Rings(spacing=0.75))
CLOUD = SCENE.cloud(PowerLaw())
FORMS = {
    "between": MovingLeastSquares(),
    "nodes": MovingLeastSquares(points="nodes"),
    "volume at nodes": MovingLeastSquares(volume_points="nodes"),
    "cubic": MovingLeastSquares(degree=3, support=18, force_support=20),
}
OPERATORS = {name: form.operators(CLOUD, True) for name, form in FORMS.items()}
SPEED = StirringTool().exact(PowerLaw(index=0.5), CLOUD.nodes, 0.0)
assert SPEED is not None
TERMS: dict[str, dict[str, Any]] = {
    "quasi-static": {},
    "inertia": {"inertia": Inertia(2.81e-9 / 1e-9, 0.5 * SPEED.velocity)},
    "penalty": {"penalty_modulus": 50.0},
    "body force": {"body_force": np.tile([3.0, -2.0], (len(CLOUD.interior), 1))},
    "all": {
        "inertia": Inertia(2.81e-9 / 1e-9, 0.5 * SPEED.velocity),
        "penalty_modulus": 50.0,
        "body_force": np.tile([3.0, -2.0], (len(CLOUD.interior), 1)),
    },
}


def flow(form: str, index: float, **terms: Any) -> Flow:
    law = PowerLaw(index=index)
    return Flow(CLOUD, OPERATORS[form], law, SCENE.boundary_velocity(CLOUD, law, 0.0), **terms)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("index", [1.0, 0.5, 0.1324])
@pytest.mark.parametrize("terms", TERMS)
def test_jacobian_and_expansion_are_those_of_the_residual(form: str, index: float, terms: str) -> None:
    problem = flow(form, index, **TERMS[terms])
    check_problem(problem, near(problem, 0.5))


class Halved(Flow):
    """A Picard matrix: the viscosity's own derivative is left out."""

    def jacobian(self, u: Any) -> Any:
        newtonian = Flow(self.cloud, self.operators, PowerLaw(index=1.0), np.zeros((len(self.cloud.boundary), 2)))
        return newtonian.jacobian(u)


def test_the_check_of_problems_can_fail() -> None:
    law = PowerLaw(index=0.5)
    problem = Halved(CLOUD, OPERATORS["between"], law, SCENE.boundary_velocity(CLOUD, law, 0.0))
    with pytest.raises(AssertionError, match="Jacobian is off"):
        check_problem(problem, near(problem, 0.5))


@pytest.mark.parametrize("index", [1.0, 0.3])
def test_residual_is_the_sum_of_its_terms_written_out(index: float) -> None:
    problem, operators = flow("between", index, **TERMS["all"]), OPERATORS["between"]
    assert SPEED is not None
    u = near(problem, 0.5) * 1.1
    v = problem.velocity(u)
    free = node_major(CLOUD.interior)
    internal = operators.strain.force @ stress(PowerLaw(index=index), operators.strain_rate(v)).ravel()
    volumetric = 50.0 * (operators.volumetric.force @ (operators.volumetric.rate @ v.ravel()))
    inertia = 2.81 * (v - 0.5 * SPEED.velocity).ravel()[free]
    expected = inertia - internal - volumetric - np.tile([3.0, -2.0], len(CLOUD.interior))
    np.testing.assert_allclose(problem.residual(u), expected, rtol=0.0, atol=1e-11 * problem.scale(u))


def test_velocity_puts_the_boundary_back_and_unknowns_take_it_away() -> None:
    problem = flow("between", 1.0)
    u = near(problem, 0.5)
    v = problem.velocity(u)
    np.testing.assert_array_equal(v[CLOUD.boundary], SCENE.boundary_velocity(CLOUD, PowerLaw(), 0.0))
    np.testing.assert_array_equal(problem.unknowns(v), u)


def test_terms_left_out_are_absent_not_zero() -> None:
    """Without a penalty the volumetric operators are not touched, were they anything at all."""
    plain = MovingLeastSquares().operators(CLOUD, False)
    assert plain.volumetric is None
    law = PowerLaw()
    held = SCENE.boundary_velocity(CLOUD, law, 0.0)
    anything: Any = object()
    volumetric = replace(plain, volumetric=PointOperators(anything, anything, anything))
    problem = Flow(CLOUD, volumetric, law, held, penalty_modulus=0.0)
    u = near(problem, 0.5)
    assert problem.pressure(u) is None
    same = flow("between", law.index).residual(u)
    np.testing.assert_allclose(problem.residual(u), same, rtol=0.0, atol=1e-13 * problem.scale(u))
    penalised = flow("between", law.index, **TERMS["penalty"])
    assert np.linalg.norm(penalised.residual(u) - same) > 1e-6 * problem.scale(u)
    assert abs(penalised.jacobian(u) - problem.jacobian(u)).max() > 1.0


def test_a_penalty_presses_against_dilatation() -> None:
    """v = x inside: p = −λ tr ε̇ = −2 λ there, and the work of the term opposes the motion, −Σ v · S_θ λ B_θ v > 0."""
    zero = Flow(CLOUD, OPERATORS["between"], PowerLaw(index=1.0), np.zeros((len(CLOUD.boundary), 2)), 1e6)
    without = Flow(CLOUD, OPERATORS["between"], PowerLaw(index=1.0), np.zeros((len(CLOUD.boundary), 2)))
    u = CLOUD.nodes[CLOUD.interior].ravel()
    pressure = zero.pressure(u)
    assert pressure is not None
    assert np.median(pressure) == pytest.approx(-2e6, rel=1e-9)
    assert (zero.residual(u) - without.residual(u)) @ u > 0.0


def test_columns_of_the_rate_and_values_at_the_nodes_are_kept_for_what_they_were_made_for() -> None:
    strain, free = OPERATORS["between"].strain, node_major(CLOUD.interior)
    inside = strain.rate_of(free)
    assert strain.rate_of(free.copy()) is inside
    assert abs(inside - strain.rate[:, free]).max() == 0.0
    assert abs(strain.rate_of(free[:4]) - strain.rate[:, free[:4]]).max() == 0.0
    assert replace(strain, rate=2.0 * strain.rate).rate_of(free).sum() == pytest.approx(2.0 * inside.sum())
    problem, other = flow("between", 0.5), MovingLeastSquares(support=14)
    to_nodes = problem.to_nodes(FORMS["between"])
    assert problem.to_nodes(MovingLeastSquares()) is to_nodes
    assert abs(to_nodes - FORMS["between"].values(strain.points, CLOUD.nodes)).max() == 0.0
    assert abs(problem.to_nodes(other) - to_nodes).max() > 0.0


def test_a_linear_law_gives_a_linear_problem() -> None:
    problem = flow("between", 1.0)
    u = near(problem, 0.5)
    predicted = problem.residual(0.0 * u) + problem.jacobian(u) @ u
    np.testing.assert_allclose(problem.residual(u), predicted, rtol=0.0, atol=1e-12 * problem.scale(u))


def test_scale_bounds_what_cancels() -> None:
    problem = flow("between", 0.3, **TERMS["all"])
    u = near(problem, 0.5)
    assert problem.scale(u) >= np.linalg.norm(problem.residual(u))
    assert problem.scale(2.0 * u) > problem.scale(u)


def test_the_exact_channel_profile_leaves_a_residual_that_shrinks() -> None:
    """R of the exact velocities is the truncation error: the body force is balanced, more so on finer nodes."""
    left = []
    for spacing in (0.2, 0.1):
        scene, law = Channel(spacing=spacing, jitter=0.1), PowerLaw(index=0.5, regularization=0.0)
        cloud = scene.cloud(PowerLaw())
        exact = scene.exact(law, cloud.nodes, 0.0)
        force = scene.body_force(cloud.nodes[cloud.interior], law, Physics())
        assert exact is not None
        assert force is not None
        problem = Flow(
            cloud,
            MovingLeastSquares().operators(cloud, False),
            law,
            scene.boundary_velocity(cloud, law, 0.0),
            body_force=force,
        )
        left.append(np.linalg.norm(problem.residual(problem.unknowns(exact.velocity))) / np.linalg.norm(force))
    assert left[0] < 0.3
    assert left[1] < left[0]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # 0^(−0.25) is the point of the test
def test_a_law_without_a_viscosity_at_rest_ends_as_non_finite() -> None:
    """ε₀ = 0 and ε̄ = 0: μ is infinite, and 0 · ∞ is not a number."""
    problem = spin_flow(0.5, regularization=0.0)
    start = np.zeros(2 * len(problem.cloud.interior))
    outcome, ledger = run(problem, Newton(), EveryIteration(), start)
    assert outcome.status is Status.NON_FINITE
    assert "viscosity" in outcome.detail
    assert ledger.counts["factorization"] == 0


def test_a_law_without_a_viscosity_at_rest_warns_nobody() -> None:
    """The row says what happened; a warning of numpy's says it worse. Here warnings are errors."""
    problem = spin_flow(0.5, regularization=0.0)
    outcome, _ = run(problem, Newton(), EveryIteration(), np.zeros(2 * len(problem.cloud.interior)))
    assert outcome.status is Status.NON_FINITE


def test_the_blame_of_a_failed_flow_is_its_worst_node() -> None:
    """One node is pushed off a solution: the largest residual is there or beside it, and so is the largest rate."""
    problem = spin_flow(0.5, regularization=1e-2)
    u = near(problem, 1.0)
    place = 40
    u[2 * place] += 1e4
    blame = problem.blame(u, problem.residual(u))
    x, y = problem.cloud.nodes[problem.cloud.interior[place]]
    assert np.hypot(blame["blame_x"] - x, blame["blame_y"] - y) < 1.0
    assert blame["blame_rate"] > 1e3
    assert blame["blame_regularized"] == 0.0
    at_rest = problem.blame(np.zeros_like(u), problem.residual(np.zeros_like(u)))
    assert 0.0 < at_rest["blame_regularized"] < 1.0


def test_a_failed_case_says_where() -> None:
    row = march(setup(StirringTool(nodes=Rings(spacing=0.75)), 0.3, budget=Budget(iterations=1))).summary
    assert row["status"] == "budget spent"
    assert f"largest at ({row['blame_x']:.3g}, {row['blame_y']:.3g})" in row["message"]
    assert row["blame_rate"] > 0.0
