"""Files of nodes that are odd or damaged: read, or refused in one sentence that names the file and what is wrong."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from cases import setup
from nlsolve_discretizers import LinearTriangles
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.files import NodeFile
from nlsolve_scenes.nodes.rings import GradedRings, Rings, Scattered
from odd_nodes import CSV, FIELD_DATA, ODD, annulus, vtu_with

from nlsolve import SolveError, Status
from nlsolve.plugin import Cloud, FlowScene
from nlsolve.solving.simulate import run_case, simulation_of
from nlsolve.solving.work.ledger import Ledger

NAMES = ("tool", "plate")


def mesh_of(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> NodeFile:
    """A file that meshio reads as one of the odd meshes, whatever its format can hold."""
    mesh = annulus()
    ODD[name](mesh)
    path = tmp_path / "annulus.msh"
    path.touch()
    monkeypatch.setattr(meshio, "read", lambda path: mesh)
    return NodeFile(path=str(path))


@pytest.mark.parametrize(
    "name",
    [
        *("sound", "flat-points", "raised", "nan-in-z", "single-precision", "no-cells", "empty-blocks"),
        *("empty-triangles", "lines-only", "triangles-only", "orphans", "quads", "polygons", "second-order"),
        *("field-time", "field-scalar", "field-many", "field-matrix", "field-words", "groups-as-masks-and-numbers"),
        *("vertices-only", "sets-of-cells", "empty-groups-and-tags", "same-name-for-a-surface-and-points"),
    ],
)
def test_what_can_be_read_is_read(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cloud = mesh_of(name, monkeypatch, tmp_path).cloud(NAMES)
    sound = Rings(spacing=1.5).cloud(1.5, 6.0)
    assert len(cloud.nodes) == len(sound.nodes)
    for group, radius in (("tool", 1.5), ("plate", 6.0)):
        assert len(cloud.boundaries[group]) == len(sound.boundaries[group])
        assert np.hypot(*cloud.nodes[cloud.boundaries[group]].T) == pytest.approx(radius, rel=1e-6)


SENTENCES = {
    "no-points": "its points have the shape (0, 3); (N, 2) or (N, 3) with N > 0 is needed",
    "points-on-one-axis": "its points have the shape (61, 1); (N, 2) or (N, 3) with N > 0 is needed",
    "tilted": "its points span 1 mm in z",
    "nan": "node 20 has a coordinate that is not a finite number",
    "infinite": "node 3 has a coordinate that is not a finite number",
    "duplicate": "coincide at",
    "tags-of-the-wrong-kind": "boundary groups found: none; the scene also needs tool, plate",
    "no-groups": "boundary groups found: none; the scene also needs tool, plate",
    "empty-groups": "boundary groups found: none; the scene also needs tool, plate",
    "cells-beyond-the-points": "a triangle has the point 1035, and there are 61 points, from 0 on: the file is damaged",
    "cells-below-zero": "a triangle has the point -2, and there are 61 points",
    "lines-beyond-the-points": "the set 'tool' has the point 1000, and there are 61 points",
    "same-name-for-a-surface": "'plate' names a set of dimension 2, and hides a curve that shares its name: give",
    "groups-of-fractions": "the set 'tool' has the point 0.5, and there are 61 points",
    "groups-beyond-the-points": "the set 'tool' has the point 1000000, and there are 61 points",
    "groups-of-words": "the set 'tool' has the point 'a', and there are 61 points",
    "sets-of-cells-beyond": "the set of lines 'tool' has the line 999, and there are 31 lines",
    "tags-of-words": "boundary groups found: none",
}


@pytest.mark.parametrize(("name", "sentence"), SENTENCES.items())
def test_what_cannot_be_read_is_refused_in_one_sentence(
    name: str, sentence: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(SolveError) as ending:
        mesh_of(name, monkeypatch, tmp_path).cloud(NAMES)
    assert ending.value.status is Status.BAD_CLOUD
    assert sentence in ending.value.detail
    assert "\n" not in ending.value.detail


@pytest.mark.parametrize("name", FIELD_DATA)
def test_field_data_of_vtu_is_no_obstacle(name: str, tmp_path: Path) -> None:
    """A time, which VTU files hold as field data, is neither a group nor a crash."""
    path = vtu_with(FIELD_DATA[name], tmp_path / "annulus.vtu")
    if "groups" in name or name in ("two-times", "many"):
        cloud = NodeFile(path=str(path)).cloud(NAMES)
        assert [len(cloud.boundaries[group]) for group in NAMES] == [6, 25]
    else:
        with pytest.raises(SolveError, match=r"the scene also needs|hides a curve|meshio cannot read"):
            NodeFile(path=str(path)).cloud(NAMES)


TEXTS = {
    "bytes": "byte 128 is no text in UTF-8: save the table as CSV in UTF-8",
    "utf-16": "byte 0 is no text in UTF-8",
    "latin-1": "byte 17 is no text in UTF-8",
    "long-field": "field larger than field limit",
    "open-quote": "boundary groups found: tool 6,0,plate; the scene also needs tool, plate",
    "semicolons": "line 1: the header is 'x;y;group'; it must be 'x,y,group'",
    "too-large": "node 2 has a coordinate that is not a finite number",
}


@pytest.mark.parametrize(("name", "sentence"), TEXTS.items())
def test_a_damaged_table_is_refused_in_one_sentence(name: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.csv"
    path.write_bytes(CSV[name])
    with pytest.raises(SolveError) as ending:
        NodeFile(path=str(path)).cloud(NAMES)
    assert sentence in ending.value.detail
    assert "\n" not in ending.value.detail
    assert len(ending.value.detail) < 300


def test_a_long_line_is_cut_in_the_sentence(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    path.write_text("x,y,group\n" + "7," * 500)
    with pytest.raises(SolveError, match="…' has 501 values"):
        NodeFile(path=str(path)).cloud(())


# Clouds with nothing inside.


@pytest.mark.parametrize(
    "nodes",
    [Rings(spacing=4.5), Rings(spacing=100.0), GradedRings(first=4.5, spacing=4.5)],
)
@pytest.mark.parametrize("discretizer", ["mls", "delaunay"])
def test_a_cloud_without_inner_nodes_is_refused_in_one_sentence(nodes: Rings, discretizer: str) -> None:
    parts = {"discretizer": LinearTriangles()} if discretizer == "delaunay" else {}
    row = run_case(setup(StirringTool(nodes=nodes), **parts)).summary
    assert row["status"] == Status.BAD_CLOUD.word
    assert "nodes lie on the boundary and none inside, so that nothing is left to solve for" in row["message"]
    assert "choose a finer spacing" in row["message"]


@pytest.mark.parametrize(
    "scene", [StirringTool(nodes=Scattered(first=4.5, spacing=4.5)), Channel(spacing=5.0, nodes="scattered")]
)
def test_walls_without_room_between_them_are_refused(scene: FlowScene) -> None:
    row = run_case(setup(scene)).summary
    assert row["status"] == Status.BAD_CLOUD.word
    assert "the walls leave no room for nodes between them: make the spacing smaller" in row["message"]


def test_diagnostics_of_a_cloud_without_inner_nodes_are_that_sentence() -> None:
    simulation = simulation_of(setup(StirringTool(nodes=Rings(spacing=4.5))), Ledger().entry)
    with pytest.raises(SolveError, match="none inside"):
        simulation.diagnostics()


def test_a_cloud_without_nodes_is_refused() -> None:
    with pytest.raises(SolveError, match="there are no nodes"):
        Cloud(np.zeros((0, 2)), {})
