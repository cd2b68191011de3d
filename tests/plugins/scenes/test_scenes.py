"""Scenes: node sets, motion of the boundary, exact solutions, and scenes that make no sense."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from cases import setup
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings
from pydantic import ValidationError

from nlsolve import SolveError, Status
from nlsolve.contracts.continuum.law import stress
from nlsolve.flow.continuation import Start
from nlsolve.plugin import Cloud, ConstitutiveLaw, FlowScene, Misfit, NodeMotion, Physics, Recording, TimeSteps
from nlsolve.testing import check_scene

COARSE = Rings(spacing=0.5)


@pytest.mark.parametrize(
    "scene",
    [
        StirringTool(),
        StirringTool(motion="orbit"),
        StirringTool(nodes=GradedRings()),
        StirringTool(nodes=GradedRings(first=0.03, growth=0.15)),
        StirringTool(tool_radius=1.0, plate_radius=1.2, nodes=Rings(spacing=0.1)),
        Channel(),
        Channel(jitter=0.3, seed=4, length=3.0, half_height=0.5),
    ],
    ids=repr,
)
@pytest.mark.parametrize("index", [1.0, 0.1324])
def test_scenes_conform(scene: FlowScene, index: float) -> None:
    check_scene(scene, PowerLaw(index=index))


class Slipping(StirringTool):
    """A tool whose wall moves at another speed than its exact solution."""

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> np.ndarray:
        return 1.001 * super().boundary_velocity(cloud, law, time)


def test_the_check_of_scenes_can_fail() -> None:
    with pytest.raises(AssertionError, match="exact against prescribed"):
        check_scene(Slipping(nodes=COARSE), PowerLaw())


# Node sets.


def test_the_papers_node_set_has_1780_nodes() -> None:
    """Rings r = 1.5 + 0.25 i mm, i = 0 … 18, of floor(2πr/0.25) nodes."""
    cloud = StirringTool().cloud(PowerLaw())
    assert len(cloud.nodes) == 1780
    radii = np.unique(np.round(np.hypot(*cloud.nodes.T), 9))
    np.testing.assert_allclose(radii, 1.5 + 0.25 * np.arange(19))
    assert len(cloud.boundaries["tool"]) == 37
    assert len(cloud.boundaries["plate"]) == 150
    assert len(cloud.interior) == 1780 - 37 - 150


@pytest.mark.parametrize(
    ("nodes", "count"),
    [
        (GradedRings(first=0.1, growth=0.12), 2277),
        (GradedRings(first=0.05, growth=0.15), 2979),
        (GradedRings(first=0.03, growth=0.15), 4039),
    ],
)
def test_graded_rings_are_fine_at_the_tool_and_end_on_the_plate(nodes: GradedRings, count: int) -> None:
    cloud = StirringTool(nodes=nodes).cloud(PowerLaw())
    radii = np.unique(np.round(np.hypot(*cloud.nodes.T), 9))
    gaps = np.diff(radii)
    assert len(cloud.nodes) == count
    assert radii[0] == 1.5
    assert radii[-1] == pytest.approx(6.0, abs=1e-9)
    assert gaps[0] == pytest.approx(nodes.first, rel=0.05)
    assert (np.diff(gaps) > -1e-8).all()
    assert gaps.max() <= nodes.spacing + 1e-9
    # along a ring nodes are as far apart as across it
    assert 0.8 < 2 * np.pi * 1.5 / len(cloud.boundaries["tool"]) / nodes.first < 1.25


def test_channel_nodes_fill_the_rectangle_and_only_inner_ones_are_jittered() -> None:
    plain, shaken = Channel(spacing=0.2).cloud(PowerLaw()), Channel(spacing=0.2, jitter=0.3, seed=1).cloud(PowerLaw())
    np.testing.assert_array_equal(plain.nodes[plain.boundary], shaken.nodes[shaken.boundary])
    shift = np.abs(plain.nodes - shaken.nodes)[plain.interior]
    assert 0.0 < shift.max() <= 0.3 * 0.2
    np.testing.assert_array_equal(shaken.nodes, Channel(spacing=0.2, jitter=0.3, seed=1).cloud(PowerLaw()).nodes)
    assert not np.array_equal(shaken.nodes, Channel(spacing=0.2, jitter=0.3, seed=2).cloud(PowerLaw()).nodes)


# Motion of the boundary: ẋ = V.


@pytest.mark.parametrize("motion", ["spin", "orbit"])
@pytest.mark.parametrize("time", [0.0, 0.0123, 0.07])
def test_boundary_velocity_is_the_derivative_of_boundary_position(motion: str, time: float) -> None:
    scene = StirringTool(motion=motion, nodes=COARSE)
    law, initial, h = PowerLaw(), scene.cloud(PowerLaw()), 1e-7
    after, before = (scene.boundary_position(initial, time + sign * h) for sign in (1.0, -1.0))
    nodes = initial.nodes.copy()
    nodes[initial.boundary] = scene.boundary_position(initial, time)
    tool = initial.boundaries["tool"]
    moved = Cloud(nodes[initial.boundary], {"tool": tool, "plate": np.arange(len(tool), len(initial.boundary))})
    velocity = scene.boundary_velocity(moved, law, time)
    np.testing.assert_allclose((after - before) / (2 * h), velocity, atol=1e-6 * 150.0)


def test_a_spinning_tool_keeps_its_radius_and_an_orbiting_one_its_shape() -> None:
    time = 0.031
    spin, orbit = StirringTool(nodes=COARSE), StirringTool(motion="orbit", nodes=COARSE)
    cloud = spin.cloud(PowerLaw())
    tool = cloud.nodes[cloud.boundaries["tool"]]
    turned = spin.boundary_position(cloud, time)[: len(tool)]
    np.testing.assert_allclose(np.hypot(*turned.T), 1.5, rtol=1e-14)
    angle = np.arctan2(turned[0, 1], turned[0, 0]) - np.arctan2(tool[0, 1], tool[0, 0])
    assert angle % (2 * np.pi) == pytest.approx(100.0 * time % (2 * np.pi), abs=1e-12)
    shift = orbit.boundary_position(cloud, time)[: len(tool)] - tool
    np.testing.assert_allclose(shift, np.broadcast_to(shift[0], shift.shape), atol=1e-14)
    np.testing.assert_allclose(np.hypot(shift[0, 0], shift[0, 1] - 1.5), 1.5, rtol=1e-14)


# Exact solutions.


@pytest.mark.parametrize(
    ("index", "torque"), [(1.0, 165636.716), (0.5, 20476.612), (0.3, 8021.869), (0.1324, 3296.033), (0.05, 1980.767)]
)
def test_torque_of_the_exact_spin(index: float, torque: float) -> None:
    """Independent values, computed once from the closed form in another program [N mm/mm]."""
    exact = StirringTool().exact(PowerLaw(index=index), np.array([[1.5, 0.0]]), 0.0)
    assert exact is not None
    assert exact.quantities["torque"] == pytest.approx(torque, rel=1e-6)


def test_exact_spin_falls_off_as_it_should() -> None:
    """u_θ for n = 0.1324 at r = 1.5, 1.6, 1.75, 2.0, 2.5 mm."""
    radii = np.array([1.5, 1.6, 1.75, 2.0, 2.5])
    exact = StirringTool().exact(PowerLaw(index=0.1324), np.stack([radii, 0.0 * radii], axis=1), 0.0)
    assert exact is not None
    np.testing.assert_allclose(exact.velocity[:, 1], [150.0, 60.357, 17.051, 2.5926, 0.11137], rtol=1e-4)
    np.testing.assert_allclose(exact.velocity[:, 0], 0.0)


@pytest.mark.parametrize("index", [1.0, 0.5, 0.3, 0.1324, 0.05])
def test_shear_stress_of_the_exact_spin_times_radius_squared_is_constant(index: float) -> None:
    """τ = S_xy on the x axis with ε̇xy = (u_θ' − u_θ/r)/2 by differences; −2π r² τ is the tool's torque."""
    law, h = PowerLaw(index=index, regularization=0.0), 1e-5
    radii = np.linspace(1.55, 5.0, 12)

    def speed(r: np.ndarray) -> np.ndarray:
        exact = StirringTool().exact(law, np.stack([r, 0.0 * r], axis=1), 0.0)
        assert exact is not None
        return exact.velocity[:, 1]

    shear = 0.5 * ((speed(radii + h) - speed(radii - h)) / (2 * h) - speed(radii) / radii)
    moment = 2.0 * np.pi * radii**2 * stress(law, np.stack([0.0 * shear, 0.0 * shear, shear]))[2]
    exact = StirringTool().exact(law, np.array([[1.5, 0.0]]), 0.0)
    assert exact is not None
    np.testing.assert_allclose(-moment, exact.quantities["torque"], rtol=1e-5)


class NoSuchWall(StirringTool):
    kind: Literal["no-such-wall"] = "no-such-wall"  # type: ignore[assignment]
    moving_wall: ClassVar = "hammer"


def test_the_check_of_scenes_asks_for_the_group_of_the_moving_wall() -> None:
    with pytest.raises(AssertionError, match="the moving wall 'hammer' is none of the boundary groups"):
        check_scene(NoSuchWall(), PowerLaw())


class Newtonian(ConstitutiveLaw):
    """A law that does not call itself a power law."""

    kind: Literal["newtonian"] = "newtonian"

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 + 0.0 * rate_squared


def test_no_exact_solution_where_there_is_none() -> None:
    points = np.array([[2.0, 0.0]])
    assert StirringTool(motion="orbit").exact(PowerLaw(), points, 0.0) is None
    assert StirringTool().exact(Newtonian(), points, 0.0) is None
    assert Channel().exact(Newtonian(), points, 0.0) is None
    with pytest.raises(SolveError, match="is no power law, whose profile the channel prescribes"):
        Channel().body_force(points, Newtonian(), Physics())


def test_a_channel_refuses_a_law_that_is_no_power_law() -> None:
    with pytest.raises(Misfit, match=r"law\.kind: is no power law, .* or the scene couette, which takes any law"):
        Channel().check(setup(Channel(), law=Newtonian(), start=Start(by="load", values=())))
    Channel().check(setup(Channel()))


@pytest.mark.parametrize("index", [1.0, 0.5, 0.3, 0.1324])
def test_channel_profile_carries_the_mean_speed_and_balances_its_force(index: float) -> None:
    """Mean of u over the height; dτ/dy = −G with τ = S_xy, ε̇xy = u'/2."""
    scene, law = Channel(mean_speed=80.0, half_height=0.7), PowerLaw(index=index, regularization=0.0)
    y, weights = np.polynomial.legendre.leggauss(400)

    def speed(heights: np.ndarray) -> np.ndarray:
        exact = scene.exact(law, np.stack([0.0 * heights, heights], axis=1), 0.0)
        assert exact is not None
        return exact.velocity[:, 0]

    assert 0.5 * weights @ speed(0.7 * y) == pytest.approx(80.0, rel=1e-6)
    heights, h = np.linspace(-0.65, 0.65, 8), 1e-6
    shear = 0.5 * (speed(heights + h) - speed(heights - h)) / (2 * h)
    tau = stress(law, np.stack([0.0 * shear, 0.0 * shear, shear]))[2]
    force = scene.body_force(np.zeros((1, 2)), law, Physics())
    np.testing.assert_allclose(tau, -force[0, 0] * heights, rtol=1e-5)
    assert force[0, 1] == 0.0
    np.testing.assert_allclose(speed(np.array([-0.7, 0.7])), 0.0, atol=1e-12)


def test_penalty_is_measured_in_the_viscosity_at_the_reference_rate() -> None:
    law = PowerLaw(index=0.3)
    rate = StirringTool().reference_rate
    assert Physics(penalty=50.0).penalty_modulus(law, rate, lambda: np.zeros(1)) == pytest.approx(
        50.0 * law.viscosity(np.array([1e4]))[0]
    )
    rates = np.array([4.0, 9.0])
    local = Physics(penalty=50.0, penalty_unit="local").penalty_modulus(law, rate, lambda: rates)
    np.testing.assert_array_equal(local, 50.0 * law.viscosity(rates))
    assert Physics(penalty=50.0, penalty_unit="absolute").penalty_modulus(law, rate, lambda: rates) == 50.0
    assert Physics().penalty_modulus(law, rate, lambda: rates) == 0.0


def test_increments_of_a_march() -> None:
    assert TimeSteps().increments == 0
    assert TimeSteps(horizon=0.125).increments == 1250
    assert TimeSteps(horizon=1e-5).increments == 1


# Scenes that make no sense.

NONSENSE: list[tuple[type[Any], dict[str, Any], str]] = [
    (StirringTool, {"tool_radius": 6.0}, r"tool_radius = 6 mm must be smaller than plate_radius = 6 mm"),
    (StirringTool, {"tool_radius": 7.0, "plate_radius": 6.5}, "tool_radius = 7 mm must be smaller"),
    (StirringTool, {"tool_radius": -1.0}, "greater than 0"),
    (TimeSteps, {"increment": 0.0}, "greater than 0"),
    (TimeSteps, {"increment": -1e-4}, "greater than 0"),
    (TimeSteps, {"horizon": 0.0}, "greater than 0"),
    (Physics, {"penalty": -1.0}, "greater than or equal to 0"),
    (Physics, {"density": float("nan")}, "finite"),
    (StirringTool, {"angular_speed": float("inf")}, "finite"),
    (Recording, {"probe": (float("nan"), 0.0)}, "finite"),
    (StirringTool, {"motion": "wobble"}, "'spin' or 'orbit'"),
    (StirringTool, {"nodes": {"kind": "rings", "spacing": 0.0}}, "greater than 0"),
    (StirringTool, {"nodes": {"kind": "rings", "spacing": float("nan")}}, "finite"),
    (StirringTool, {"nodes": {"kind": "ring"}}, "'rings', 'graded-rings'"),
    (StirringTool, {"speed": 1.0}, "Extra inputs are not permitted"),
    (Channel, {"jitter": 0.5}, "less than 0.5"),
    (Channel, {"half_height": 0.0}, "greater than 0"),
    (Start, {"tolerance": 0.0}, "greater than 0"),
]


@pytest.mark.parametrize(("component", "fields", "sentence"), NONSENSE, ids=lambda value: str(value)[:40])
def test_nonsense_is_refused_with_its_field_and_a_sentence(
    component: type[Any], fields: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValidationError, match=sentence) as refusal:
        component(**fields)
    assert any(name in str(refusal.value) for name in fields)


def test_nodes_of_a_channel_stay() -> None:
    with pytest.raises(Misfit, match=r'motion\.nodes: material leaves the channel; use nodes = "fixed"'):
        Channel().check(setup(Channel(), motion=NodeMotion(nodes="lagrangian")))


def test_a_cloud_with_a_hole_in_its_numbers_is_a_bad_cloud() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, np.inf]])
    with pytest.raises(SolveError, match="node 2 has a coordinate that is not a finite number") as ending:
        Cloud(nodes, {})
    assert ending.value.status is Status.BAD_CLOUD


def test_coincident_nodes_are_named_by_their_place() -> None:
    nodes = StirringTool(nodes=COARSE).cloud(PowerLaw()).nodes.copy()
    nodes[100] = nodes[200]
    place = rf"coincide at \({nodes[100, 0]:.6g}, {nodes[100, 1]:.6g}\)"
    with pytest.raises(SolveError, match=place) as ending:
        Cloud(nodes, {})
    assert ending.value.status is Status.BAD_CLOUD
