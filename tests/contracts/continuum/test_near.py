"""The nearest nodes of moving clouds are those of a tree, which is asked about few of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.near import AHEAD, Near, largest_near
from nlsolve.contracts.status import SolveError
from nlsolve.series import Array


def by_tree(nodes: Array) -> Array:
    """Distance of every node to its nearest neighbour."""
    distance: Array = scipy.spatial.cKDTree(nodes).query(nodes, 2)[0][:, 1]
    return distance


@pytest.mark.parametrize("count", [2, 5, 9, 10, 400])
@pytest.mark.parametrize("step", [1e-4, 0.02, 0.5])
def test_the_nearest_nodes_of_a_moving_cloud_are_those_of_a_tree(count: int, step: float) -> None:
    random = np.random.default_rng(count)
    cloud = Cloud(random.random((count, 2)), {})
    for _ in range(6):
        cloud = cloud.moved_to(cloud.nodes + step * random.standard_normal((count, 2)))
        np.testing.assert_allclose(cloud.nearest_distance, by_tree(cloud.nodes), rtol=1e-13)


def test_the_tree_is_asked_about_those_only_whose_lists_are_too_short(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    filled = Near._filled

    def counted(near: Near, which: Array, tree: scipy.spatial.cKDTree) -> Near:
        asked.append(len(which))
        return filled(near, which, tree)

    monkeypatch.setattr(Near, "_filled", counted)
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    cloud = Cloud(np.stack([x.ravel(), y.ravel()], axis=1), {})
    assert asked == []  # nothing is listed before a motion
    for _ in range(3):
        cloud = cloud.moved_to(cloud.nodes + np.array([0.01, 0.0]))
    assert asked == [400]
    moved = cloud.nodes.copy()
    moved[0] += np.array([5.3, 5.4])
    cloud = cloud.moved_to(moved)
    assert asked[1:] == [400]  # it may have come near any of them
    np.testing.assert_allclose(cloud.nearest_distance, by_tree(moved), rtol=1e-13)


def test_a_tree_that_is_built_serves_the_next_moves_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def trees(ahead: int) -> int:
        monkeypatch.setattr("nlsolve.contracts.continuum.near.AHEAD", ahead)
        built: list[scipy.spatial.cKDTree] = []

        def tree() -> scipy.spatial.cKDTree:
            built.append(scipy.spatial.cKDTree(nodes))
            return built[-1]

        nodes = np.random.default_rng(0).random((400, 2))
        near = Near.of(nodes, scipy.spatial.cKDTree(nodes))
        for _ in range(40):
            nodes = nodes + 1e-3 * np.stack([nodes[:, 1], np.zeros(400)], axis=1)  # a shear
            near = near.moved_to(nodes, tree)
            np.testing.assert_allclose(near.distance, by_tree(nodes), rtol=1e-13)
        return len(built)

    assert 3 * trees(AHEAD) < trees(0)


@pytest.mark.parametrize("within", [0.0, 0.05, 0.3, 2.0])
def test_the_largest_value_near_a_target_is_that_of_a_place_near_it(within: float) -> None:
    random = np.random.default_rng(3)
    places, values = random.random((300, 2)) * [1.0, 0.2], random.random(300)
    targets = random.random((90, 2)) * [1.2, 0.4] - 0.1
    bound = largest_near(places, values, targets, within)
    distance = np.linalg.norm(targets[:, None] - places, axis=2)
    near = np.where(distance <= within, values, 0.0).max(axis=1)
    side = max(within, 1.2 / 300**0.5)
    not_far = np.where(distance < 8.0**0.5 * side * (1.0 + 1e-9), values, 0.0).max(axis=1)
    assert (near <= bound).all()
    assert (bound <= not_far).all()
    assert largest_near(np.ones((1, 2)), np.ones(1), np.ones((1, 2)), 0.0) == 1.0


def test_a_single_node_has_no_nearest_one() -> None:
    cloud = Cloud(np.zeros((1, 2)), {})
    assert cloud.moved_to(np.ones((1, 2))).nearest_distance == np.array([np.inf])


def test_nodes_that_come_to_coincide_are_refused() -> None:
    cloud = Cloud(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), {})
    with pytest.raises(SolveError, match="two nodes coincide at"):
        cloud.moved_to(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.0]]))


def test_other_nodes_in_the_place_of_moved_ones_are_found_anew() -> None:
    moved = Cloud(np.eye(2), {}).moved_to(2.0 * np.eye(2))
    nodes = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    np.testing.assert_array_equal(replace(moved, nodes=nodes).nearest_distance, [3.0, 3.0, 4.0])
