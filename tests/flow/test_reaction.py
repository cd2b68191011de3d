"""Force and torque of the moving wall: by virtual power at its nodes, or through a contour where no wall is named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from cases import near, run, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, EccentricCylinders, StirringTool
from nlsolve_scenes.nodes.rings import Auto, GradedRings, Rings
from nlsolve_solvers import Newton

from nlsolve.contracts.continuum.law import CONTRACTION
from nlsolve.flow.momentum import Flow
from nlsolve.flow.observables import wall_reaction
from nlsolve.plugin import Discretizer, FlowScene, NodeMotion, Physics
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest

CONSERVATIVE = {
    "delaunay": LinearTriangles(),
    "mls": MovingLeastSquares(form="conservative"),
    "mls nodes": MovingLeastSquares(form="conservative", points="nodes"),
}
OMEGA = 100.0
FIXED = NodeMotion()


class Encircled(StirringTool):
    """The tool with a contour of any radius."""

    kind: Literal["encircled"] = "encircled"  # type: ignore[assignment]
    contour_radius: float = 3.0

    def contour(self, motion: NodeMotion) -> Array:
        angle = 2.0 * np.pi * np.arange(720) / 720
        return self.contour_radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class PlateMeasured(StirringTool):
    """The same tool, the reaction being that of the outer wall."""

    kind: Literal["plate-measured"] = "plate-measured"  # type: ignore[assignment]
    moving_wall: ClassVar = "plate"


class WithoutWall(Encircled):
    """A contour, and no boundary group inside it."""

    kind: Literal["without-wall"] = "without-wall"  # type: ignore[assignment]
    moving_wall: ClassVar = None


def spin(discretizer: Discretizer, index: float, penalty: float = 0.0, nodes: Any = None) -> tuple[Flow, Array]:
    """The steady spin solved to rounding on coarse rings, and its unknowns."""
    scene, law = StirringTool(nodes=nodes or Rings(spacing=0.5)), PowerLaw(index=index, regularization=1e-2)
    cloud = scene.cloud(law)
    walls = scene.boundary_velocity(cloud, law, 0.0)
    flow = Flow(cloud, discretizer.operators(cloud, penalty > 0.0), law, walls, penalty)
    outcome, _ = run(flow, Newton(), None, near(flow, min(1.0, 1.5 * index)), stop=StoppingTest(tolerance=1e-13))
    assert outcome.residual_norm <= 1e-13
    return flow, outcome.state


def reaction(flow: Flow, u: Array, discretizer: Discretizer, scene: FlowScene | None = None) -> dict[str, float]:
    return wall_reaction(scene or StirringTool(), FIXED, discretizer, flow, flow.velocity(u), 0.0)


def dissipation(flow: Flow, u: Array) -> float:
    """Σ A s : ε̇ + Σ A_θ λ (tr ε̇)² [N/s], the power that the flow turns into heat."""
    operators = flow.operators
    assert operators.strain.areas is not None
    strain_rate = operators.strain_rate(flow.velocity(u))
    power = np.sum(CONTRACTION[:, None] * operators.strain.areas * flow.stress_at_points(u) * strain_rate)
    dilatation, pressure = flow.dilatation_rate(u), flow.pressure(u)
    if dilatation is not None:
        assert operators.volumetric is not None
        power -= np.sum(operators.volumetric.areas * pressure * dilatation)
    return float(power)


# Conservative forms: virtual power.


@pytest.mark.parametrize("penalty", [0.0, 1e4])
@pytest.mark.parametrize("index", [1.0, 0.5])
@pytest.mark.parametrize("discretizer", CONSERVATIVE.values(), ids=CONSERVATIVE)
def test_torque_times_speed_is_the_dissipation(discretizer: Discretizer, index: float, penalty: float) -> None:
    """R(u) = 0 against the flow itself: what the tool puts in is what the material takes, to the last digits."""
    flow, u = spin(discretizer, index, penalty)
    assert reaction(flow, u, discretizer)["torque"] * OMEGA == pytest.approx(dissipation(flow, u), rel=1e-10)


@pytest.mark.parametrize("discretizer", CONSERVATIVE.values(), ids=CONSERVATIVE)
def test_the_reaction_is_that_of_the_wall_wherever_the_contour_is(discretizer: Discretizer) -> None:
    flow, u = spin(discretizer, 0.5, 1e3)
    found = [
        reaction(flow, u, discretizer, Encircled(contour_radius=radius)) for radius in (1.5001, 1.7, 3.0, 5.0, 5.9999)
    ]
    assert all(other == found[0] for other in found)


@pytest.mark.parametrize("discretizer", CONSERVATIVE.values(), ids=CONSERVATIVE)
def test_the_plate_holds_what_the_tool_puts_in(discretizer: Discretizer) -> None:
    """The reactions of both walls add up to no force and no torque."""
    flow, u = spin(discretizer, 0.5, 1e3)
    tool, plate = (reaction(flow, u, discretizer, scene) for scene in (StirringTool(), PlateMeasured()))
    for name in ("force_x", "force_y", "torque"):
        assert abs(tool[name] + plate[name]) < 1e-9 * tool["torque"]


def test_a_scene_that_names_no_wall_is_measured_through_its_contour() -> None:
    discretizer = CONSERVATIVE["mls"]
    flow, u = spin(discretizer, 0.5)
    torques = [
        reaction(flow, u, discretizer, WithoutWall(contour_radius=radius))["torque"] for radius in (2.5, 3.0, 4.0)
    ]
    assert len(set(torques)) == len(torques)
    np.testing.assert_allclose(torques, reaction(flow, u, discretizer)["torque"], rtol=0.05)


class TestTorqueOfTheSpin:
    """Conservative forms err by O(h²): halving the spacing takes about a quarter of the error."""

    @staticmethod
    def error(discretizer: Discretizer, index: float, spacing: float) -> float:
        flow, u = spin(discretizer, index, nodes=Rings(spacing=spacing))
        return reaction(flow, u, discretizer)["torque_error"]

    @pytest.mark.parametrize("index", [1.0, 0.5])
    def test_second_order_on_triangles(self, index: float) -> None:
        coarse, fine = (self.error(CONSERVATIVE["delaunay"], index, spacing) for spacing in (0.375, 0.1875))
        assert fine < 0.01
        assert 1.7 <= np.log2(coarse / fine) <= 2.3

    @pytest.mark.parametrize("name", CONSERVATIVE)
    def test_on_the_papers_nodes(self, name: str) -> None:
        assert self.error(CONSERVATIVE[name], 1.0, 0.25) < 0.021


def solved(scene: FlowScene, discretizer: Discretizer, physics: Physics) -> dict[str, Any]:
    stop = StoppingTest(tolerance=1e-10)
    row = march(setup(scene, 1.0, discretizer=discretizer, physics=physics, stop=stop)).summary
    assert row["status"] == "converged", row["message"]
    return row


# A contour: σ n through it.


def test_the_exact_field_of_the_spin_gives_the_exact_torque_through_any_contour() -> None:
    discretizer, law = MovingLeastSquares(), PowerLaw(index=0.5, regularization=1e-6)
    scene = StirringTool(nodes=GradedRings(first=0.05, growth=0.05))
    cloud = scene.cloud(law)
    exact = scene.exact(law, cloud.nodes, 0.0)
    assert exact is not None
    operators = discretizer.operators(cloud, True)
    plain = Flow(cloud, operators, law, exact.velocity[cloud.boundary])
    assert operators.volumetric is not None
    constant = np.full(len(operators.volumetric.points), 9.0)
    pressed = Flow(cloud, operators, law, exact.velocity[cloud.boundary], 1e-12, constant)
    for radius in (1.8, 3.0, 5.0):
        found = [
            wall_reaction(WithoutWall(contour_radius=radius), FIXED, discretizer, flow, exact.velocity, 0.0)
            for flow in (plain, pressed)
        ]
        assert found[0]["torque"] == pytest.approx(exact.quantities["torque"], rel=2e-3)
        for name in ("force_x", "force_y", "torque"):  # a constant pressure pushes a closed contour nowhere
            assert abs(found[1][name] - found[0][name]) < 1e-8 * 9.0 * radius


# Strong forms: the power of their stresses on the triangles beside the wall.

STRONG = {
    "mls": MovingLeastSquares(),
    "mls nodes": MovingLeastSquares(volume_points="nodes"),
    "rbf": RadialBasis(form="strong"),
}


@pytest.mark.parametrize("discretizer", STRONG.values(), ids=STRONG)
def test_a_strong_form_feels_its_wall_wherever_the_contour_is(discretizer: Discretizer) -> None:
    flow, u = spin(discretizer, 0.5, 1e3, nodes=Rings())
    at_wall = reaction(flow, u, discretizer)
    assert reaction(flow, u, discretizer, Encircled(contour_radius=2.0)) == at_wall
    through = [
        reaction(flow, u, discretizer, WithoutWall(contour_radius=radius))["torque"] for radius in (2.5, 3.0, 4.0, 5.0)
    ]
    np.testing.assert_allclose(through, at_wall["torque"], rtol=0.03)


def test_uniform_stress_and_pressure_push_no_wall() -> None:
    """A linear velocity has one stress everywhere: no force, and the torque of none but its own asymmetry, zero."""
    discretizer, law = MovingLeastSquares(), PowerLaw(index=1.0)
    cloud = StirringTool(nodes=Rings(spacing=0.5)).cloud(law)
    velocity = cloud.nodes @ np.array([[0.7, -0.3], [1.1, -0.7]]).T
    operators = discretizer.operators(cloud, True)
    assert operators.volumetric is not None
    constant = np.full(len(operators.volumetric.points), 9.0)
    for pressure in (None, constant):
        flow = Flow(cloud, operators, law, velocity[cloud.boundary], 1e-12, pressure)
        found = wall_reaction(StirringTool(), FIXED, discretizer, flow, velocity, 0.0)
        size = float(np.abs(flow.stress_at_points(flow.unknowns(velocity))).max())
        assert all(abs(found[name]) < 1e-8 * (size + 9.0) for name in ("force_x", "force_y", "torque"))


def test_the_torque_of_thin_layers_is_as_right_as_their_velocity() -> None:
    """Through the contour at 3 mm, where ε̄ has fallen far below ε₀, it is 12 % wrong on the same solution."""
    nodes = Auto(resolution=2.0, growth=0.3, spacing=0.5)
    scene, law = StirringTool(nodes=nodes), PowerLaw(index=0.05, regularization=1e-3)
    row = march(setup(scene, 0.05, discretizer=MovingLeastSquares(), law=law)).summary
    assert row["status"] == "converged", row["message"]
    assert row["torque_error"] < 0.01


# Where there is a pressure.


PENALTY, ITERATED = Physics(penalty=1e4), Physics(penalty=1e3, divergence_tolerance=1e-7)


@pytest.mark.parametrize(("name", "physics"), [("delaunay", PENALTY), ("delaunay", ITERATED), ("mls", PENALTY)])
def test_the_force_of_the_orbit_by_a_conservative_form_is_that_by_a_strong_one(name: str, physics: Physics) -> None:
    """The same scene by a conservative form and by a strong one."""
    scene = StirringTool(motion="orbit", nodes=Rings(spacing=0.25))
    by_power, through = (
        np.array([row["force_x"], row["force_y"]])
        for row in (solved(scene, form, physics) for form in (CONSERVATIVE[name], MovingLeastSquares()))
    )
    assert np.linalg.norm(by_power - through) < 0.02 * np.linalg.norm(through)


def test_both_ways_on_one_and_the_same_flow() -> None:
    """Operators that keep their areas to themselves, at the wall and through a contour."""
    discretizer, law = LinearTriangles(), PowerLaw(index=1.0)
    scene = StirringTool(motion="orbit", nodes=Rings(spacing=0.25))
    cloud = scene.cloud(law)
    operators = discretizer.operators(cloud, True)
    modulus = PENALTY.penalty_modulus(law, scene.reference_rate, lambda: np.ones(1))
    flow = Flow(cloud, operators, law, scene.boundary_velocity(cloud, law, 0.0), modulus)
    u = run(flow, Newton(), None, np.zeros(2 * len(cloud.interior)))[0].state
    without = replace(operators, strain=replace(operators.strain, areas=None))
    secret = Flow(cloud, without, law, scene.boundary_velocity(cloud, law, 0.0), modulus)
    power, contour = reaction(flow, u, discretizer, scene), reaction(secret, u, discretizer, scene)
    assert power["force_x"] == pytest.approx(contour["force_x"], rel=0.02)
    assert abs(power["force_y"] - contour["force_y"]) < 0.02 * abs(power["force_x"])


@pytest.mark.parametrize(
    ("discretizer", "physics"),
    [
        (LinearTriangles(), PENALTY),
        (LinearTriangles(), ITERATED),
        (MovingLeastSquares(), PENALTY),
        (MovingLeastSquares(), ITERATED),
        (CONSERVATIVE["mls"], PENALTY),
    ],
)
def test_torque_and_force_of_the_bearing(discretizer: Discretizer, physics: Physics) -> None:
    """2560 nodes, Jeffery's closed form: within one percent."""
    row = solved(EccentricCylinders(spacing=0.1), discretizer, physics)
    assert row["nodes"] == 2560
    assert row["torque_error"] <= 0.01
    assert row["force_error"] <= 0.01


def test_no_contour_no_reaction() -> None:
    flow, u = spin(LinearTriangles(), 1.0)
    assert reaction(flow, u, LinearTriangles(), Channel()) == {}
