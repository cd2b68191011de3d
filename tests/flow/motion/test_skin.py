"""Neighbours kept while nodes move: nothing is lost that consistency promises, and they are found anew in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import setup
from clouds import CLOUDS, jittered_points
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_discretizers.collocation import GRADIENT
from nlsolve_discretizers.weights.neighbours import Neighbours
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles
from nlsolve_rules.refresh import PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

from nlsolve.flow.motion.moving_nodes import MovingNodes, Neighbourhoods
from nlsolve.plugin import Cloud, Discretizer, NodeMotion, Operators, Physics, TimeSteps
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing import check_discretizer

FORMS: dict[str, Discretizer] = {
    "mls": MovingLeastSquares(),
    "mls, volume at nodes": MovingLeastSquares(volume_points="nodes"),
    "mls, all at nodes": MovingLeastSquares(points="nodes", volume_points="nodes"),
    "mls, conservative": MovingLeastSquares(form="conservative"),
    "mls, conservative, volume at nodes": MovingLeastSquares(form="conservative", volume_points="nodes"),
    "mls, by radius": MovingLeastSquares(radius=0.7),
    "rbf": RadialBasis(),
    "triangles": LinearTriangles(),
}
EACH_FORM = pytest.mark.parametrize("discretizer", FORMS.values(), ids=FORMS)
GRID = CLOUDS["grid"]


SCENE = StirringTool(nodes=Rings(spacing=0.75))


def lagrangian(skin: float, shifting: float = 0.0) -> NodeMotion:
    return NodeMotion(nodes="lagrangian", skin=skin, shifting=shifting)


def moving(skin: float, discretizer: Discretizer, cloud: Cloud) -> MovingNodes:
    return MovingNodes(SCENE, lagrangian(skin), TimeSteps().increment, discretizer, cloud)


def sheared(cloud: Cloud, shear: float, noise: float = 0.0) -> Cloud:
    """x + shear · y, and every node by a part of its spacing anywhere."""
    nodes = cloud.nodes + shear * cloud.nodes[:, ::-1] * [1.0, 0.0]
    random = np.random.default_rng(3).uniform(-noise, noise, nodes.shape)
    return cloud.moved_to(nodes + random * cloud.nearest_distance[:, None])


def inverted(cloud: Cloud) -> Cloud:
    """One node moved across the longest side of one of its triangles."""
    corners = Triangles.of(cloud).corners
    three = corners[(~cloud.on_boundary[corners]).all(axis=1)][0]
    places = cloud.nodes[three]
    opposite = np.linalg.norm(places[[1, 2, 0]] - places[[2, 0, 1]], axis=1).argmax()
    nodes = cloud.nodes.copy()
    nodes[three[opposite]] += 1.2 * (np.delete(places, opposite, axis=0).mean(axis=0) - places[opposite])
    return cloud.moved_to(nodes)


def same(one: Operators, other: Operators, tolerance: float) -> None:
    for pair, other_pair in ((one.strain, other.strain), (one.volumetric, other.volumetric)):
        assert pair is not None
        assert other_pair is not None
        for a, b in ((pair.rate, other_pair.rate), (pair.force, other_pair.force)):
            assert abs(a - b).max() <= tolerance * abs(a).max()


# How far near nodes have parted.


def test_a_rigid_motion_parts_nobody_and_a_shear_those_on_the_diagonal() -> None:
    square = Cloud(7.0 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), {})
    found, angle = Neighbourhoods(square), 1.1
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert found.parted(square.nodes @ turn + [3.0, -2.0]) == pytest.approx(0.0, abs=1e-14)
    assert found.parted(sheared(square, 0.3).nodes) == pytest.approx(np.hypot(1.3, 1.0) - np.hypot(1.0, 1.0))
    assert found.parted(1.2 * square.nodes) == pytest.approx(0.2 * np.sqrt(2.0))


def test_fixed_nodes_have_no_skin() -> None:
    with pytest.raises(ValidationError, match=r"skin = 0\.3: the neighbours of fixed nodes never change"):
        NodeMotion(skin=0.3)


# Kept neighbours.


@EACH_FORM
def test_where_nothing_moved_nothing_changes(discretizer: Discretizer) -> None:
    cloud = CLOUDS["jittered"]
    operators = discretizer.operators(cloud, True)
    kept = discretizer.moved(operators, cloud)
    assert kept is not None
    same(operators, kept, 1e-13)


@EACH_FORM
def test_on_a_moved_cloud_kept_neighbours_conform(discretizer: Discretizer) -> None:
    """Linear velocities, constant stress, adjoint forms: all that neighbours found anew would give."""
    before = CLOUDS["jittered"]

    class Kept(type(discretizer)):  # type: ignore[misc]
        def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
            if len(cloud.nodes) != len(before.nodes):  # the check tries a cloud of too few nodes as well
                return discretizer.operators(cloud, volumetric)
            found = discretizer.operators(before, volumetric)
            first = discretizer.moved(found, sheared(before, 0.1))
            assert first is not None
            second = discretizer.moved(first, cloud)
            assert second is not None
            return second

    check_discretizer(Kept(**discretizer.model_dump()), sheared(before, 0.25, 0.05))


def test_radii_follow_the_farthest_neighbour() -> None:
    """Where all is stretched alike, kept supports are those that would be found anew."""
    sources, targets = jittered_points(5), 0.2 + 0.6 * np.random.default_rng(1).random((30, 2))
    for balanced in (False, True):
        moved = Supports.nearest(sources, targets, 9, balanced).moved(1.3 * sources, 1.3 * targets)
        anew = Supports.nearest(1.3 * sources, 1.3 * targets, 9, balanced)
        np.testing.assert_array_equal(moved.index, anew.index)
        np.testing.assert_allclose(moved.radius, anew.radius, rtol=1e-13)
        np.testing.assert_allclose(moved.farthest, anew.farthest, rtol=1e-13)


def test_a_kept_support_that_has_become_weak_is_enlarged() -> None:
    """Neighbours that have come to lie on one line determine no gradient."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    sources = np.stack([x.ravel(), y.ravel()], axis=1)
    target = np.array([[4.2, 4.0]])
    line = Supports(np.flatnonzero(sources[:, 1] == 4.0)[None], np.array([9]), np.array([5.0]), np.array([4.2]))
    near = Neighbours(Triangles.of(Cloud(sources, {})), {"strain": line})
    supports, (dx, dy) = MovingLeastSquares().weights(sources, target, "strain", GRADIENT, near=near)
    assert supports.count[0] > 9
    linear = sources @ [2.0, -3.0]
    np.testing.assert_allclose([dx @ linear[supports.index[0]], dy @ linear[supports.index[0]]], [[2.0], [-3.0]])


