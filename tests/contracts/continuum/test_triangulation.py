"""Delaunay's triangulation: found, and led to by flips in another one of the same nodes."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import CLOUDS, jittered_points
from hypothesis import given, settings
from hypothesis import strategies as st

from nlsolve.contracts.continuum import triangulation
from nlsolve.flow.accuracy.enrichment import twice_as_fine
from nlsolve.flow.accuracy.holes import circumcentres
from nlsolve.plugin import Cloud, SolveError
from nlsolve.series import Array, Indices


def annulus(rings: int) -> tuple[Array, Array]:
    """Nodes on circles, inside a tool's and an outer wall's; and the number of the wall of each, 0 inside."""
    nodes, walls = [], []
    for i in range(rings):
        radius = 1.0 + 0.2 * i
        angle = np.linspace(0.0, 2.0 * np.pi, int(10.0 * np.pi * radius), endpoint=False) + 0.1 * i
        nodes.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        walls.append(np.full(len(angle), {0: 1, rings - 1: 2}.get(i, 0)))
    return np.concatenate(nodes), np.concatenate(walls)


def square(side: int) -> tuple[Array, Array]:
    """A grid, all of whose squares have two diagonals; and the wall around it."""
    x, y = (c.ravel() for c in np.meshgrid(np.arange(float(side)), np.arange(float(side))))
    rim = (x == 0) | (x == side - 1) | (y == 0) | (y == side - 1)
    return np.stack([x, y], axis=1), rim.astype(int)


def inside(corners: Array, walls: Array) -> set[tuple[int, ...]]:
    """The triangles that do not lie between nodes of one wall."""
    return {tuple(three) for three in corners[~triangulation.on_one_wall(walls[corners.T])].tolist()}


@pytest.mark.parametrize("shape", ["annulus", "square"])
def test_flips_lead_to_the_triangulation_found_anew_or_nowhere(shape: str) -> None:
    """Motions up to a spacing; smaller ones than these leave the squares of the grid undecided."""
    led = 0
    for seed, motion in enumerate(np.repeat(10.0 ** np.arange(-14.0 if shape == "annulus" else -6.0, 0.0), 6)):
        nodes, walls = annulus(5 + seed % 4) if shape == "annulus" else square(5 + seed % 5)
        shift = motion * np.random.default_rng(seed).standard_normal(nodes.shape)
        shift[walls > 0] = 0.0
        kept = triangulation.kept(triangulation.found(nodes), nodes + shift, walls)
        if kept is not None:
            led += 1
            assert inside(kept, walls) == inside(triangulation.found(nodes + shift), walls)
    assert led > (70 if shape == "annulus" else 25)


def test_the_diagonal_of_a_square_stays_until_the_motion_decides() -> None:
    """Four nodes on a circle, far from the origin: rounding does not choose among their diagonals."""
    nodes, walls = square(7)
    nodes += 30.0
    for seed in range(5):
        before = triangulation.found(nodes)
        shift = 1e-13 * np.random.default_rng(seed).standard_normal(nodes.shape)
        kept = triangulation.kept(before, nodes + shift, walls)
        assert kept is not None
        np.testing.assert_array_equal(kept, before)


def test_a_hull_that_goes_straight_on_inside_is_found_anew() -> None:
    """It may have a triangle more or less; along a wall such a triangle is left out."""
    nodes, walls = square(5)
    corners = triangulation.found(nodes)
    assert triangulation.kept(corners, nodes, walls) is not None
    assert triangulation.kept(corners, nodes, np.zeros_like(walls)) is None


def test_a_triangle_turned_inside_out_and_a_hull_that_caves_in_have_all_found_anew() -> None:
    nodes = jittered_points(3)
    walls, corners = np.zeros(len(nodes), dtype=int), triangulation.found(nodes)
    mirrored = nodes * [-1.0, 1.0]
    assert triangulation.kept(corners, mirrored, walls) is None
    outermost = int(nodes[:, 0].argmax())
    caved = nodes.copy()
    caved[outermost, 0] -= 0.15
    assert triangulation.kept(corners, caved, walls) is None


# Triangles that are cut.

MANY = 1000
"""More nodes than any cloud here has."""


def areas(nodes: Array, corners: Indices) -> Array:
    return triangulation.doubled_areas(*nodes.T, *corners.T)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_cut_triangles_fill_the_same_plane_and_have_the_new_nodes_for_corners(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    nodes = random.uniform(size=(30, 2))
    corners = triangulation.found(nodes)
    edges = triangulation.edges_of(corners)
    chosen = random.permutation(edges[random.uniform(size=len(edges)) < share])
    cut = triangulation.subdivided(corners, chosen, len(nodes))
    whole = np.concatenate([nodes, nodes[chosen].mean(axis=1)])
    assert (areas(whole, cut) > 0.0).all()
    assert areas(whole, cut).sum() == pytest.approx(areas(nodes, corners).sum())
    assert len(cut) == len(corners) + (np.isin(triangulation.side_keys(corners, MANY), keys(chosen))).sum()
    assert set(range(len(whole))) == set(cut.ravel())
    assert not np.isin(keys(triangulation.edges_of(cut)), keys(chosen)).any()


def keys(edges: Indices) -> Indices:
    return edges.min(axis=1) * MANY + edges.max(axis=1)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_a_cloud_twice_as_fine_is_triangulated_from_the_coarser_one(cloud: Cloud) -> None:
    """No node lies inside the circle of a triangle in the flow; of nodes on one circle either diagonal may be there."""
    finer = twice_as_fine(cloud).cloud
    assert finer.triangles_before is not None
    assert triangulation.kept(finer.triangles_before, finer.nodes, finer.walls) is not None
    corners = finer.triangulation
    assert areas(finer.nodes, corners).sum() == pytest.approx(
        areas(finer.nodes, triangulation.found(finer.nodes)).sum()
    )
    in_flow = corners[~triangulation.on_one_wall(finer.walls[corners.T])]
    centres = circumcentres(finer.nodes[in_flow])
    radii = np.linalg.norm(finer.nodes[in_flow[:, 0]] - centres, axis=1)
    nearest = finer.tree.query(centres)[0]
    assert (nearest >= radii * (1.0 - 1e-9)).all()
    assert set(in_flow.ravel()) == set(range(len(finer.nodes)))


@pytest.mark.parametrize("corners", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2]], [[0, 2, 1], [0, 2, 3]]])
def test_known_triangles_excuse_no_node_that_none_of_them_has(corners: list[list[int]]) -> None:
    """Node 4 lies where node 2 does; the triangles of the first four nodes are all upright, or one is not."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 1.0]])
    with pytest.raises(SolveError, match=r"two nodes coincide at \(1, 1\)"):
        Cloud(nodes, {}, triangles_before=np.array(corners))


