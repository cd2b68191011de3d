"""Nodes and markers: what is carried is where the velocity takes it, and clouds stay even or say so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from cases import setup
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from nlsolve import SolveError, Status
from nlsolve.flow.motion.markers import Markers, halfway, runge_kutta
from nlsolve.flow.motion.moving_nodes import LARGEST_SHIFT, MovingNodes, shifts
from nlsolve.plugin import Cloud, NodeMotion, Recording, TimeSteps
from nlsolve.show.figures import draw
from nlsolve.show.figures.nodes.cloud import CloudFigure
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest

OMEGA, TURN = 100.0, 0.02 * np.pi
DT = TURN / 628
MLS = MovingLeastSquares()


class Carousel(StirringTool):
    """Both walls turn with the tool: the material between them turns as a rigid body."""

    def boundary_position(self, cloud: Cloud, time: float) -> np.ndarray:
        return turned(cloud.nodes[cloud.boundary], OMEGA * time)


def turned(places: np.ndarray, angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return places @ np.array([[cosine, sine], [-sine, cosine]])


def rigid(places: np.ndarray) -> np.ndarray:
    return OMEGA * np.stack([-places[:, 1], places[:, 0]], axis=1)


def carousel() -> tuple[Carousel, Cloud]:
    scene = Carousel(nodes=Rings(spacing=0.75))
    return scene, scene.cloud(setup(scene).law)


def shifted(shifting: float) -> NodeMotion:
    return NodeMotion(nodes="lagrangian", shifting=shifting)


def jittered(cloud: Cloud, part: float) -> Cloud:
    nodes = cloud.nodes.copy()
    noise = np.random.default_rng(0).uniform(-part, part, nodes.shape)
    nodes[cloud.interior] += (noise * cloud.nearest_distance[:, None])[cloud.interior]
    return cloud.moved_to(nodes)


# Time.


@pytest.mark.parametrize("known", [1, 2, 3, 4])
def test_halfway_is_exact_for_polynomials_of_the_highest_possible_degree(known: int) -> None:
    times = 0.3 * np.arange(1, 1 - known, -1)
    for degree in range(known):
        assert halfway([np.full((5, 2), t**degree) for t in times]) == pytest.approx(0.15**degree, rel=1e-13)


def test_markers_are_of_fourth_order_in_an_unsteady_flow() -> None:
    """x' = cos t · (x², −2 x y): x(t) = x_0/(1 − x_0 sin t), y = y_0 (1 − x_0 sin t)²."""
    start = np.array([[0.4, 1.0], [-0.7, 0.5]])

    def at(speed: Any, places: np.ndarray) -> np.ndarray:
        x, y = places.T
        return speed * np.stack([x**2, -2.0 * x * y], axis=1)

    def error(steps: int) -> float:
        dt, places = 1.5 / steps, start
        for k in range(1, steps + 1):
            speeds: Any = [np.array(np.cos((k - back) * dt)) for back in range(4)]
            places = runge_kutta(places, speeds[1], halfway(speeds), speeds[0], dt, at)  # type: ignore[arg-type]
        growth = 1.0 - start[:, 0] * np.sin(1.5)
        return float(np.abs(places - np.stack([start[:, 0] / growth, start[:, 1] * growth**2], axis=1)).max())

    errors = np.array([error(steps) for steps in (20, 40, 80)])
    assert (np.log2(errors[:-1] / errors[1:]) > 3.8).all()


def test_a_rigid_turn_returns_every_marker_to_its_place() -> None:
    _, cloud = carousel()
    places = cloud.nodes
    for _ in range(628):
        places = runge_kutta(places, [], [], [], DT, lambda _, x: rigid(x))
    radius = np.linalg.norm(cloud.nodes, axis=1)
    assert (np.linalg.norm(places - cloud.nodes, axis=1) / radius).max() < 1e-8


def test_interpolation_in_space_keeps_a_rigid_turn_rigid() -> None:
    scene, cloud = carousel()
    velocity = rigid(cloud.nodes)
    markers = Markers(scene, DT, MLS, cloud, velocity)
    for k in range(1, 41):
        markers.advance(cloud, velocity, k * DT)
    exact = turned(cloud.nodes, OMEGA * 40 * DT)
    assert (np.linalg.norm(markers.places - exact, axis=1) / np.linalg.norm(exact, axis=1)).max() < 1e-10


def test_markers_at_shifted_nodes_turn_too() -> None:
    """Whatever is done to the nodes: known at other places each increment, a rigid turn carries markers rigidly."""
    scene, cloud = carousel()
    markers = Markers(scene, DT, MLS, cloud, rigid(cloud.nodes))
    for k in range(1, 41):
        other = jittered(cloud, 0.05 * (k % 3))
        markers.advance(other, rigid(other.nodes), k * DT)
    exact = turned(cloud.nodes, OMEGA * 40 * DT)
    assert (np.linalg.norm(markers.places - exact, axis=1) / np.linalg.norm(exact, axis=1)).max() < 1e-10


