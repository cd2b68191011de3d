"""Node sets: how even scattered nodes are, what auto picks, and what files hold or lack."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from cases import setup
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_laws import Bingham, CarreauYasuda, HerschelBulkley, NortonHoff, PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import Channel, Couette, StirringTool
from nlsolve_scenes.nodes import files, fronts
from nlsolve_scenes.nodes.between_circles import between_circles
from nlsolve_scenes.nodes.files import NodeFile
from nlsolve_scenes.nodes.rectangle import sides
from nlsolve_scenes.nodes.rings import Auto, GradedRings, Rings, Scattered
from nlsolve_scenes.nodes.scatter import jittered, scatter
from pydantic import ValidationError
from scipy.integrate import trapezoid
from scipy.spatial import Delaunay, Voronoi, cKDTree

from nlsolve import SolveError, Status
from nlsolve.flow.accuracy.holes import circumcentres
from nlsolve.flow.continuation import Start
from nlsolve.plugin import Cloud, ConstitutiveLaw, FlowScene, doubled_areas, on_one_wall
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.testing import check_scene

LAW = PowerLaw()

# Scattered nodes: separation, covering, number.

Function = Callable[[Array], Array]


def annulus(nodes: Scattered, outer: float) -> tuple[Cloud, Function, Function, float]:
    """A cloud, its spacing, distance to the walls, and ∫ 2/(√3 h²) dA."""
    cloud = StirringTool(plate_radius=outer, nodes=nodes).cloud(LAW)
    log_radius = np.linspace(np.log(1.5), np.log(outer), 20001)
    radius = np.exp(log_radius)
    share = 4.0 * np.pi / np.sqrt(3.0) * (radius / nodes.local_spacing(radius, 1.5)) ** 2
    return (
        cloud,
        lambda x: nodes.local_spacing(np.hypot(*x.T), 1.5),
        lambda x: np.minimum(np.hypot(*x.T) - 1.5, outer - np.hypot(*x.T)),
        float(trapezoid(share, log_radius)),
    )


def square() -> tuple[Cloud, Function, Function, float]:
    """|x|, |y| ≤ 1, finest at a point off the middle; the walls' nodes at equal steps of ∫ ds/h."""

    def spacing(x: Array) -> Array:
        return 0.03 + 0.15 * np.hypot(x[:, 0] - 0.3, x[:, 1] + 0.2)

    t = np.linspace(-1.0, 1.0, 20001)
    walls = {}
    for name, place in {
        "bottom": lambda t: np.stack([t, -1.0 + 0.0 * t], axis=1),
        "right": lambda t: np.stack([1.0 + 0.0 * t, t], axis=1),
        "top": lambda t: np.stack([-t, 1.0 + 0.0 * t], axis=1),
        "left": lambda t: np.stack([-1.0 + 0.0 * t, -t], axis=1),
    }.items():
        steps = np.concatenate([[0.0], np.cumsum(np.diff(t) / spacing(place(t))[1:])])
        count = round(steps[-1])
        walls[name] = place(np.interp(steps[-1] * np.arange(count) / count, steps, t))

    def depth(x: Array) -> Array:
        return 1.0 - np.abs(x).max(axis=1)

    middles = (np.arange(1000) + 0.5) / 500 - 1.0
    share = 2.0 / np.sqrt(3.0) / spacing(np.stack([*map(np.ravel, np.meshgrid(middles, middles))], axis=1)) ** 2
    return scatter(walls, lambda x: depth(x) > 0.0, spacing, seed=3), spacing, depth, 4.0 * float(share.mean())


CLOUDS: dict[str, Callable[[], tuple[Cloud, Function, Function, float]]] = {
    "even": lambda: annulus(Scattered(first=0.25, growth=0.0), 6.0),
    "graded": lambda: annulus(Scattered(first=0.05, growth=0.15, seed=1), 6.0),
    "steep": lambda: annulus(Scattered(first=0.05, growth=0.4, spacing=2.0), 6.0),
    "a hundred radii": lambda: annulus(Scattered(first=0.1, growth=0.12, spacing=50.0), 150.0),
    "square": square,
}