def test_the_spacing_at_a_node_is_the_median_length_of_its_edges() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [-4.0, -4.0]])
    assert Cloud(nodes, {}).edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    lengths = np.linalg.norm(nodes[[1, 2, 3]] - nodes[0], axis=1)
    assert Cloud(nodes, {}).spacing[0] == np.median(lengths)


def test_a_moved_cloud_forgets_triangles_of_another_place() -> None:
    cloud = twice_as_fine(CLOUDS["jittered"]).cloud
    assert cloud.moved_to(cloud.nodes + 0.0).triangles_before is None


def test_walls_have_numbers_and_the_inside_none() -> None:
    cloud = Cloud(
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.4, 0.4]]), {"a": np.array([0, 2]), "b": np.array([1])}
    )
    np.testing.assert_array_equal(cloud.walls, [1, 2, 1, 0])
    np.testing.assert_array_equal(cloud.on_boundary, [True, True, True, False])


@pytest.mark.parametrize("largest", [0, 9, 2**62])
@pytest.mark.parametrize("count", [0, 1, 50])
def test_whole_numbers_in_order_with_their_places(largest: int, count: int) -> None:
    """Equal ones stay as they were, also where places do not fit beside the numbers."""
    keys = np.random.default_rng(5).integers(0, largest + 1, count)
    order, in_order = triangulation.in_order(keys)
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))
    np.testing.assert_array_equal(in_order, keys[order])
