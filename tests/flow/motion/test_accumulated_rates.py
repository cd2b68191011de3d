"""ε̇_{k+1} = ε̇_k + B (v_{k+1} − v_k): strain rates accumulated with the material, equation 20 of the 2015 paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import setup
from clouds import CLOUDS
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_rules.refresh import EveryIteration
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from numpy.testing import assert_allclose
from pydantic import ValidationError

from nlsolve.flow.continuation import Start
from nlsolve.flow.momentum import Flow
from nlsolve.flow.motion.point_rates import Passage, PointRates
from nlsolve.flow.observables import rate_drift
from nlsolve.plugin import Cloud, NodeMotion, Operators, Physics, TimeSteps
from nlsolve.solving.simulate import Record, run_case
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing import check_problem

GRID = CLOUDS["grid"]
COMPOSED = MovingLeastSquares(points="nodes", volume_points="nodes")
BETWEEN = MovingLeastSquares(volume_points="nodes")
SHEAR = np.array([[0.3, 2.0], [-0.5, -0.3]])  # ∇v, of no divergence


def passages(here: Operators, there: Operators, before: Cloud, after: Cloud, kept: bool) -> tuple[Passage, Passage]:
    assert here.volumetric is not None
    assert there.volumetric is not None
    return (
        Passage(here.strain, there.strain, before, after, BETWEEN, kept),
        Passage(here.volumetric, there.volumetric, before, after, BETWEEN, kept),
    )


def march(discretizer: MovingLeastSquares, skin: float, rates: str = "accumulated") -> Record:
    return run_case(
        setup(
            StirringTool(nodes=Rings(spacing=0.5)),
            0.5 if discretizer.points == "between" else 0.9,
            discretizer=discretizer,
            physics=Physics(penalty=10.0),
            time=TimeSteps(horizon=3e-4),
            motion=NodeMotion.model_validate({"nodes": "lagrangian", "skin": skin, "rates": rates}),
            stop=StoppingTest(tolerance=1e-10),
            solver=Newton(),
            refresh=EveryIteration(),
        )
    )


@pytest.mark.parametrize("discretizer", [COMPOSED, BETWEEN], ids=["at nodes", "between"])
def test_the_drift_of_a_linear_flow_is_what_its_gradient_loses_in_a_move(discretizer: MovingLeastSquares) -> None:
    """Nodes go to (I + Δt L) x, with their velocities L x: B v is then the symmetric part of L (I + Δt L)⁻¹."""
    dt, velocity = 0.01, GRID.nodes @ SHEAR.T
    moved = GRID.moved_to(GRID.nodes + dt * velocity)
    here, there = discretizer.operators(GRID, True), discretizer.operators(moved, True)
    rates = PointRates.of(here, velocity).at(*passages(here, there, GRID, moved, kept=False))
    drift = rates - PointRates.of(there, velocity)
    lost = SHEAR - SHEAR @ np.linalg.inv(np.eye(2) + dt * SHEAR)
    symmetric = 0.5 * (lost + lost.T)
    expected = [symmetric[0, 0], symmetric[1, 1], symmetric[0, 1]]
    assert_allclose(drift.strain, np.repeat(np.c_[expected], len(there.strain.points), axis=1), atol=1e-10)
    assert drift.dilatation is not None
    assert_allclose(drift.dilatation, np.trace(lost), atol=1e-10)
    assert np.abs(drift.strain).max() > dt * 0.1  # first order in Δt, where a finer cloud changes nothing


def test_points_at_nodes_and_kept_points_hold_their_values_and_others_are_interpolated() -> None:
    moved = GRID.moved_to(GRID.nodes + 0.01 * GRID.nodes @ SHEAR.T)
    random = np.random.default_rng(1)
    at_nodes, at_nodes_moved = COMPOSED.operators(GRID, True).strain, COMPOSED.operators(moved, True).strain
    values = random.normal(size=len(GRID.nodes))
    stay = Passage(at_nodes, at_nodes_moved, GRID, moved, COMPOSED, kept=False)
    assert stay.is_material
    assert stay(values) is values
    between, between_moved = BETWEEN.operators(GRID, True).strain, BETWEEN.operators(moved, True).strain
    anew = Passage(between, between_moved, GRID, moved, BETWEEN, kept=False)
    assert not anew.is_material
    assert replace(anew, kept=True).is_material
    quadratic = lambda x: 1.0 + x @ [2.0, -1.0] + (x**2) @ [0.5, 3.0]  # noqa: E731
    there = quadratic(between_moved.points @ np.linalg.inv(np.eye(2) + 0.01 * SHEAR).T)
    assert_allclose(anew(quadratic(between.points)), there, rtol=1e-9)


@pytest.mark.parametrize(("discretizer", "skin"), [(COMPOSED, 0.0), (BETWEEN, 1.0), (BETWEEN, 0.0)])
def test_the_first_increment_carries_what_the_first_state_had(discretizer: MovingLeastSquares, skin: float) -> None:
    accumulated, plain = march(discretizer, skin), march(discretizer, skin, rates="of-velocity")
    assert accumulated.summary["status"] == plain.summary["status"] == "converged"
    assert accumulated.summary["velocity_error"] != plain.summary["velocity_error"]
    assert "rate_drift" not in plain.summary
    drift = accumulated.steps.query("accepted")["rate_drift"].to_numpy(dtype=float)
    assert drift[-1] == accumulated.summary["rate_drift"]
    assert (np.diff(drift[-3:]) > 0.0).all()  # each increment loses more
    assert 1e-3 < drift[-1] < 0.5


def test_from_rest_the_first_increment_is_the_same_as_with_the_rates_of_the_velocity() -> None:
    case = setup(
        StirringTool(nodes=Rings(spacing=0.5)),
        0.5,
        discretizer=BETWEEN,
        physics=Physics(penalty=10.0),
        time=TimeSteps(horizon=1e-4),
        motion=NodeMotion(nodes="lagrangian", rates="accumulated"),
        stop=StoppingTest(tolerance=1e-10),
        solver=AsymptoticNumericalMethod(order=10),
    )
    case = replace(case, start=Start(at="rest"))
    plain = replace(case, motion=NodeMotion(nodes="lagrangian"))
    one, other = run_case(case).summary, run_case(plain).summary
    assert one["status"] == "converged"
    assert one["rate_drift"] == 0.0
    assert one["velocity_error"] == other["velocity_error"]
    assert one["tangents"] == other["tangents"]


def test_a_flow_with_drift_has_the_tangent_and_the_series_of_its_residual() -> None:
    operators = BETWEEN.operators(GRID, True)
    random = np.random.default_rng(5)
    strain, volumetric = operators.strain, operators.volumetric
    assert volumetric is not None
    drift = PointRates(random.normal(size=(3, len(strain.points))), random.normal(size=len(volumetric.points)))
    flow = Flow(
        GRID, operators, PowerLaw(index=0.4), np.zeros((len(GRID.boundary), 2)), penalty_modulus=50.0, drift=drift
    )
    u = random.normal(size=2 * len(GRID.interior))
    check_problem(flow, u)
    rest = np.zeros_like(u)
    assert_allclose(flow.strain_rate(rest), drift.strain)
    assert_allclose(flow.dilatation_rate(rest), drift.dilatation)
    assert rate_drift(flow, rest) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("motion", "sentence"),
    [
        ({"nodes": "fixed"}, 'at fixed nodes they are those of the velocity; use nodes = "lagrangian"'),
        ({"nodes": "lagrangian", "shifting": 0.1}, "shifted nodes are not material points; leave shifting out"),
    ],
)
def test_accumulated_rates_need_nodes_that_are_material(motion: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        NodeMotion.model_validate({**motion, "rates": "accumulated"})