# Markers in a march.


@pytest.fixture(scope="module")
def marked() -> pd.DataFrame:
    time, motion = TimeSteps(horizon=0.03, increment=1e-3), NodeMotion(markers=True)
    return march(setup(StirringTool(nodes=Rings(spacing=0.5)), 1.0, time=time, motion=motion)).fields


def angles(x: pd.Series, y: pd.Series) -> np.ndarray:
    return np.arctan2(y.to_numpy(), x.to_numpy())


def test_markers_follow_the_computed_velocity(marked: pd.DataFrame) -> None:
    nodes, velocity = marked[["x", "y"]].to_numpy(), marked[["u", "v"]].to_numpy()
    inside = np.flatnonzero(marked["boundary"] == "")[::40]
    found = solve_ivp(
        lambda _, x: (MLS.values(nodes, x.reshape(-1, 2)) @ velocity).ravel(),
        (0.0, 0.03),
        nodes[inside].ravel(),
        rtol=1e-8,
        atol=1e-8,
        max_step=2e-4,
    )
    places = marked[["marker_x", "marker_y"]].to_numpy()[inside]
    assert np.abs(found.y[:, -1].reshape(-1, 2) - places).max() < 2e-5


def test_marker_angles_are_those_of_the_exact_spin(marked: pd.DataFrame) -> None:
    """θ(t) = θ_0 + t u_θ(r)/r, within the error of the velocity; the tool's markers turn by ωt exactly."""
    radius = np.hypot(marked["x0"], marked["y0"])
    rate = (marked["x0"] * marked["exact_v"] - marked["y0"] * marked["exact_u"]) / radius**2
    turn = np.exp(1j * (angles(marked["marker_x"], marked["marker_y"]) - angles(marked["x0"], marked["y0"])))
    error = np.abs(np.angle(turn * np.exp(-1j * 0.03 * rate.to_numpy())))
    assert 1.0 < 0.03 * rate[marked["boundary"] == ""].max() < 3.0
    assert error.max() < 0.02
    assert error[(marked["boundary"] != "").to_numpy()].max() < 1e-12
    assert np.abs(np.hypot(marked["marker_x"], marked["marker_y"]) - radius).max() < 0.005


def test_fields_without_markers_say_so() -> None:
    fields = march(setup(StirringTool(nodes=Rings(spacing=0.75)), 1.0)).fields
    assert fields[["marker_x", "marker_y"]].isna().all(axis=None)


def test_a_marker_that_leaves_the_cloud_is_lost() -> None:
    """u = 150 (1 − y²) mm/s for 0.02 s: 3 mm in the middle of a channel 2 mm long."""
    time, motion = TimeSteps(horizon=0.02, increment=1e-3), NodeMotion(markers=True)
    fields = march(setup(Channel(spacing=0.25), 1.0, time=time, motion=motion)).fields
    inner = fields[fields["boundary"] == ""]
    arrived = inner["x0"] + 0.02 * 150.0 * (1.0 - inner["y0"] ** 2)
    inside, outside = inner[arrived < 2.0], inner[arrived > 2.0 + 0.1]
    assert min(len(inside), len(outside)) >= 4
    np.testing.assert_allclose(inside["marker_x"], arrived[inside.index], rtol=1e-6)
    assert outside["marker_x"].isna().all()


def test_the_cloud_figure_draws_markers_in_place_of_nodes(marked: pd.DataFrame) -> None:
    fields = marked.assign(case="a")
    fields.loc[fields.index[200], ["marker_x", "marker_y"]] = np.nan
    frames = pd.DataFrame({"case": ["a"], "status": ["converged"]}), pd.DataFrame(), fields
    figure = draw(CloudFigure(name="mixing"), *frames)
    drawn = np.concatenate([np.asarray(line.get_xydata()) for line in figure.axes[0].lines])
    expected = fields[["marker_x", "marker_y"]].dropna().to_numpy()
    assert len(drawn) == len(expected) == len(fields) - 1
    np.testing.assert_array_equal(np.sort(drawn, axis=0), np.sort(expected, axis=0))


