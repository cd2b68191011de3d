"""The largest circle without a node, beside the spacing around it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from cases import setup
from clouds import CLOUDS
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_discretizers import LinearTriangles
from nlsolve_scenes import Cavity, Channel, Manufactured, StirringTool
from nlsolve_scenes.nodes.rings import Rings

from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.triangulation import edges_of, spacings
from nlsolve.flow.accuracy.holes import circumcentres, largest_hole
from nlsolve.flow.validity import LIMITS
from nlsolve.plugin import Cloud, ConstitutiveLaw
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case

LIMIT = LIMITS["audit.hole"].largest


def without(cloud: Cloud, centre: Array, radius: float) -> Cloud:
    """The cloud without its inner nodes in a circle."""
    keep = (np.linalg.norm(cloud.nodes - centre, axis=1) > radius) | cloud.on_boundary
    number = np.cumsum(keep) - 1
    return Cloud(cloud.nodes[keep], {name: number[group] for name, group in cloud.boundaries.items()})


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("shear", "ratio"), [(np.eye(2), np.sqrt(0.5)), ([[1.0, 0.0], [0.5, np.sqrt(0.75)]], 3**-0.5)])
def test_squares_and_equilateral_triangles(shear: Array, ratio: float, unit: float) -> None:
    lattice = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    rim = np.flatnonzero((lattice == 0.0).any(axis=1) | (lattice == 8.0).any(axis=1))
    found = largest_hole(Cloud(unit * lattice @ np.asarray(shear), {"wall": rim}))
    assert found.value == pytest.approx(ratio, rel=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_circumcentre_is_as_far_from_all_corners(seed: int) -> None:
    corners = np.random.default_rng(seed).standard_normal((5, 3, 2))
    distances = np.linalg.norm(corners - circumcentres(corners)[:, None], axis=2)
    np.testing.assert_allclose(distances, distances[:, :1] * np.ones(3), rtol=1e-6)


def test_three_points_on_a_line_have_no_circumcentre() -> None:
    assert not np.isfinite(circumcentres(np.array([[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]]))).all()


def test_the_spacing_of_a_node_is_the_median_of_its_edges() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [-5.0, 0.0], [9.0, 9.0]])
    found = spacings(nodes, np.array([[0, 1], [0, 2], [0, 3]]))
    np.testing.assert_array_equal(found, [2.0, 1.0, 2.0, 5.0, np.inf])


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_a_hole_of_four_spacings_is_found_at_its_place(cloud: Cloud) -> None:
    assert largest_hole(cloud).value < LIMIT
    middle = cloud.nodes[cloud.interior]
    from_wall = np.linalg.norm(middle[:, None] - cloud.nodes[cloud.boundary], axis=2).min(axis=1)
    centre = middle[from_wall.argmax()]
    spacing = np.sort(np.linalg.norm(cloud.nodes - centre, axis=1))[6]
    holed = largest_hole(without(cloud, centre, min(4.0 * spacing, 0.8 * from_wall.max())))
    assert holed.value > LIMIT
    assert "there is no node within " in holed.sentence
    assert "add nodes there" in holed.sentence


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_it_is_the_largest_of_all_circles_whose_centres_lie_in_the_flow(cloud: Cloud) -> None:
    """By SciPy's own search of the triangle around each centre."""
    triangles = scipy.spatial.Delaunay(cloud.nodes)
    corners = triangles.simplices
    centres = circumcentres(cloud.nodes[corners])
    in_flow = ~cloud.on_boundary[corners].all(axis=1)
    at = triangles.find_simplex(np.nan_to_num(centres, nan=np.inf))
    inside = in_flow & (at >= 0) & in_flow[at]
    radii = np.linalg.norm(cloud.nodes[corners[:, 0]] - centres, axis=1)
    ratios = radii / spacings(cloud.nodes, edges_of(corners))[corners].max(axis=1)
    assert largest_hole(cloud).value == pytest.approx(ratios[inside].max(), rel=1e-9)


@pytest.mark.parametrize(
    "scene",
    [StirringTool(nodes=Rings(spacing=0.5)), Channel(jitter=0.3), Cavity(spacing=0.15), Manufactured()],
    ids=lambda scene: scene.kind,
)
def test_no_shipped_cloud_has_one(scene: Geometry) -> None:
    assert largest_hole(scene.cloud(setup(scene).law)).value < LIMIT


class Holed(StirringTool):
    """A spin in whose cloud a circle of 1.2 mm radius is empty."""

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        return without(super().cloud(law), np.array([0.0, 4.4]), 1.2)


def test_a_run_on_such_a_cloud_is_doubted() -> None:
    found = run_case(setup(Holed(nodes=Rings(spacing=0.3)), index=1.0, discretizer=LinearTriangles())).summary
    assert found["status"] == "converged"
    assert found["audit.hole"] > LIMIT
    assert "there is no node within 1" in found["doubt"]


def test_a_cloud_whose_inner_nodes_are_all_beside_walls_has_none() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    assert np.isnan(largest_hole(Cloud(nodes, {"wall": np.arange(4)})).value)
