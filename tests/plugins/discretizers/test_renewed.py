"""Operators of a moved cloud: what was known before the motion saves time and changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from clouds import CLOUDS, jittered_points
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_discretizers.kernels.offsets import over_radius, scaled
from nlsolve_discretizers.weights import least_squares
from nlsolve_discretizers.weights.least_squares import SOUND, fit
from nlsolve_discretizers.weights.lists import Lists
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles

from nlsolve.plugin import Cloud, Discretizer, Operators, SolveError
from nlsolve.series import Array

FORMS: dict[str, Discretizer] = {
    "mls": MovingLeastSquares(),
    "mls, volume at nodes": MovingLeastSquares(volume_points="nodes"),
    "mls, all at nodes": MovingLeastSquares(points="nodes", volume_points="nodes"),
    "mls, conservative": MovingLeastSquares(form="conservative"),
    "mls, by radius": MovingLeastSquares(radius=0.7),
    "rbf": RadialBasis(form="strong"),
    "triangles": LinearTriangles(),
}


def stirred(cloud: Cloud, step: float, seed: int) -> Cloud:
    """Every inner node moved by a part of its spacing, anywhere."""
    shift = step * np.random.default_rng(seed).uniform(-1.0, 1.0, cloud.nodes.shape) * cloud.nearest_distance[:, None]
    shift[cloud.boundary] = 0.0
    return cloud.moved_to(cloud.nodes + shift)


def difference(one: Operators, other: Operators) -> float:
    """Largest difference of two entries, exact also in their pattern."""
    largest = 0.0
    for pair, other_pair in ((one.strain, other.strain), (one.volumetric, other.volumetric)):
        assert pair is not None
        assert other_pair is not None
        np.testing.assert_array_equal(pair.points, other_pair.points)
        for a, b in ((pair.rate, other_pair.rate), (pair.force, other_pair.force)):
            np.testing.assert_array_equal(a.indices, b.indices)
            largest = max(largest, float(abs(a - b).max()))
    return largest


# Operators.


@pytest.mark.parametrize("discretizer", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("name", ["rings", "jittered"])
def test_renewed_operators_are_those_of_the_cloud_to_the_last_digit(discretizer: Discretizer, name: str) -> None:
    """Steps of a tenth of the spacing change edges, supports and points, over and over."""
    cloud = CLOUDS[name]
    operators = discretizer.operators(cloud, True)
    for seed in range(5):
        cloud = stirred(cloud, 0.1, seed)
        operators = discretizer.renewed(operators, cloud)
        assert difference(discretizer.operators(cloud, True), operators) == 0.0


def test_renewed_after_kept_neighbours_are_those_of_the_cloud() -> None:
    discretizer, cloud = MovingLeastSquares(), CLOUDS["jittered"]
    operators = discretizer.renewed(discretizer.operators(cloud, True), stirred(cloud, 0.02, 1))
    kept = discretizer.moved(operators, stirred(cloud, 0.05, 2))
    assert kept is not None
    last = stirred(cloud, 0.1, 3)
    assert difference(discretizer.operators(last, True), discretizer.renewed(kept, last)) == 0.0


def test_a_class_that_overrides_operators_alone_builds_them_anew() -> None:
    class Plain(LinearTriangles):
        def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
            return replace(super().operators(cloud, volumetric), node_areas=np.ones(len(cloud.interior)))

    class Further(Plain):
        pass

    for discretizer in (Plain(), Further()):
        operators = discretizer.operators(CLOUDS["jittered"], True)
        renewed = discretizer.renewed(operators, stirred(CLOUDS["jittered"], 0.1, 0))
        assert (renewed.node_areas == 1.0).all()


def test_renewed_operators_are_refused_where_those_of_the_cloud_are() -> None:
    """All nodes on one line."""
    discretizer, cloud = MovingLeastSquares(), CLOUDS["jittered"]
    operators = discretizer.operators(cloud, True)
    line = cloud.moved_to(np.stack([np.arange(float(len(cloud.nodes))), np.zeros(len(cloud.nodes))], axis=1))
    with pytest.raises(SolveError, match="on one line"):
        discretizer.renewed(operators, line)


# Triangles.


def test_triangles_bear_no_trace_of_how_they_were_found() -> None:
    cloud = stirred(CLOUDS["rings"], 0.2, 1)
    renewed, found = Triangles.of(CLOUDS["rings"]).renewed(cloud), Triangles.of(cloud)
    np.testing.assert_array_equal(renewed.corners, found.corners)
    assert (np.diff(found.corners[:, 0]) >= 0).all()
    assert (found.corners[:, 1:] > found.corners[:, :1]).all()


# Lists.


def test_lists_hold_the_nearest_of_moving_appearing_and_vanishing_sources() -> None:
    random = np.random.default_rng(4)
    sources, targets = random.random((200, 2)), random.random((150, 2))
    lists = Lists.of(sources, targets, 9, 6)
    for _ in range(12):
        kept, aims = np.flatnonzero(random.random(200) > 0.05), np.flatnonzero(random.random(150) > 0.05)
        numbers = np.concatenate([kept, np.full(200 - len(kept), -1)])
        aim_numbers = np.concatenate([np.full(150 - len(aims), -1), aims])
        new_sources, new_targets = random.random((200, 2)), random.random((150, 2))
        new_sources[: len(kept)] = sources[kept] + random.normal(0.0, 0.004, (len(kept), 2))
        new_targets[150 - len(aims) :] = targets[aims] + random.normal(0.0, 0.004, (len(aims), 2))
        sources, targets = new_sources, new_targets
        lists = lists.moved(sources, targets, numbers, aim_numbers)
        index, farthest, beyond = lists.nearest()
        anew = Lists.of(sources, targets, 9)
        np.testing.assert_array_equal(index, anew.index[:, :9])
        np.testing.assert_array_equal(farthest, anew.farthest)
        np.testing.assert_array_equal(beyond, anew.beyond)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many targets the tree was asked about, each time."""
    numbers: list[int] = []
    query = Lists.query

    def counted(lists: Lists, count: int, which: Array, quick: bool = False) -> tuple[Array, Array]:
        numbers.append(len(which))
        return query(lists, count, which, quick)

    monkeypatch.setattr(Lists, "query", counted)
    return numbers


