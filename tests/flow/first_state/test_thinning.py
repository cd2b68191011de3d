"""A quarter of the nodes, no two of them neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import CLOUDS

from nlsolve.contracts.continuum.triangulation import edges_of
from nlsolve.flow.first_state.thinning import thinned
from nlsolve.plugin import Cloud


def kept(cloud: Cloud, fewer: Cloud) -> np.ndarray:
    """Which nodes of the cloud are kept, (N,)."""
    distance, _ = fewer.tree.query(cloud.nodes)
    return np.asarray(distance == 0.0)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_no_two_of_the_kept_nodes_are_neighbours_and_every_other_has_one(cloud: Cloud) -> None:
    fewer = thinned(cloud)
    keep, edges = kept(cloud, fewer), edges_of(cloud.triangulation)
    assert keep.sum() == len(fewer.nodes)
    assert not keep[edges].all(axis=1).any()
    assert set(edges[keep[edges].any(axis=1)].ravel()) == set(range(len(cloud.nodes)))
    assert 0.15 * len(cloud.nodes) < len(fewer.nodes) < 0.4 * len(cloud.nodes)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_walls_are_thinned_among_themselves_and_keep_their_names(cloud: Cloud) -> None:
    fewer = thinned(cloud)
    assert set(fewer.boundaries) == set(cloud.boundaries)
    for name, group in cloud.boundaries.items():
        places = {tuple(place) for place in cloud.nodes[group].tolist()}
        assert 0.2 * len(group) < len(fewer.boundaries[name]) <= 0.6 * len(group) + 1
        assert {tuple(place) for place in fewer.nodes[fewer.boundaries[name]].tolist()} <= places


def test_the_same_nodes_are_kept_each_time() -> None:
    cloud = CLOUDS["jittered"]
    np.testing.assert_array_equal(thinned(cloud).nodes, thinned(cloud).nodes)