@EACH_FORM
def test_patches_and_stress_points_stay_with_their_nodes(discretizer: Discretizer) -> None:
    """What makes a kept tangent serve longer: row i of B_θ is the same piece of material before and after."""
    before = discretizer.operators(CLOUDS["jittered"], True)
    after = discretizer.moved(before, sheared(CLOUDS["jittered"], 0.2))
    assert after is not None
    for one, moved in ((before.strain, after.strain), (before.volumetric, after.volumetric)):
        assert one is not None
        assert moved is not None
        np.testing.assert_allclose(moved.points, one.points + 0.2 * one.points[:, ::-1] * [1.0, 0.0], atol=1e-12)


# Found anew.


@EACH_FORM
def test_without_a_skin_neighbours_are_found_each_time(discretizer: Discretizer) -> None:
    nodes = moving(0.0, discretizer, GRID)
    for k, cloud in enumerate([GRID, sheared(GRID, 0.01), sheared(GRID, 0.02)], start=1):
        same(discretizer.operators(cloud, True), nodes.operators(cloud, True), 0.0)
        assert nodes.searches == k


@EACH_FORM
def test_neighbours_are_found_anew_once_some_have_parted_by_more_than_the_skin(discretizer: Discretizer) -> None:
    nodes = moving(0.3, discretizer, GRID)
    first, last = sheared(GRID, 0.1), sheared(GRID, 0.4)
    assert Neighbourhoods(GRID).parted(first.nodes) < 0.3 < Neighbourhoods(GRID).parted(last.nodes)
    assert Neighbourhoods(last).parted(sheared(GRID, 0.3).nodes) < 0.3
    searches = []
    for cloud in (GRID, first, last, sheared(GRID, 0.3), GRID):
        operators = nodes.operators(cloud, True)
        searches.append(nodes.searches)
        if cloud is last:
            same(discretizer.operators(last, True), operators, 0.0)
    assert searches == [1, 1, 2, 2, 3]


@EACH_FORM
def test_a_triangle_turned_inside_out_has_them_found_anew(discretizer: Discretizer) -> None:
    turned = inverted(GRID)
    assert Neighbourhoods(GRID).parted(turned.nodes) < 1.0
    assert discretizer.moved(discretizer.operators(GRID, True), turned) is None
    nodes = moving(1.0, discretizer, GRID)
    nodes.operators(GRID, True)
    same(discretizer.operators(turned, True), nodes.operators(turned, True), 0.0)
    assert nodes.searches == 2


class Stranger(MovingLeastSquares):
    """Knows nothing of kept neighbours."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        return replace(super().operators(cloud, volumetric), neighbours=None)

    moved = Discretizer.moved


def test_a_discretizer_that_keeps_nothing_works_with_any_skin() -> None:
    nodes = moving(1.0, Stranger(), GRID)
    for k in range(1, 4):
        nodes.operators(GRID, True)
        assert nodes.searches == k
    assert Stranger().moved(Stranger().operators(GRID, True), GRID) is None


# The march.


class Counted(MovingLeastSquares):
    """Counts the searches."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        SEARCHES.append(len(cloud.nodes))
        return super().operators(cloud, volumetric)


SEARCHES: list[int] = []


@pytest.mark.parametrize(("volume_points", "shifting"), [("nodes", 0.0), ("pairs", 0.2)])
def test_a_spin_with_a_skin_ends_in_the_field_of_one_without(volume_points: str, shifting: float) -> None:
    """The tool turns by 0.6 rad in 15 increments, its first neighbours by far less."""
    errors, searches = [], []
    parts = {
        "physics": Physics(penalty=10.0),
        "time": TimeSteps(horizon=6e-3, increment=4e-4),
        "discretizer": Counted(volume_points=volume_points),
        "solver": ModifiedNewton(),
        "refresh": PoorContraction(),
        "stop": StoppingTest(),
    }
    for skin in (0.0, 0.3):
        SEARCHES.clear()
        record = march(setup(SCENE, 0.5, motion=lagrangian(skin, shifting), **parts))
        assert record.summary["status"] == "converged"
        errors.append(record.summary["velocity_error"])
        searches.append(len(SEARCHES))
    assert searches[0] == 16
    assert 3 <= searches[1] <= 6
    assert errors[1] == pytest.approx(errors[0], rel=0.05)
