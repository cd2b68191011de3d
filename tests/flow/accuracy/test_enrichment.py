"""Clouds with a node in the middle of every inner edge."""

from __future__ import annotations

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
from nlsolve.flow.accuracy.enrichment import carried, enriched, inner_edges
from nlsolve.flow.first_state.thinning import thinned
from nlsolve.plugin import Cloud

SCENES = [
    StirringTool(nodes=Rings(spacing=0.5)),
    StirringTool(nodes=GradedRings(first=0.05, growth=0.2, spacing=0.5)),
    Channel(nodes="scattered"),
]


def cloud_of(scene: Geometry) -> Cloud:
    return scene.cloud(PowerLaw(index=0.3))


@pytest.mark.parametrize("scene", SCENES, ids=["rings", "graded", "scattered"])
def test_new_nodes_lie_in_the_middle_of_edges_and_inside(scene: Geometry) -> None:
    cloud = cloud_of(scene)
    finer = enriched(cloud, inner_edges(cloud))
    old = len(cloud.nodes)
    assert np.array_equal(finer.cloud.nodes[:old], cloud.nodes)
    assert np.array_equal(finer.cloud.boundary, cloud.boundary)
    assert 3 * len(cloud.interior) < len(finer.cloud.interior) < 5 * len(cloud.interior)
    if isinstance(scene, StirringTool):
        radius = np.hypot(*finer.cloud.nodes[old:].T)
        assert radius.min() > scene.tool_radius
        assert radius.max() < scene.plate_radius


def test_no_edge_crosses_a_hole_or_follows_a_wall() -> None:
    cloud = cloud_of(SCENES[0])
    edges = inner_edges(cloud)
    assert not cloud.on_boundary[edges].all(axis=1).any()
    lengths = np.linalg.norm(cloud.nodes[edges[:, 0]] - cloud.nodes[edges[:, 1]], axis=1)
    assert lengths.max() < 0.8, "the tool is 3 mm wide"
    assert len(np.unique(edges, axis=0)) == len(edges)


def test_linear_values_are_carried_exactly() -> None:
    cloud = cloud_of(SCENES[2])
    finer = enriched(cloud, inner_edges(cloud))
    linear = cloud.nodes @ np.array([[1.0, 2.0], [-3.0, 0.5]]) + 4.0
    assert finer.carry(linear) == pytest.approx(finer.cloud.nodes @ np.array([[1.0, 2.0], [-3.0, 0.5]]) + 4.0)


def test_a_cloud_without_further_nodes_is_the_same() -> None:
    cloud = cloud_of(SCENES[2])
    same = enriched(cloud, np.empty((0, 2), dtype=int))
    assert same.cloud is cloud
    assert np.array_equal(same.carry(cloud.nodes), cloud.nodes)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_linear_values_are_carried_exactly_from_fewer_nodes_and_beyond_them(cloud: Cloud) -> None:
    fewer = thinned(cloud)
    slopes, constant = np.array([[1.0, 2.0], [-3.0, 0.5]]), np.array([4.0, -1.0])
    found = carried(fewer, cloud)(fewer.nodes @ slopes + constant)
    np.testing.assert_allclose(found, cloud.nodes @ slopes + constant, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_inside_the_values_are_those_of_scipys_linear_interpolation(seed: int) -> None:
    """On ragged nodes, where the triangle of a point may be far larger than those beside it."""
    random = np.random.default_rng(seed)
    here = Cloud(random.uniform(size=(60, 2)) ** random.uniform(1.0, 3.0), {})
    there = Cloud(random.uniform(size=(200, 2)), {})
    values = random.standard_normal((60, 2))
    known = scipy.interpolate.LinearNDInterpolator(here.nodes, values)(there.nodes)
    inside = ~np.isnan(known).any(axis=1)
    np.testing.assert_allclose(carried(here, there)(values)[inside], known[inside], atol=1e-9)


def test_far_away_the_nearest_node_gives_its_values() -> None:
    here = Cloud(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), {})
    there = Cloud(np.array([[7.0, -1.0], [0.5, 0.5], [-0.1, 0.2]]), {})
    np.testing.assert_allclose(carried(here, there)(np.array([1.0, 2.0, 3.0])), [2.0, 2.5, 1.3])
