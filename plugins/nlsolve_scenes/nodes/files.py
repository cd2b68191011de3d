"""Nodes and boundary groups from a file: CSV, or a mesh of any format that meshio reads."""

from __future__ import annotations

import csv
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from nlsolve.plugin import Cloud, InputFile, SolveError, Status

try:
    import meshio
except ImportError:  # an extra: nlsolve[mesh]
    meshio = None

HEADER = ["x", "y", "group"]
FLAT = 1e-9  # largest extent of a mesh in z, as a fraction of its extent in x and y


class NodeFile(BaseModel):
    """Nodes [mm] and boundary groups read from a file.

    CSV : the header x,y,group, then one line for each node; group is empty for an interior node.
    mesh: points used by its triangles or quadrilaterals; groups are point sets, or named sets of its lines (Gmsh:
          "physical curves").
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["file"] = "file"
    path: InputFile = Field(
        description="file name, relative to the folder the study is run in: .csv, .msh, .inp, .vtu, …"
    )

    def cloud(self, needed: tuple[str, ...]) -> Cloud:
        """The nodes with the groups `needed`; nodes of other groups become interior nodes.

        Raises SolveError (bad cloud) in one sentence when the file is missing, malformed or lacks a group.
        """
        path = Path(self.path)
        if not path.is_file():
            raise _bad(f"{path}: there is no such file of nodes")
        nodes, groups = _from_csv(path) if path.suffix.lower() == ".csv" else _from_mesh(path)
        found = ", ".join(sorted(groups)) or "none"
        if missing := [name for name in needed if not len(groups.get(name, ()))]:
            raise _bad(f"{path}: boundary groups found: {found}; the scene also needs {', '.join(missing)}")
        return Cloud(nodes, {name: groups[name] for name in needed})


def _bad(sentence: str) -> SolveError:
    return SolveError(Status.BAD_CLOUD, sentence)


def _from_csv(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Nodes (N, 2) and groups of a CSV file."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        lines = csv.reader(file)
        header = [name.strip() for name in next(lines, [])]
        if header != HEADER:
            raise _bad(f"{path}, line 1: the header is {','.join(header)!r}; it must be {','.join(HEADER)!r}")
        rows = [_row(path, lines.line_num, values) for values in lines if values]
    names = np.array([name for _, _, name in rows], dtype=str)
    nodes = np.array([place for *place, _ in rows], dtype=float).reshape(-1, 2)
    return nodes, {str(name): np.flatnonzero(names == name) for name in np.unique(names) if name}


def _row(path: Path, line: int, values: list[str]) -> tuple[float, float, str]:
    if len(values) != len(HEADER):
        raise _bad(f"{path}, line {line}: {','.join(values)!r} has {len(values)} values; x,y,group are needed")
    place = []
    for name, value in zip("xy", values, strict=False):
        try:
            place.append(float(value))
        except ValueError as error:
            raise _bad(f"{path}, line {line}: {name} = {value!r} is not a number") from error
    return place[0], place[1], values[2].strip()


def _from_mesh(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Nodes (N, 2) and groups of a mesh: the points of its faces, or all of them where it has none."""
    if meshio is None:
        raise _bad(f"reading {path} needs meshio: pip install 'nlsolve[mesh]'")
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):  # meshio prints the reason, then exits
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = " ".join(said.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise _bad(f"{path}: meshio cannot read it: {reason}") from error
    extent = np.ptp(mesh.points, axis=0)
    if len(extent) > 2 and extent[2] > FLAT * extent[:2].max():
        raise _bad(f"{path}: its points span {extent[2]:.6g} mm in z; nodes lie in a plane of constant z")
    faces = [block.data.ravel() for block in mesh.cells if block.type.startswith(("triangle", "quad", "polygon"))]
    used = np.unique(np.concatenate(faces)) if faces else np.arange(len(mesh.points))
    groups = {name: np.searchsorted(used, np.intersect1d(used, members)) for name, members in _groups(mesh).items()}
    return mesh.points[used, :2], groups


def _groups(mesh: Any) -> dict[str, np.ndarray]:
    """Points of each named set: of points, of lines, of lines with the tag of a physical name (field_data)."""
    groups: dict[str, list[np.ndarray]] = {name: [np.asarray(points)] for name, points in mesh.point_sets.items()}
    for number, block in enumerate(mesh.cells):
        if not block.type.startswith("line"):
            continue
        for name, sets in mesh.cell_sets.items():
            if sets[number] is not None and not name.startswith("gmsh:"):
                groups.setdefault(name, []).append(block.data[sets[number]].ravel())
        for name, (tag, dimension) in mesh.field_data.items():
            tags = mesh.cell_data.get("gmsh:physical")
            if dimension == 1 and tags is not None:
                groups.setdefault(name, []).append(block.data[tags[number] == tag].ravel())
    return {name: np.unique(np.concatenate(points).astype(int)) for name, points in groups.items()}
