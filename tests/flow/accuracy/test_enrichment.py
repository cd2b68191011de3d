"""Clouds with a node in the middle of every inner edge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy
from clouds import CLOUDS
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.flow.accuracy.enrichment import Finer, completed, inner_edges, interpolation, the_same, twice_as_fine
from nlsolve.flow.first_state.thinning import thinned
from nlsolve.plugin import Cloud
from nlsolve.series import Array

SCENES = [
    StirringTool(nodes=Rings(spacing=0.5)),
    StirringTool(nodes=GradedRings(first=0.05, growth=0.2, spacing=0.5)),
    Channel(nodes="scattered"),
]


def cloud_of(scene: Geometry) -> Cloud:
    return scene.cloud(PowerLaw(index=0.3))


@pytest.mark.parametrize("scene", SCENES, ids=["rings", "graded", "scattered"])
def test_new_nodes_lie_in_the_middle_of_edges_inside_and_on_walls(scene: Geometry) -> None:
    cloud = cloud_of(scene)
    finer = twice_as_fine(cloud).cloud
    old, inside = len(cloud.nodes), inner_edges(cloud)
    assert np.array_equal(finer.nodes[:old], cloud.nodes)
    assert np.array_equal(finer.nodes[old : old + len(inside)], cloud.nodes[inside].mean(axis=1))
    assert 3 * len(cloud.interior) < len(finer.interior) < 5 * len(cloud.interior)
    if isinstance(scene, StirringTool):
        radius = np.hypot(*finer.nodes[finer.interior].T)
        assert radius.min() > scene.tool_radius
        assert radius.max() < scene.plate_radius


def test_no_edge_crosses_a_hole_or_follows_a_wall() -> None:
    cloud = cloud_of(SCENES[0])
    edges = inner_edges(cloud)
    assert not cloud.on_boundary[edges].all(axis=1).any()
    lengths = np.linalg.norm(cloud.nodes[edges[:, 0]] - cloud.nodes[edges[:, 1]], axis=1)
    assert lengths.max() < 0.8, "the tool is 3 mm wide"
    assert len(np.unique(edges, axis=0)) == len(edges)


def linear(cloud: Cloud) -> Array:
    """Values (N, 2) at the nodes."""
    return cloud.nodes @ np.array([[1.0, 2.0], [-3.0, 0.5]]) + np.array([4.0, -1.0])


@pytest.mark.parametrize("finer_than", [twice_as_fine, lambda cloud: completed(twice_as_fine(cloud).cloud, cloud)])
def test_linear_values_are_carried_exactly(finer_than: Callable[[Cloud], Finer]) -> None:
    cloud = cloud_of(SCENES[2])
    finer = finer_than(cloud)
    assert finer.carry(linear(cloud)) == pytest.approx(linear(finer.cloud), rel=1e-12)
    assert np.array_equal(finer.carry(cloud.nodes)[: len(cloud.nodes)], cloud.nodes)


def test_a_cloud_without_further_nodes_is_the_same() -> None:
    cloud = cloud_of(SCENES[2])
    same = the_same(cloud)
    assert same.cloud is cloud
    assert np.array_equal(same.carry(cloud.nodes), cloud.nodes)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_linear_values_are_carried_exactly_from_fewer_nodes_and_beyond_them(cloud: Cloud) -> None:
    fewer = thinned(cloud)
    found = interpolation(fewer, cloud.nodes) @ linear(fewer)
    np.testing.assert_allclose(found, linear(cloud), atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_inside_the_values_are_those_of_scipys_linear_interpolation(seed: int) -> None:
    """On ragged nodes, where the triangle of a point may be far larger than those beside it."""
    random = np.random.default_rng(seed)
    here = Cloud(random.uniform(size=(60, 2)) ** random.uniform(1.0, 3.0), {})
    there = random.uniform(size=(200, 2))
    values = random.standard_normal((60, 2))
    known = scipy.interpolate.LinearNDInterpolator(here.nodes, values)(there)
    inside = ~np.isnan(known).any(axis=1)
    np.testing.assert_allclose((interpolation(here, there) @ values)[inside], known[inside], atol=1e-9)


def test_far_away_the_nearest_node_gives_its_values() -> None:
    here = Cloud(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), {})
    there = np.array([[7.0, -1.0], [0.5, 0.5], [-0.1, 0.2]])
    np.testing.assert_allclose(interpolation(here, there) @ np.array([1.0, 2.0, 3.0]), [2.0, 2.5, 1.3])
