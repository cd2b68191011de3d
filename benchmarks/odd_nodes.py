"""Files of nodes of the annulus 1.5 ≤ r ≤ 6 mm, sound and damaged, in every format that is read: what the fuzz reads.

Four families: meshes that are odd in themselves (blocks without cells, lines only, coordinates that are no numbers,
names shared by two sets, …), each in several formats; a sound mesh in all formats that meshio writes; any of these
files cut off, or with bytes or lines of it changed; and tables of text with every mistake of a hand.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

import meshio
import numpy as np
from nlsolve_scenes.nodes.rings import Rings
from scipy.spatial import Delaunay

SPACING = 1.5
TOOL, PLATE = 1, 2
CUTS = (0.0, 0.02, 0.3, 0.6, 0.9, 0.97, 0.995)
CHANGES = 4  # files with random changes that are made of each file
OPTIONS: Mapping[str, dict[str, Any]] = {
    "-2.2.msh": {"file_format": "gmsh22", "binary": False},
    "-2.2-binary.msh": {"file_format": "gmsh22", "binary": True},
    "-4.0.msh": {"file_format": "gmsh40", "binary": False},
    "-4.1.msh": {"file_format": "gmsh", "binary": False},
    "-4.1-binary.msh": {"file_format": "gmsh", "binary": True},
    "-text.vtu": {"binary": False},
}
FORMATS = (".vtu", ".vtk", ".inp", ".mesh", "-2.2.msh", "-4.1.msh")
ALL_FORMATS = (  # .ele and .wkt are left out: meshio takes for ever to read some of them, which ends at the limit
    *(
        [
            ".vtu",
            "-text.vtu",
            ".vtk",
            ".inp",
            ".mesh",
            ".meshb",
            ".avs",
            ".xml",
            ".f3grid",
            ".mdpa",
            ".bdf",
            ".vol",
            ".obj",
            ".off",
            ".post",
            ".ply",
            ".stl",
            ".su2",
        ]
    ),
    *([".dat", ".ugrid", ".xdmf", ".e", ".cgns", ".h5m", ".hmf", ".med"]),
    *(ending for ending in OPTIONS if ending.endswith(".msh")),
)
UNWRITABLE = (
    *(meshio.WriteError, meshio.ReadError, KeyError, ValueError, TypeError, IndexError, AttributeError),
    *(AssertionError, ImportError, NotImplementedError),
)
"""What meshio raises where a format cannot hold a mesh, or its library is not installed."""


def annulus() -> meshio.Mesh:
    """Triangles and wall lines, the lines with the tags and the names of their groups in every way meshio knows."""
    cloud = Rings(spacing=SPACING).cloud(1.5, 6.0)
    nodes = cloud.nodes
    faces = Delaunay(nodes).simplices
    faces = faces[np.hypot(*nodes[faces].mean(axis=1).T) > 1.5]
    lines = {name: np.stack([group, np.roll(group, -1)], axis=1) for name, group in cloud.boundaries.items()}
    tool, plate = lines["tool"], lines["plate"]
    tags = [np.repeat([TOOL, PLATE], [len(tool), len(plate)]), np.full(len(faces), 3)]
    return meshio.Mesh(
        np.column_stack([nodes, np.zeros(len(nodes))]),
        [("line", np.concatenate([tool, plate])), ("triangle", faces)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": [tag.copy() for tag in tags]},
        field_data={"tool": np.array([TOOL, 1]), "plate": np.array([PLATE, 1])},
        point_sets={name: group.copy() for name, group in cloud.boundaries.items()},
    )


def _points(change: Callable[[np.ndarray], Any]) -> Callable[[meshio.Mesh], None]:
    def changed(mesh: meshio.Mesh) -> None:
        points = mesh.points.copy()
        found = change(points)
        mesh.points = points if found is None else found

    return changed


def _at(index: Any, value: float) -> Callable[[np.ndarray], None]:
    def changed(points: np.ndarray) -> None:
        points[index] = value

    return changed


def _cells(blocks: Callable[[meshio.Mesh], list[tuple[str, Any]]]) -> Callable[[meshio.Mesh], None]:
    def changed(mesh: meshio.Mesh) -> None:
        mesh.cells = [meshio.CellBlock(kind, np.asarray(data)) for kind, data in blocks(mesh)]
        mesh.cell_data = {}

    return changed


def _with(**changes: Any) -> Callable[[meshio.Mesh], None]:
    def changed(mesh: meshio.Mesh) -> None:
        for name, value in changes.items():
            setattr(mesh, name, value(mesh) if callable(value) else value)

    return changed


def _lines(mesh: meshio.Mesh) -> Any:
    return mesh.cells[0].data


def _faces(mesh: meshio.Mesh) -> Any:
    return mesh.cells[1].data


ODD: Mapping[str, Callable[[meshio.Mesh], None]] = {
    "sound": lambda mesh: None,
    "no-points": _with(points=np.zeros((0, 3)), cells=[], cell_data={}, point_sets={}),
    "one-point": _with(points=np.ones((1, 3)), cells=[], cell_data={}, point_sets={"tool": [0], "plate": [0]}),
    "flat-points": _points(lambda points: points[:, :2]),
    "points-on-a-line": _points(_at((slice(None), 1), 0.0)),
    "all-points-alike": _points(_at(slice(None), 1.0)),
    "nan": _points(_at((20, 0), np.nan)),
    "nan-in-z": _points(_at((20, 2), np.nan)),
    "infinite": _points(_at((3, 1), np.inf)),
    "huge": _points(_at((20, 0), 1e308)),
    "tilted": _points(_at((slice(None, 9), 2), 1.0)),
    "raised": _points(_at((slice(None), 2), 7.0)),
    "duplicate": _points(lambda points: points.__setitem__(20, points[21])),
    "points-on-one-axis": _points(lambda points: points[:, :1]),
    "metres": _points(lambda points: 1e-3 * points),
    "single-precision": _points(lambda points: points.astype(np.float32)),
    "integers": _points(lambda points: np.round(points).astype(int)),
    "no-cells": _with(cells=[], cell_data={}),
    "empty-blocks": _cells(
        lambda mesh: [
            ("line", np.zeros((0, 2), int)),
            ("line", _lines(mesh)),
            ("triangle", np.zeros((0, 3), int)),
            ("triangle", _faces(mesh)),
        ]
    ),
    "empty-triangles": _cells(lambda mesh: [("line", _lines(mesh)), ("triangle", np.zeros((0, 3), int))]),
    "lines-only": _cells(lambda mesh: [("line", _lines(mesh))]),
    "vertices-only": _cells(lambda mesh: [("vertex", np.arange(len(mesh.points))[:, None])]),
    "triangles-only": _cells(lambda mesh: [("triangle", _faces(mesh))]),
    "orphans": _points(lambda points: np.concatenate([points, [[1e6, 1e6, 0.0]]])),
    "quads": _cells(lambda mesh: [("line", _lines(mesh)), ("quad", _faces(mesh)[:, [0, 1, 2, 2]])]),
    "polygons": _cells(lambda mesh: [("line", _lines(mesh)), ("polygon", _faces(mesh))]),
    "second-order": _cells(
        lambda mesh: [("line3", _lines(mesh)[:, [0, 1, 0]]), ("triangle6", np.tile(_faces(mesh), 2))]
    ),
    "solids": _cells(lambda mesh: [("line", _lines(mesh)), ("tetra", _faces(mesh)[:, [0, 1, 2, 2]])]),
    "cells-beyond-the-points": _cells(lambda mesh: [("line", _lines(mesh)), ("triangle", _faces(mesh) + 1000)]),
    "cells-below-zero": _cells(lambda mesh: [("line", _lines(mesh)), ("triangle", _faces(mesh) - 5)]),
    "lines-beyond-the-points": _with(
        cells=lambda mesh: [meshio.CellBlock("line", _lines(mesh) + 1000), mesh.cells[1]], point_sets={}
    ),
    "field-time": _with(field_data={"TIME": np.array([0.5])}),
    "field-scalar": _with(field_data={"TIME": 0.5, "tool": np.array([TOOL, 1]), "plate": np.array([PLATE, 1])}),
    "field-many": _with(field_data={"a": np.arange(5), "tool": np.array([TOOL, 1]), "plate": np.array([PLATE, 1])}),
    "field-matrix": _with(field_data={"a": np.eye(3), "b": np.zeros((0,))}),
    "field-words": _with(field_data={"a": np.array(["x", "y"])}),
    "field-fractions": _with(field_data={"tool": np.array([1.0, 1.0]), "plate": np.array([np.nan, 1.0])}),
    "same-name-for-a-surface": _with(
        field_data={"plate": np.array([3, 2]), "tool": np.array([TOOL, 1])}, point_sets={}
    ),
    "tags-of-the-wrong-kind": _with(cell_data=lambda mesh: {"gmsh:physical": [np.eye(2), np.zeros(1)]}, point_sets={}),
    "tags-of-words": _with(
        cell_data=lambda mesh: {"gmsh:physical": [np.full(len(block.data), "a") for block in mesh.cells]}, point_sets={}
    ),
    "no-groups": _with(point_sets={}, field_data={}, cell_data={}),
    "empty-groups": _with(point_sets={"tool": np.zeros(0, int), "plate": np.zeros(0)}, field_data={}),
    "groups-of-fractions": _with(point_sets={"tool": np.arange(4) + 0.5, "plate": np.array([50.0, np.nan])}),
    "groups-beyond-the-points": _with(point_sets={"tool": np.array([0, 10**6]), "plate": np.array([-3, 60])}),
    "groups-as-masks": _with(
        point_sets=lambda mesh: {
            "tool": np.hypot(*mesh.points[:, :2].T) < 1.6,
            "plate": np.zeros(len(mesh.points), bool),
        }
    ),
    "groups-as-masks-and-numbers": _with(
        point_sets=lambda mesh: {"tool": np.hypot(*mesh.points[:, :2].T) < 1.6, "plate": np.arange(36.0, 61.0)},
        field_data={},
    ),
    "empty-groups-and-tags": _with(point_sets={"tool": np.zeros(0), "plate": np.zeros(0, int)}),
    "same-name-for-a-surface-and-points": _with(field_data={"plate": np.array([3, 2])}),
    "groups-of-words": _with(point_sets={"tool": np.array(["a"]), "plate": np.array(["b"])}),
    "groups-that-overlap": _with(
        point_sets=lambda mesh: {name: np.arange(len(mesh.points)) for name in ("tool", "plate")}
    ),
    "sets-of-cells": _with(
        **{name: {} for name in ("point_sets", "field_data", "cell_data")},
        cell_sets={"tool": [np.arange(6), []], "plate": [np.arange(6, 31), []]},
    ),
    "sets-of-cells-beyond": _with(
        point_sets={}, field_data={}, cell_data={}, cell_sets={"tool": [np.array([999]), None], "plate": [None, None]}
    ),
}  # fmt: skip


def _arrays(**values: str) -> bytes:
    """Arrays of the field data of a VTU file; a name may be followed by the type of its values."""
    arrays = [
        f'<DataArray type="{name.partition("_")[2] or "Float64"}" Name="{name.partition("_")[0]}" '
        f'NumberOfTuples="{len(text.split())}" format="ascii">\n{text}\n</DataArray>\n'
        for name, text in values.items()
    ]
    return f"<FieldData>\n{''.join(arrays)}</FieldData>\n".encode()


GROUPS = {"tool_Int64": "1 1", "plate_Int64": "2 1"}
FIELD_DATA: Mapping[str, bytes] = {
    "groups": _arrays(**GROUPS),
    "time": _arrays(TimeValue="0.5"),
    "time-and-groups": _arrays(TimeValue="0.5", **GROUPS),
    "two-times": _arrays(TimeValue="0.5 1.0", **GROUPS),
    "many": _arrays(a="1 2 3 4 5 6", b="", **GROUPS),
    "fractions": _arrays(tool="1.0 1.0", plate="2.5 1"),
    "not-numbers": _arrays(tool="nan nan", plate="inf 1"),
    "words": _arrays(tool_Int64="one one"),
    "of-surfaces": _arrays(tool_Int64="1 1", plate_Int64="2 2"),
}
CSV: Mapping[str, bytes] = {
    "empty": b"",
    "blank": b"\n\n\n",
    "bytes": bytes(range(256)),
    "header": b"x,y,group\n",
    "other-header": b"a,b\n1,2\n",
    "mark": b"\xef\xbb\xbfx,y,group\r\n1.5,0,tool\r\n6,0,plate\r\n3,0,\r\n",
    "utf-16": "x,y,group\n1.5,0,tool\n".encode("utf-16"),
    "latin-1": b"x,y,group\n1.5,0,t\xf6ol\n",
    "zero-byte": b"x,y,group\n1.5,0,to\x00ol\n",
    "old-line-ends": b"x,y,group\r1.5,0,tool\r6,0,plate\r3,0,\r",
    "one-node": b"x,y,group\n1.5,0,tool\n",
    "two-nodes": b"x,y,group\n1.5,0,tool\n6,0,plate\n",
    "three-nodes": b"x,y,group\n1.5,0,tool\n6,0,plate\n3,0,\n",
    "all-on-walls": b"x,y,group\n1.5,0,tool\n-1.5,0,tool\n0,1.5,tool\n6,0,plate\n-6,0,plate\n0,-6,plate\n",
    "nan": b"x,y,group\n1.5,0,tool\n6,0,plate\nnan,0,\n",
    "too-large": b"x,y,group\n1.5,0,tool\n6,0,plate\n1e999,0,\n",
    "word": b"x,y,group\n1.5,0,tool\n6,zero,plate\n",
    "too-few": b"x,y,group\n1.5,0\n",
    "too-many": b"x,y,group\n1.5,0,tool,1\n",
    "open-quote": b'x,y,group\n1.5,0,"tool\n6,0,plate\n',
    "long-field": b"x,y,group\n1.5,0," + b"t" * 200_000 + b"\n",
    "underscore": b"x,y,group\n1_5,0,tool\n6,0,plate\n3,0,\n",
    "semicolons": b"x;y;group\n1,5;0;tool\n",
    "coincident": b"x,y,group\n1.5,0,tool\n6,0,plate\n3,0,\n3,0,\n",
    "on-one-line": b"x,y,group\n1.5,0,tool\n6,0,plate\n" + b"".join(b"%.3f,0,\n" % (1.6 + 0.1 * i) for i in range(40)),
}


def odd_files(folder: Path) -> Iterator[Path]:
    """Write all files to the folder; yields their paths."""
    random, sound = Random(0), list[Path]()
    for name, change in ODD.items():
        for ending in ALL_FORMATS if name == "sound" else FORMATS:
            mesh = annulus()
            change(mesh)
            path = folder / f"{name}{ending}"
            if _written(mesh, path, OPTIONS.get(ending, {})):
                yield path
                if name == "sound":
                    sound.append(path)
    for name, data in FIELD_DATA.items():
        yield vtu_with(data, folder / f"field-data-{name}.vtu")
    for name, text in CSV.items():
        path = folder / f"{name}.csv"
        path.write_bytes(text)
        yield path
    for path in sound:
        content = path.read_bytes()
        for number, changed in enumerate(_damaged(content, random)):
            damaged = folder / f"damaged-{number}-{path.name}"
            damaged.write_bytes(changed)
            yield damaged


def vtu_with(field_data: bytes, path: Path) -> Path:
    """Write the sound mesh with this field data, which meshio does not write."""
    annulus().write(path, binary=False)
    path.write_bytes(path.read_bytes().replace(b"<Piece", field_data + b"<Piece", 1))
    return path


def _written(mesh: meshio.Mesh, path: Path, options: Mapping[str, Any]) -> bool:
    """Whether meshio has written a mesh; what it prints is of no interest."""
    with contextlib.redirect_stdout(StringIO()), contextlib.redirect_stderr(StringIO()):
        try:
            mesh.write(path, **options)
        except UNWRITABLE:
            return False
    return path.is_file()


def _damaged(content: bytes, random: Random) -> Iterator[bytes]:
    """The content cut off, without some lines, with some lines doubled, and with some bytes changed."""
    for part in CUTS:
        yield content[: int(part * len(content))]
    for _ in range(CHANGES):
        lines = content.splitlines(keepends=True)
        del lines[random.randrange(len(lines))]
        yield b"".join(lines)
        lines = content.splitlines(keepends=True)
        number = random.randrange(len(lines))
        yield b"".join([*lines[:number], lines[number], *lines[number:]])
        changed = bytearray(content)
        for _ in range(5):
            changed[random.randrange(len(changed))] = random.randrange(256)
        yield bytes(changed)
        yield (
            b"".join(lines).replace(b"0", b"nan", 1)
            if random.random() < 0.5
            else b"".join(lines).replace(b"1", b"-7", 3)
        )