@pytest.mark.parametrize("name", CLOUDS)
def test_scattered_nodes_are_as_many_and_as_even_as_asked_for(name: str) -> None:
    cloud, spacing, depth, expected = CLOUDS[name]()
    nodes, inner = cloud.nodes, cloud.nodes[cloud.interior]
    assert (cloud.nearest_distance / spacing(nodes)).min() > 0.6
    assert (depth(inner) / spacing(inner)).min() > 0.5
    # The largest empty circles are centred on Voronoi vertices; in a triangular lattice their radius is 0.577 h.
    centres = Voronoi(nodes).vertices
    centres = centres[depth(centres) > 0.0]
    holes = cKDTree(nodes).query(centres)[0] / spacing(centres)
    assert np.median(holes) < 0.65
    assert holes.max() < 0.9
    assert len(nodes) == pytest.approx(expected, rel=0.16)
    assert len(nodes) - 0.5 * len(cloud.boundary) == pytest.approx(expected, rel=0.02)  # half a wall node is inside


def test_scattered_nodes_depend_on_their_seed_alone() -> None:
    first, again, other = (StirringTool(nodes=Scattered(seed=seed)).cloud(LAW).nodes for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert first.shape == other.shape
    assert not np.array_equal(first, other)


def test_walls_too_close_for_their_spacing_leave_no_room() -> None:
    with pytest.raises(SolveError, match="no room for nodes between them: make the spacing smaller") as ending:
        StirringTool(tool_radius=5.9, nodes=Scattered(first=0.25)).cloud(LAW)
    assert ending.value.status is Status.BAD_CLOUD


# Jitter.


@pytest.mark.parametrize("nodes", [Rings, GradedRings, Scattered, Auto])
def test_jitter_shifts_inner_nodes_by_part_of_the_nearest_distance(nodes: Any) -> None:
    plain, shaken, again, other = (
        StirringTool(nodes=nodes(**fields)).cloud(LAW)
        for fields in ({"seed": 1}, {"jitter": 0.3, "seed": 1}, {"jitter": 0.3, "seed": 1}, {"jitter": 0.3, "seed": 2})
    )
    np.testing.assert_array_equal(plain.nodes[plain.boundary], shaken.nodes[shaken.boundary])
    shift = (np.abs(shaken.nodes - plain.nodes) / plain.nearest_distance[:, None])[plain.interior]
    assert 0.29 < shift.max() <= 0.3 * (1.0 + 1e-9)
    assert shift.mean() == pytest.approx(0.15, rel=0.05)
    np.testing.assert_array_equal(shaken.nodes, again.nodes)
    assert not np.array_equal(shaken.nodes, other.nodes)


def test_no_jitter_is_the_same_cloud() -> None:
    cloud = StirringTool().cloud(LAW)
    assert jittered(cloud, 0.0, 0) is cloud


@pytest.mark.parametrize("nodes", ["rings", "graded-rings", "scattered", "auto"])
@pytest.mark.parametrize("jitter", [-0.1, 0.5])
def test_jitter_stays_below_half(nodes: str, jitter: float) -> None:
    with pytest.raises(ValidationError, match=r"jitter\n.*(greater than or equal to 0|less than 0.5)"):
        StirringTool(nodes={"kind": nodes, "jitter": jitter})  # type: ignore[arg-type]


# A hundred radii.


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(6, 40), min_size=1, max_size=6))
def test_a_walk_around_the_gaps_fills_them_with_upright_triangles(counts: list[int]) -> None:
    radii = 1.0 + 0.3 * np.arange(len(counts))
    nodes = np.concatenate([r * ring(count) for r, count in zip(radii, counts, strict=True)])
    corners = between_circles(np.array(counts))
    areas = 0.5 * doubled_areas(*nodes.T, *corners.T)
    if len(counts) < 2 or min(counts) >= 24:  # a wide side of a circle may cut the next one
        assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(0.5 * counts[-1] * radii[-1] ** 2 * np.sin(2.0 * np.pi / counts[-1]))
    assert len(corners) == counts[0] - 2 + sum(one + other for one, other in pairwise(counts))
    assert len(np.unique(np.sort(corners, axis=1), axis=0)) == len(corners)