# Moving nodes.


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"markers": True, "nodes": "lagrangian"}, "nodes that move are the markers themselves"),
        ({"shifting": 0.1}, "shifting = 0.1: fixed nodes are not shifted"),
    ],
)
def test_motions_that_do_not_fit_together(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        NodeMotion(**fields)


def test_shifts_even_a_cloud_out() -> None:
    _, cloud = carousel()
    wanted, uneven = cloud.nearest_distance, jittered(cloud, 0.4)
    even = uneven
    for _ in range(30):
        shift = shifts(even, wanted, 0.1)
        assert (shift[cloud.boundary] == 0.0).all()
        assert (np.linalg.norm(shift, axis=1) <= LARGEST_SHIFT * wanted * (1.0 + 1e-12)).all()
        even = even.moved_to(even.nodes + shift)
    assert (uneven.nearest_distance / wanted).min() < 0.5
    assert (even.nearest_distance / wanted).min() > 0.75


def test_two_near_nodes_push_each_other_apart_equally() -> None:
    nodes = np.array([[0.0, 0.0], [0.4, 0.3], [10.0, 0.0], [0.0, 10.0]])
    shift = shifts(Cloud(nodes, {"wall": np.array([2, 3])}), np.ones(4), 0.1)
    np.testing.assert_allclose(shift[1], 0.1 * (1.0 - 0.5) * np.array([0.8, 0.6]), atol=1e-15)
    np.testing.assert_allclose(shift[0], -shift[1], atol=1e-15)


def test_velocities_come_along_to_shifted_nodes() -> None:
    """The matrix that carries them is exact for a rigid turn, and nearly nothing where hardly anything is shifted."""
    scene, even = carousel()
    cloud = jittered(even, 0.4)
    rest = np.zeros_like(cloud.nodes)
    moved, carry = MovingNodes(scene, shifted(0.3), DT, MLS, even).move(cloud, rest, None, 0.0)
    assert np.abs(moved.nodes - cloud.nodes).max() > 0.02
    np.testing.assert_allclose(rigid(cloud.nodes) + carry @ rigid(cloud.nodes), rigid(moved.nodes), atol=1e-9)
    _, carry = MovingNodes(scene, shifted(1e-9), DT, MLS, even).move(cloud, rest, None, 0.0)
    noise = np.random.default_rng(0).standard_normal(len(cloud.nodes))
    smoothed = MLS.values(cloud.nodes, cloud.nodes) @ noise - noise
    assert np.abs(carry @ noise).max() < 0.01 < 0.1 < np.abs(smoothed).max()  # supports that tie may change


def test_quality_is_the_worst_so_far_and_a_cloud_that_collapses_is_bad() -> None:
    scene, cloud = carousel()
    moving = MovingNodes(scene, NodeMotion(nodes="lagrangian"), DT, MLS, cloud)
    a = int(cloud.interior[50])
    gap = cloud.nodes - cloud.nodes[a]
    gap[a] = np.inf
    b = int(np.linalg.norm(gap, axis=1).argmin())
    velocity = np.zeros_like(cloud.nodes)
    velocity[a] = 0.5 * gap[b] / DT
    moved, carry = moving.move(cloud, velocity, None, 0.0)
    assert carry is None
    assert moving.quality == pytest.approx(0.5)
    back, _ = moving.move(moved, -velocity, None, 0.0)
    assert moving.quality == pytest.approx(0.5)
    with pytest.raises(
        SolveError, match=r"is 0\.04 times as far from its neighbour as at t = 0: raise motion\.shifting"
    ) as bad:
        moving.move(back, 1.92 * velocity, None, 0.0)
    assert bad.value.status is Status.BAD_CLOUD


def test_a_march_with_shifting_keeps_the_field_and_tells_the_quality() -> None:
    scene = StirringTool(nodes=Rings(spacing=0.5))
    record = march(setup(scene, 0.5, time=TimeSteps(horizon=2e-3), motion=shifted(0.2)))
    assert record.summary["status"] == "converged"
    assert record.summary["velocity_error_inside"] < 0.05
    assert 0.5 < record.summary["cloud_quality"] < 1.0
    assert record.summary["smallest_spacing"] == pytest.approx(0.5)
    inner = record.fields[record.fields["boundary"] == ""]
    radius = np.hypot(inner["x0"], inner["y0"])
    assert np.abs(np.hypot(inner["x"], inner["y"]) - radius).max() > 0.005  # the nodes have gone elsewhere
    assert np.abs(np.hypot(inner["marker_x"], inner["marker_y"]) - radius).max() < 0.001  # the material has not


def test_after_a_failed_increment_the_last_solved_state_is_measured_on_its_own_nodes() -> None:
    """The velocities brought along to shifted nodes only start the next solve."""
    steps = {"time": TimeSteps(horizon=4e-3, increment=2e-3), "motion": shifted(1.0), "record": Recording(times=(0.0,))}
    record = march(setup(StirringTool(nodes=Rings(spacing=0.5)), 1.0, stop=StoppingTest(tolerance=1e-30), **steps))
    assert record.summary["increments"] == 0
    assert record.summary["status"] != "converged"
    found, exact = (record.fields[names].to_numpy() for names in (["u", "v"], ["exact_u", "exact_v"]))
    error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
    assert record.summary["velocity_error"] == pytest.approx(error, rel=1e-12)
