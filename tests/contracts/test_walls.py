"""Further nodes of walls lie on the curve through the nodes that are there."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from clouds import CLOUDS
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Cavity, Couette, EccentricCylinders, StirringTool
from nlsolve_scenes.nodes.rings import Rings

from nlsolve.contracts.continuum.walls import cubic_weights, middles, wall_edges
from nlsolve.flow.accuracy.enrichment import inner_edges, twice_as_fine
from nlsolve.plugin import Cloud


def edges_of_walls(cloud: Cloud) -> np.ndarray:
    return wall_edges(cloud, scipy.spatial.Delaunay(cloud.nodes).simplices)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3), st.lists(st.floats(-5.0, 5.0), min_size=4, max_size=4))
def test_the_weights_reproduce_cubics(lengths: list[float], coefficients: list[float]) -> None:
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    middle = 0.5 * (at[1] + at[2])
    (weights,) = cubic_weights(np.array([lengths]))
    scale = 1.0 + np.abs(np.polyval(np.abs(coefficients), at)) @ np.abs(weights)
    assert weights @ np.polyval(coefficients, at) == pytest.approx(np.polyval(coefficients, middle), abs=1e-12 * scale)


def test_equal_chords_have_the_four_point_scheme() -> None:
    np.testing.assert_allclose(cubic_weights(np.ones((1, 3))), np.array([[-1.0, 9.0, 9.0, -1.0]]) / 16.0, rtol=1e-14)


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_they_come_near_a_circle_like_the_fourth_power_of_the_spacing(spread: float) -> None:
    def deviation(count: int) -> float:
        random = np.random.default_rng(1)
        angles = 2.0 * np.pi * (np.arange(count) + spread * random.uniform(-1.0, 1.0, count)) / count
        nodes = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        around = (np.arange(count)[:, None] + np.arange(-1, 3)) % count
        return float(np.abs(np.linalg.norm(middles(nodes, around), axis=1) - 1.0).max())

    assert deviation(80) < deviation(20) / 4.0**3.5


def test_a_corner_stays_a_corner() -> None:
    corner = np.array([[-1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [0.0, 2.0]])
    np.testing.assert_array_equal(middles(corner, np.array([[0, 1, 2, 3]])), [[0.0, 0.5]])


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_walls_are_followed_all_around(cloud: Cloud) -> None:
    edges = edges_of_walls(cloud)
    assert len(edges) == len(cloud.boundary)
    assert set(edges[:, 1:3].ravel()) == set(cloud.boundary)
    ends = {frozenset(edge) for edge in edges[:, 1:3]}
    for before, first, second, behind in edges:
        assert {frozenset((before, first)), frozenset((second, behind))} <= ends
        assert before != second
        assert behind != first


@pytest.mark.parametrize("scene", [StirringTool(nodes=Rings(spacing=0.25)), Couette(nodes=Rings(spacing=0.25))])
def test_round_walls_stay_round(scene: StirringTool) -> None:
    cloud = scene.cloud(PowerLaw())
    finer = twice_as_fine(cloud).cloud
    for name, group in cloud.boundaries.items():
        radii = np.hypot(*finer.nodes[finer.boundaries[name]].T)
        assert len(radii) == 2 * len(group)
        np.testing.assert_allclose(radii, np.hypot(*cloud.nodes[group[0]]), rtol=3e-5)


def test_straight_walls_stay_straight_and_corners_have_no_new_group() -> None:
    cloud = Cavity(spacing=0.1).cloud(PowerLaw())
    finer = twice_as_fine(cloud).cloud
    on_rim = (np.isclose(finer.nodes, 0.0) | np.isclose(finer.nodes, 1.0)).any(axis=1)
    np.testing.assert_array_equal(on_rim[finer.boundary], True)
    assert len(finer.boundary) > 1.8 * len(cloud.boundary)


def test_the_first_nodes_and_groups_are_kept_and_values_carried() -> None:
    cloud = EccentricCylinders(spacing=0.3).cloud(PowerLaw())
    fine = twice_as_fine(cloud)
    count = len(cloud.nodes)
    np.testing.assert_array_equal(fine.cloud.nodes[:count], cloud.nodes)
    for name, group in cloud.boundaries.items():
        np.testing.assert_array_equal(fine.cloud.boundaries[name][: len(group)], group)
    constant = np.full((count, 2), 3.0)
    np.testing.assert_array_equal(fine.carry(constant), np.full((len(fine.cloud.nodes), 2), 3.0))
    assert len(fine.cloud.nodes) - count > len(inner_edges(cloud))


def test_where_the_way_of_a_wall_is_not_known_it_gets_no_nodes() -> None:
    """All of a square's rim in one group: a triangle at its corner might as well lie outside."""
    lattice = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    rim = np.flatnonzero((lattice == 0.0).any(axis=1) | (lattice == 5.0).any(axis=1))
    cloud = Cloud(lattice, {"wall": rim})
    assert len(edges_of_walls(cloud)) in (0, len(rim))
    finer = twice_as_fine(cloud).cloud
    on_rim = (np.isclose(finer.nodes, 0.0) | np.isclose(finer.nodes, 5.0)).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(on_rim), np.sort(finer.boundary))