def ring(count: int) -> Array:
    """Nodes (count, 2) at equal angles on the unit circle."""
    angle = 2.0 * np.pi / count * np.arange(count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("nodes", [GradedRings(), GradedRings(first=0.02, growth=0.3, spacing=0.5, jitter=0.1)])
def test_graded_rings_are_triangulated_by_a_walk_as_by_qhull_but_for_ties(nodes: GradedRings) -> None:
    """The circle of every triangle is empty in both."""
    walked = nodes.cloud(1.5, 6.0)
    found = replace(walked, triangles_before=None)
    assert Rings().cloud(1.5, 6.0).triangles_before is None
    assert walked.triangles_before is not None
    assert len(walked.triangulation) == len(found.triangulation)
    corners = walked.triangulation[~on_one_wall(walked.walls[walked.triangulation.T])]
    centres = circumcentres(walked.nodes[corners])
    radii = np.linalg.norm(walked.nodes[corners[:, 0]] - centres, axis=1)
    nearest = cKDTree(walked.nodes).query(centres)[0]
    np.testing.assert_allclose(nearest, radii, rtol=1e-8)
    other = [frozenset(map(int, three)) for three in found.triangulation]
    assert len({frozenset(map(int, three)) for three in corners} - set(other)) < 0.01 * len(corners)


def test_graded_rings_reach_a_hundred_radii() -> None:
    """52 rings or so: log(1 + growth · 148.5/first)/log(1 + growth), as far apart along a ring as across."""
    nodes = GradedRings(first=0.1, growth=0.12, spacing=50.0)
    cloud = StirringTool(plate_radius=150.0, nodes=nodes).cloud(LAW)
    radii, counts = np.unique(np.round(np.hypot(*cloud.nodes.T), 9), return_counts=True)
    assert len(cloud.nodes) == 2830
    assert radii[-1] == pytest.approx(150.0)
    assert len(radii) == pytest.approx(np.log1p(0.12 * 148.5 / 0.1) / np.log(1.12) + 1.0, abs=1.0)
    aspect = np.diff(radii) / (2.0 * np.pi * radii[:-1] / counts[:-1])
    assert 0.75 < aspect.min() <= aspect.max() < 1.25
    assert (np.diff(radii)[1:] / np.diff(radii)[:-1]).max() < 1.13


# Fronts and sides by a given spacing.


def towards_the_side(points: Array) -> Array:
    """Finest at the side of the tool, (0, 1.5)."""
    return 0.03 + 0.15 * np.hypot(points[:, 0], points[:, 1] - 1.5)


def test_fronts_around_the_tool_keep_to_the_spacing() -> None:
    cloud = fronts.annulus(1.5, 6.0, towards_the_side, 0)
    h = towards_the_side(cloud.nodes)
    ratio = cloud.nearest_distance / h
    assert ratio.min() > 0.5
    assert ratio.max() < 1.2
    assert np.median(ratio) == pytest.approx(0.95, abs=0.1)
    centres = cloud.nodes[Delaunay(cloud.nodes).simplices]
    middle = centres.mean(axis=1)
    inside = np.hypot(*middle.T) > 1.5
    longest = np.linalg.norm(centres - np.roll(centres, 1, axis=1), axis=2).max(axis=1)
    assert (longest / towards_the_side(middle))[inside & (np.hypot(*middle.T) < 5.9)].max() < 2.5
    for group, radius in (("tool", 1.5), ("plate", 6.0)):
        np.testing.assert_allclose(np.hypot(*cloud.nodes[cloud.boundaries[group]].T), radius)
    np.testing.assert_array_equal(fronts.annulus(1.5, 6.0, towards_the_side, 0).nodes, cloud.nodes)


def test_a_spacing_too_wide_for_fronts_leaves_scattered_nodes() -> None:
    cloud = fronts.annulus(1.5, 6.0, lambda points: np.full(len(points), 2.1), 0)
    assert len(cloud.boundaries["tool"]) == 12
    np.testing.assert_allclose(np.hypot(*cloud.nodes[cloud.boundaries["tool"]].T), 1.5)
    assert len(cloud.interior) > 0


def test_the_nodes_of_sides_are_at_equal_steps_of_the_spacing() -> None:
    walls = sides((0.0, -1.0), (2.0, 1.0), lambda points: 0.05 + 0.1 * np.abs(points[:, 1] + 1.0))
    assert len(walls["bottom"]) == 41
    gaps = np.diff(walls["left"][:, 1])
    np.testing.assert_allclose(gaps[1:] / gaps[:-1], np.exp(0.1), rtol=0.01)
    assert walls["top"][[0, -1]].tolist() == [[0.0, 1.0], [2.0, 1.0]]


# Auto.


@pytest.mark.parametrize("index", [1.0, 0.3, 0.1324, 0.05, 0.02])
def test_auto_starts_with_a_part_of_the_layer_of_a_power_law(index: float) -> None:
    """first = 0.75 r_t n/2 in the spin, 0.7 r_t n² in the orbit, between `smallest` and `spacing` or `middle`."""
    law = PowerLaw(index=index, regularization=1e-6)
    for motion, wanted, smallest, largest in (
        ("spin", 0.75 * 1.5 * index / 2.0, 0.008, 0.25),
        ("orbit", 0.7 * 1.5 * index**2, 0.0066, 0.17 * min(index, 0.75**0.5) ** 0.2),
    ):
        cloud = StirringTool(motion=motion, nodes=Auto()).cloud(law)
        first = min(max(wanted, smallest), largest)
        assert cloud.nearest_distance.min() == pytest.approx(first, rel=0.07)
        assert len(cloud.nodes) < (20_000 if index >= 0.05 else 22_000)


def test_auto_has_at_most_ten_thousand_nodes_for_the_orbit_of_the_paper() -> None:
    """By finite elements of others its worst node is wrong by less than 0.5 % of the tool's speed."""
    assert 9_000 < len(StirringTool(motion="orbit", nodes=Auto()).cloud(LAW).nodes) < 10_000


def test_the_middle_spacing_holds_up_to_the_reach_of_the_tool() -> None:
    nodes = GradedRings(first=0.05, growth=0.2, middle=0.1, reach=2.0, spacing=0.3)
    radii = np.array([1.5, 1.75, 2.5, 3.5, 4.0, 6.0])
    np.testing.assert_allclose(nodes.local_spacing(radii, 1.5), [0.05, 0.1, 0.1, 0.1, 0.2, 0.3])


def test_auto_keeps_the_first_spacing_across_five_layers() -> None:
    layer = 1.5 * 0.1324 / 2.0
    radii = np.unique(np.round(np.hypot(*StirringTool(nodes=Auto(resolution=0.5)).cloud(LAW).nodes.T), 9))
    gaps = np.diff(radii)
    np.testing.assert_allclose(gaps[radii[:-1] < 1.5 + 4.9 * layer], 0.5 * layer, rtol=0.05)
    assert gaps[-1] > 4.0 * gaps[0]


@pytest.mark.parametrize(
    "law", [PowerLaw(), PowerLaw(index=0.02), CarreauYasuda(), NortonHoff(), Bingham()], ids=lambda law: law.kind_name()
)
def test_the_strain_rate_falls_by_e_over_the_layer(law: ConstitutiveLaw) -> None:
    """γ̇ = −r d(u_θ/r)/dr of the exact spin; (1 + n/2)^(−2/n) is e^(−1) but for curvature."""
    scene, h = Couette(plate_radius=60.0), 1e-6
    radii = 1.5 + scene.layer(law) * np.array([1e-3, 1.0])

    def turn(r: Array) -> Array:
        exact = scene.exact(law, np.stack([r, 0.0 * r], axis=1), 0.0)
        assert exact is not None
        return exact.velocity[:, 1] / r

    rate = -radii * (turn(radii + h) - turn(radii - h)) / (2 * h)
    assert np.log(rate[0] / rate[1]) == pytest.approx(1.0, abs=0.25)


def test_the_layer_of_the_orbit_is_the_measured_one() -> None:
    """0.022 mm for n = 0.1324 by finite elements."""
    assert StirringTool(motion="orbit").layer(PowerLaw()) == pytest.approx(0.022, rel=0.25)


def test_the_layer_is_no_thicker_than_the_gap_allows() -> None:
    scene = StirringTool(tool_radius=1.0, plate_radius=1.2, nodes=Auto())
    assert scene.layer(PowerLaw(index=1.0)) == pytest.approx(0.05)
    assert len(scene.cloud(PowerLaw(index=1.0)).interior) == 919


# Solves on them.


@pytest.mark.parametrize(
    ("nodes", "index", "count", "bound"),
    [
        (Auto(), 0.1324, 3454, 0.003),
        (Scattered(first=0.1), 0.3, 2477, 0.01),
        (Rings(jitter=0.2), 0.5, 1780, 0.02),
        pytest.param(Auto(resolution=0.45), 0.1324, 6059, 0.001, marks=pytest.mark.slow),
        pytest.param(Auto(), 0.05, 6762, 0.002, marks=pytest.mark.slow),
    ],
    ids=repr,
)
def test_spin_on_each_kind_of_nodes(nodes: Any, index: float, count: int, bound: float) -> None:
    start = Start(values=(1.0, 0.5, 0.3, 0.2, 0.13, 0.09, 0.07))
    row = march(setup(StirringTool(nodes=nodes), index=index, linear=SuperLU(), start=start)).summary
    assert row["status"] == "converged", row["message"]
    assert row["nodes"] == count
    assert row["velocity_error"] <= bound


@pytest.mark.parametrize(("law", "count"), [(CarreauYasuda(), 2176), (HerschelBulkley(), 2311), (NortonHoff(), 2709)])
def test_auto_resolves_the_spin_of_any_law(law: ConstitutiveLaw, count: int) -> None:
    start = Start() if "index" in law.continued_by else Start(by="regularization", values=(1e3, 1e2, 10.0, 1.0))
    row = march(setup(Couette(nodes=Auto()), law=law, linear=SuperLU(), start=start)).summary
    assert row["status"] == "converged", row["message"]
    assert row["nodes"] == count
    assert row["velocity_error"] <= 0.003


def test_channel_on_scattered_nodes() -> None:
    scene = Channel(nodes="scattered", spacing=0.1)
    check_scene(scene, LAW)
    row = march(setup(scene, index=0.5)).summary
    assert row["status"] == "converged", row["message"]
    assert row["velocity_error"] <= 0.005


# Files.

CIRCLES = Rings(spacing=0.5)


def write_csv(path: Path, cloud: Cloud) -> None:
    names = np.full(len(cloud.nodes), "", dtype=object)
    for name, group in cloud.boundaries.items():
        names[group] = name
    lines = [f"{x!r},{y!r},{name}" for (x, y), name in zip(cloud.nodes.tolist(), names, strict=True)]
    path.write_text("\n".join(["x,y,group", *lines]), encoding="utf-8")


def same(found: Cloud, given: Cloud) -> None:
    np.testing.assert_allclose(found.nodes, given.nodes, rtol=1e-15)
    for name, group in given.boundaries.items():
        np.testing.assert_array_equal(found.boundaries[name], group)


@pytest.mark.parametrize("scene", [StirringTool(nodes=CIRCLES), Couette(nodes=CIRCLES), Channel(spacing=0.25)])
def test_a_csv_file_gives_back_the_nodes_written_to_it(scene: FlowScene, tmp_path: Path) -> None:
    cloud = scene.cloud(LAW)
    write_csv(tmp_path / "nodes.csv", cloud)
    from_file = scene.with_(nodes={"kind": "file", "path": str(tmp_path / "nodes.csv")})
    same(from_file.cloud(LAW), cloud)
    check_scene(from_file, LAW)


def mesh_of(cloud: Cloud) -> tuple[Array, list[tuple[str, Any]]]:
    """Triangles of the nodes and, first, a point that belongs to none; lines along both circles."""
    from_points = np.concatenate([[[99.0, 99.0]], cloud.nodes])
    triangles = 1 + Delaunay(cloud.nodes).simplices
    lines = [1 + np.stack([group, np.roll(group, -1)], axis=1) for group in cloud.boundaries.values()]
    return from_points, [("triangle", triangles), *(("line", line) for line in lines)]


def gmsh(path: Path, cloud: Cloud) -> None:
    """Physical curves 7 "tool" and 8 "plate", physical surface 9."""
    points, cells = mesh_of(cloud)
    tags = [np.full(len(data), tag) for tag, (_, data) in zip((9, 7, 8), cells, strict=True)]
    meshio.write(
        path,
        meshio.Mesh(
            np.concatenate([points, np.zeros((len(points), 1))], axis=1),
            cells,
            cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
            field_data={"tool": np.array([7, 1]), "plate": np.array([8, 1]), "material": np.array([9, 2])},
        ),
        file_format="gmsh22",
    )


def abaqus(path: Path, cloud: Cloud) -> None:
    """Node sets."""
    points, cells = mesh_of(cloud)
    sets = {name: 1 + group for name, group in cloud.boundaries.items()}
    meshio.write(path, meshio.Mesh(points, cells[:1], point_sets=sets))


def nastran_like(path: Path, cloud: Cloud) -> None:
    """Sets of lines."""
    points, cells = mesh_of(cloud)
    none = np.array([], dtype=int)
    sets = {
        name: [none, *(np.arange(len(data)) if number == k else none for number, (_, data) in enumerate(cells[1:]))]
        for k, name in enumerate(cloud.boundaries)
    }
    meshio.write(path, meshio.Mesh(points, cells, cell_sets=sets))


@pytest.mark.parametrize(("write", "suffix"), [(gmsh, "msh"), (abaqus, "inp"), (nastran_like, "inp")])
def test_a_mesh_gives_its_points_and_named_boundaries(
    write: Callable[[Path, Cloud], None], suffix: str, tmp_path: Path
) -> None:
    cloud = StirringTool(nodes=CIRCLES).cloud(LAW)
    path = tmp_path / f"annulus.{suffix}"
    write(path, cloud)
    same(StirringTool(nodes=NodeFile(path=str(path))).cloud(LAW), cloud)


GOOD = "x,y,group\n1.5,0,tool\n6,0,plate\n"

FILES: list[tuple[str, str, str]] = [
    ("a.csv", "x,y\n", "line 1: the header is 'x,y'; it must be 'x,y,group'"),
    ("a.csv", "", "line 1: the header is ''"),
    ("a.csv", GOOD + "\n3.O,0,\n", "line 5: x = '3.O' is not a number"),
    ("a.csv", GOOD + "3,,\n", "line 4: y = '' is not a number"),
    ("a.csv", GOOD + "3,0\n", "line 4: '3,0' has 2 values; x,y,group are needed"),
    ("a.csv", GOOD + "nan,0,\n", "node 2 has a coordinate that is not a finite number"),
    ("a.csv", GOOD + "6,0,\n", "coincide at"),
    ("a.csv", "x,y,group\n1.5,0,pin\n6,0,plate\n", "boundary groups found: pin, plate; the scene also needs tool"),
    ("a.csv", "x,y,group\n1.5,0,\n", "boundary groups found: none; the scene also needs tool, plate"),
    ("a.csv", GOOD + "1.4,0,tool\n", "'tool' lies at r = 1.4 mm, tool_radius = 1.5 mm"),
    ("a.csv", GOOD + "0,7,plate\n", "'plate' lies at r = 7 mm, plate_radius = 6 mm"),
    ("a.msh", "no mesh", "a.msh: meshio cannot read it"),
    ("a.mesh-of-mine", "no mesh", "a.mesh-of-mine: meshio cannot read it"),
]


@pytest.mark.parametrize(("name", "content", "sentence"), FILES, ids=lambda value: value[:40])
def test_a_bad_file_is_named_with_its_line_and_value(
    name: str, content: str, sentence: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(SolveError) as ending:
        StirringTool(nodes=NodeFile(path=str(tmp_path / name))).cloud(LAW)
    assert ending.value.status is Status.BAD_CLOUD
    assert sentence in ending.value.detail
    assert "\n" not in ending.value.detail
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_named() -> None:
    row = march(setup(StirringTool(nodes=NodeFile(path="nowhere.csv")))).summary
    assert row["status"] == "bad cloud"
    assert "nowhere.csv: there is no such file of nodes" in row["message"]


def test_a_mesh_off_its_plane_is_refused(tmp_path: Path) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]])
    meshio.write(tmp_path / "shell.vtk", meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))]))
    with pytest.raises(SolveError, match=r"its points span 0\.5 mm in z"):
        NodeFile(path=str(tmp_path / "shell.vtk")).cloud(())


def test_without_meshio_a_mesh_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "find_spec", lambda name: None)
    path = tmp_path / "annulus.msh"
    path.touch()
    with pytest.raises(SolveError, match=r"reading .*annulus\.msh needs meshio: pip install 'nlsolve\[mesh\]'"):
        NodeFile(path=str(path)).cloud(("tool",))