def test_lists_with_some_to_spare_need_no_tree_until_the_motion_has_used_it_up(asked: list[int]) -> None:
    x = jittered_points(1)
    lists = Lists.of(x, x, 8, 8)
    for _ in range(3):
        lists = lists.moved(lists.sources + 1e-3, lists.targets + 1e-3)
    assert asked == [81]
    lists.moved(lists.sources + 0.1, lists.targets + 0.1)
    assert asked == [81, 81]


def test_what_moves_fast_elsewhere_takes_no_list_its_spare_sources(asked: list[int]) -> None:
    random = np.random.default_rng(2)
    sources = random.random((800, 2)) * [8.0, 1.0]
    lists = Lists.of(sources, sources, 6, spare=8)
    asked.clear()
    for _ in range(10):
        sources = sources + 0.1 * (sources[:, :1] < 0.5) * np.array([0.0, 1.0])
        lists = lists.moved(sources, sources)
    assert sum(asked) < 0.2 * 10 * len(sources)


def test_lists_of_all_sources_never_end(asked: list[int]) -> None:
    x = jittered_points(1, side=3)
    lists = Lists.of(x, x, 5, 8)
    assert np.isinf(lists.reach).all()
    moved = lists.moved(x[::-1], x)
    np.testing.assert_array_equal(moved.nearest()[0], Lists.of(x[::-1], x, 5).index[:, :5])
    assert asked == [9, 9]


# Weights.


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("weight", ["gaussian", "quartic", "spline"])
def test_the_normal_equations_give_the_weights_of_the_orthogonal_columns(
    degree: int, weight: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources, targets = jittered_points(3), 0.1 + 0.8 * np.random.default_rng(1).random((80, 2))
    supports = Supports.nearest(sources, targets, 6 * (degree + 1))
    places = over_radius(sources, targets, supports.index, supports.radius)
    given = places, supports.radius, degree, ((0, 0), (1, 0), (0, 1)), weight, 3.0
    phi, quality = fit(*given)
    monkeypatch.setattr(least_squares, "SOUND", np.inf)
    careful, pivot = fit(*given)
    assert (quality > SOUND).mean() > 0.9
    for one, other in zip(phi, careful, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * np.abs(other).max())
    np.testing.assert_allclose(quality, pivot, rtol=1e-11)


def test_poor_supports_are_left_to_the_orthogonal_columns() -> None:
    """Neighbours near one line, where the normal equations would lose all digits."""
    along, height = np.linspace(-1.0, 1.0, 10), np.random.default_rng(2).uniform(-1.0, 1.0, 10)
    for flat in (1e-2, 1e-4, 0.0):
        near = np.stack([along, 0.5 * along + flat * height])[..., None]
        phi, quality = fit(scaled(near, np.array([1.1])), np.array([1.1]), 2, ((1, 0), (0, 1)), "gaussian", 3.0)
        if flat:
            assert 0.1 * flat**2 < quality[0] < flat
            np.testing.assert_allclose(phi[:, 0] @ near[..., 0].T, np.eye(2), rtol=0.0, atol=1e-14 / quality[0])
        else:
            assert quality[0] < 1e-14
