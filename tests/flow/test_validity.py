"""Every audit where its answer is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from cases import setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve import SolveError, Status
from nlsolve.cli.printing import left_out
from nlsolve.flow.momentum import Flow
from nlsolve.flow.validity import HEAT_CAPACITY, LIMITS, audit
from nlsolve.plugin import Cloud, ConstitutiveLaw, FlowScene, NodeMotion, Physics, TimeSteps
from nlsolve.results.columns import RUNS
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest

COARSE = Rings(spacing=0.5)
NEWTONIAN = PowerLaw(index=1.0, regularization=0.0)
NODES = MovingLeastSquares(volume_points="nodes", volume_support=16)


def spin(**fields: Any) -> StirringTool:
    return StirringTool(**({"nodes": COARSE} | fields))


LAGRANGIAN = NodeMotion(nodes="lagrangian")


def summary(scene: FlowScene, index: float = 1.0, **parts: Any) -> dict[str, Any]:
    return march(setup(scene, index, **parts)).summary


def audit_of(velocity: Any, law: ConstitutiveLaw = NEWTONIAN, change: Any = None, **parts: Any) -> dict[str, Any]:
    """The audit of a velocity given as a function of the places."""
    case = setup(spin(), law=law, **parts)
    cloud = case.scene.cloud(law)
    given = velocity(cloud.nodes)
    flow = Flow(cloud, case.discretizer.operators(cloud, False), law, given[cloud.boundary])
    return audit(case, flow, given, change, 0.0)


def linear(*rows: tuple[float, float]) -> Any:
    return lambda nodes: nodes @ np.array(rows).T


def test_every_limit_and_every_finding_is_a_column() -> None:
    found = audit_of(linear((0, 1), (0, 0)))
    assert set(LIMITS) < set(found) <= set(RUNS)
    assert set(found) == {name for name in RUNS if name.startswith("audit.")} | {
        "velocity_error_estimate",
        "worst_error_estimate",
        "doubt",
    }


# Accelerations: the Newtonian spin u_θ = A r + B/r has τ = −2μB/r², ‖∇S‖ = 4 |τ|/r and ρ (V·∇) V = −ρ u_θ²/r e_r.


def expected_ratio(density: float) -> float:
    scene = spin()
    cloud = scene.cloud(NEWTONIAN)
    x, y = cloud.nodes[cloud.interior].T
    r = np.hypot(x, y)
    b = 100.0 / (1.5**-2 - 6.0**-2)
    viscosity = float(NEWTONIAN.viscosity(np.ones(1))[0])
    return float(density * np.linalg.norm((b / r - b * r / 36.0) ** 2 / r) / np.linalg.norm(8.0 * viscosity * b / r**3))


@pytest.mark.parametrize("density", [2.81e-9, 1.0])
def test_convection_of_the_spin(density: float) -> None:
    row = summary(spin(), physics=Physics(density=density))
    assert row["audit.convection"] == pytest.approx(expected_ratio(density), rel=0.1)
    assert ("convection = true" in row["doubt"]) == (density == 1.0)
    assert np.isnan(row["audit.inertia"])


@pytest.mark.parametrize("density", [2.81e-9, 1.0])
def test_inertia_on_moving_nodes_is_the_acceleration_of_the_material(density: float) -> None:
    row = summary(spin(), physics=Physics(density=density), time=TimeSteps(horizon=3e-4), motion=LAGRANGIAN)
    assert row["audit.inertia"] == pytest.approx(expected_ratio(density), rel=0.1)
    assert ("inertia = true" in row["doubt"]) == (density == 1.0)
    assert np.isnan(row["audit.convection"])


def test_inertia_on_fixed_nodes_of_a_steady_flow_is_none() -> None:
    row = summary(spin(), physics=Physics(density=1.0), time=TimeSteps(horizon=2e-4))
    assert row["audit.inertia"] == pytest.approx(0.0, abs=1e-6)


def test_a_term_that_is_kept_is_not_audited() -> None:
    physics = Physics(density=1.0, inertia=True, convection=True)
    row = summary(spin(), physics=physics, time=TimeSteps(horizon=2e-4))
    assert np.isnan(row["audit.inertia"])
    assert np.isnan(row["audit.convection"])
    assert "inertia" not in row["doubt"]


# Compressibility.


def test_an_expansion_is_compressible_and_a_shear_is_not() -> None:
    """V = a (x, y): div V = 2a and ε̄ = 2a/√3."""
    found = audit_of(linear((3, 0), (0, 3)))
    assert found["audit.compressibility"] == pytest.approx(np.sqrt(3.0))
    assert "raise the penalty" in found["doubt"]
    assert audit_of(linear((0, 1), (0, 0)))["audit.compressibility"] < 1e-12


@pytest.mark.parametrize(("penalty", "doubtful"), [(1.0, True), (100.0, True), (1000.0, False)])
def test_a_small_penalty_is_doubted(penalty: float, doubtful: bool) -> None:
    """The orbit squeezes the material: its velocity is wrong by about 18/penalty."""
    row = summary(spin(motion="orbit"), 0.5, physics=Physics(penalty=penalty), discretizer=NODES)
    assert row["audit.compressibility"] == row["divergence"]
    assert ("raise the penalty" in row["doubt"]) == doubtful


# Regularisation.


@pytest.mark.parametrize(("regularization", "share"), [(100.0, 1.0), (0.03, None), (1e-9, 0.0)])
def test_shares_of_the_regularised(regularization: float, share: float | None) -> None:
    row = summary(spin(), law=PowerLaw(index=0.3, regularization=regularization))
    if share is None:
        strain, stress, points = (row[f"audit.regularization{of}"] for of in ("_strain", "_stress", ""))
        assert 0.001 < strain < 0.02 < stress < points < 0.95
    else:
        assert {row[f"audit.regularization{of}"] for of in ("_strain", "_stress", "")} == {share}
    assert ("lower law.regularization" in row["doubt"]) == (share == 1.0)


def test_a_law_without_a_regularization_has_no_such_audit() -> None:
    class Water(ConstitutiveLaw):
        def viscosity(self, rate_squared: Any) -> Any:
            return 1.0 + 0.0 * rate_squared

    found = audit_of(linear((0, 1), (0, 0)), Water())
    assert all(np.isnan(found[f"audit.regularization{of}"]) for of in ("", "_stress", "_strain"))


# Resolution.


@pytest.mark.parametrize(
    ("nodes", "points", "index", "resolved"),
    [
        (Rings(spacing=0.5), "between", 0.5, True),  # 1.0 % off inside
        (Rings(), "between", 0.3, True),  # 0.9 %
        (GradedRings(first=0.05, growth=0.15), "between", 0.1324, True),  # 1.5 %
        (Rings(), "between", 0.1324, False),  # 13 %
        (Rings(spacing=0.5), "between", 0.1324, False),  # 65 %
        (Rings(spacing=0.5), "nodes", 1.0, False),  # 12 %
        (Rings(), "nodes", 0.3, False),  # 52 %, alternating from node to node
    ],
)
def test_resolution_tells_small_errors_from_large_ones(nodes: Any, points: Any, index: float, resolved: bool) -> None:
    row = summary(spin(nodes=nodes, plate_radius=3.5), index, discretizer=MovingLeastSquares(points=points))
    assert row["velocity_error_inside"] < 0.02 if resolved else row["velocity_error_inside"] > 0.09
    assert ("finer spacing" in row["doubt"]) != resolved
    assert row["audit.resolution"] < 0.25 or not resolved


def test_quadratic_velocities_are_resolved_and_alternating_ones_are_not() -> None:
    smooth = audit_of(lambda nodes: np.stack([nodes[:, 1] ** 2, nodes[:, 0] ** 2], axis=1))
    assert smooth["audit.resolution"] < 1e-10
    alternating = audit_of(lambda nodes: np.random.default_rng(0).choice([-1.0, 1.0], nodes.shape))
    assert alternating["audit.resolution"] > 0.8


# Heating.


def test_heating_of_a_shear_and_that_it_is_no_doubt() -> None:
    """V = (g y, 0): S:ε̇ = μ g², for a turn of the tool."""
    found = audit_of(linear((0, 200), (0, 0)), physics=Physics(density=2.81e-9))
    viscosity = float(NEWTONIAN.viscosity(np.ones(1))[0])
    expected = viscosity * 200.0**2 / (2.81e-9 * HEAT_CAPACITY) * 2.0 * np.pi / 100.0
    assert found["audit.heating"] == pytest.approx(expected)
    assert expected > LIMITS["audit.heating"].largest
    assert found["doubt"] == ""


def test_heating_of_a_march_is_over_its_time() -> None:
    steady, marched = summary(spin()), summary(spin(), time=TimeSteps(horizon=2e-4))
    assert marched["audit.heating"] == pytest.approx(steady["audit.heating"] * 2e-4 / (0.02 * np.pi), rel=1e-6)


# Telling.


class NoGradient(MovingLeastSquares):
    def gradient(self, cloud: Cloud) -> Any:
        raise SolveError(Status.BAD_CLOUD, "supports fail")


def test_an_audit_that_cannot_be_made_says_so() -> None:
    row = summary(spin(), discretizer=NoGradient())
    assert row["status"] == "converged"
    assert row["doubt"] == "the audits could not be made: supports fail"


def test_a_sound_scene_leaves_no_doubt() -> None:
    assert summary(Channel())["doubt"] == ""


def test_the_command_line_tells_the_worst_values_and_what_to_do() -> None:
    runs = pd.DataFrame(
        {name: [np.nan, np.nan] for name in LIMITS} | {"audit.resolution": [0.1, 2.0], "audit.inertia": [1e-6, np.nan]}
    )
    heading, inertia, resolution = left_out(runs)
    assert heading == "What the scenes left out, at its largest:"
    assert inertia.split() == ["inertia", "1e-06"]
    assert resolution.split("  in 1 case: ") == [
        "  resolution              2       ",
        LIMITS["audit.resolution"].sentence,
    ]
    assert left_out(runs.assign(**{name: np.nan for name in LIMITS})) == []


def test_the_command_line_tells_of_claims_only_where_they_do_not_hold() -> None:
    nothing = pd.DataFrame({name: [np.nan, np.nan] for name in LIMITS})
    assert left_out(nothing.assign(**{"audit.gained_power": 0.0, "audit.units": 0.5})) == []
    _, line = left_out(nothing.assign(**{"audit.gained_power": [0.0, 0.1]}))
    assert line.split("  in 1 case: ") == ["  gained power            0.1     ", LIMITS["audit.gained_power"].sentence]


def test_a_residual_small_only_beside_a_huge_penalty_is_in_doubt() -> None:
    """λ/μ = 1e8 makes 1e-8 of all forces 1e-3 of the stresses: the test is met before these are in balance."""
    graded = GradedRings(first=0.08, growth=0.15, spacing=0.4)
    loose, tight = (
        summary(spin(nodes=graded), 0.3, physics=Physics(penalty=penalty), stop=StoppingTest(tolerance=1e-8))
        for penalty in (1e8, 1e2)
    )
    assert loose["status"] == tight["status"] == "converged"
    assert loose["velocity_error_inside"] > 2.0 * tight["velocity_error_inside"]
    assert loose["audit.residual"] > LIMITS["audit.residual"].largest > 100 * tight["audit.residual"]
    assert "tighten stop.tolerance" in loose["doubt"]
    assert tight["doubt"] == ""


def test_a_smooth_field_that_is_wrong_on_a_ragged_cloud_is_out_of_balance() -> None:
    """Triangles on nodes jittered by 0.4 of their distance: 11 % wrong inside, yet velocities fit their gradients."""
    nodes = GradedRings(first=0.08, growth=0.15, spacing=0.4)
    ragged, even = (
        summary(spin(nodes=nodes.model_copy(update={"jitter": jitter})), 0.1324, discretizer=LinearTriangles())
        for jitter in (0.4, 0.0)
    )
    assert ragged["velocity_error_inside"] > 0.1 > 0.02 > even["velocity_error_inside"]
    assert ragged["audit.resolution"] < LIMITS["audit.resolution"].largest
    assert ragged["audit.balance"] > LIMITS["audit.balance"].largest > even["audit.balance"]
    assert "not in balance" in ragged["doubt"]
    assert even["doubt"] == ""
