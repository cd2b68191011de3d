"""Nodes and boundary groups from a file: CSV, or a mesh of any format that meshio reads."""

from __future__ import annotations

import csv
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from nlsolve.plugin import Cloud, InputFile, SolveError, Status

HEADER = ["x", "y", "group"]
LONGEST = 60  # characters of a wrong line that a sentence repeats
CURVE = 1  # dimension of a curve in Gmsh
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
        nodes, groups = _from_csv(path) if path.suffix.lower() == ".csv" else _from_mesh(path, needed)
        found = ", ".join(sorted(" ".join(name.split()) for name, members in groups.items() if len(members))) or "none"
        if missing := [name for name in needed if not len(groups.get(name, ()))]:
            raise _bad(f"{path}: boundary groups found: {found}; the scene also needs {', '.join(missing)}")
        return Cloud(nodes, {name: groups[name] for name in needed})


def _bad(sentence: str) -> SolveError:
    return SolveError(Status.BAD_CLOUD, sentence)


def _from_csv(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Nodes (N, 2) and groups of a CSV file."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file)
            header = [name.strip() for name in next(lines, [])]
            if header != HEADER:
                raise _bad(f"{path}, line 1: the header is {_short(header)!r}; it must be {','.join(HEADER)!r}")
            rows = [_row(path, lines.line_num, values) for values in lines if values]
    except UnicodeDecodeError as error:
        raise _bad(f"{path}: byte {error.start} is no text in UTF-8: save the table as CSV in UTF-8") from error
    except csv.Error as error:
        raise _bad(f"{path}, line {lines.line_num}: {error}; x,y,group are needed") from error
    names = np.array([name for _, _, name in rows], dtype=str)
    nodes = np.array([place for *place, _ in rows], dtype=float).reshape(-1, 2)
    return nodes, {str(name): np.flatnonzero(names == name) for name in np.unique(names) if name}


def _short(values: list[str]) -> str:
    """The values of a line as they were written, or the beginning of a long line."""
    text = ",".join(values)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def _row(path: Path, line: int, values: list[str]) -> tuple[float, float, str]:
    if len(values) != len(HEADER):
        raise _bad(f"{path}, line {line}: {_short(values)!r} has {len(values)} values; x,y,group are needed")
    place = []
    for name, value in zip("xy", values, strict=False):
        try:
            place.append(float(value))
        except ValueError as error:
            raise _bad(f"{path}, line {line}: {name} = {value!r} is not a number") from error
    return place[0], place[1], values[2].strip()


def _from_mesh(path: Path, needed: tuple[str, ...]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Nodes (N, 2) and groups of a mesh: the points of its faces, or all of them where it has none."""
    if find_spec("meshio") is None:  # an extra: nlsolve[mesh]
        raise _bad(f"reading {path} needs meshio: pip install 'nlsolve[mesh]'")
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):  # meshio prints the reason, then exits
            mesh = import_module("meshio").read(path)  # not imported above: few studies read a mesh
    except (Exception, SystemExit) as error:
        reason = " ".join(said.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise _bad(f"{path}: meshio cannot read it: {reason}") from error
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] < 2 or not len(points):
        raise _bad(f"{path}: its points have the shape {points.shape}; (N, 2) or (N, 3) with N > 0 is needed")
    extent = np.ptp(points, axis=0)
    if len(extent) > 2 and extent[2] > FLAT * extent[:2].max():
        raise _bad(f"{path}: its points span {extent[2]:.6g} mm in z; nodes lie in a plane of constant z")
    faces = [
        _indices(f"{path}: a {block.type}", block.data, len(points))
        for block in mesh.cells
        if block.type.startswith(("triangle", "quad", "polygon"))
    ]
    corners = np.unique(np.concatenate([np.zeros(0, dtype=int), *faces]))
    used = corners if len(corners) else np.arange(len(points))
    groups = {
        name: np.searchsorted(used, np.intersect1d(used, _indices(f"{path}: the set {name!r}", members, len(points))))
        for name, members in _groups(path, mesh).items()
    }
    for name, (_, dimension) in _physical_names(mesh).items():
        if name in needed and dimension > CURVE and not len(groups.get(name, ())):
            raise _bad(
                f"{path}: {name!r} names a set of dimension {dimension:g}, and hides a curve that shares its name: "
                "give the curve a name of its own"
            )
    return points[used, :2], groups


def _indices(name: str, members: Any, count: int, of: str = "point") -> np.ndarray:
    """The numbers of points (or lines) that a file gives, or the numbers in a mask of all of them.

    Raises SolveError (bad cloud), which begins with `name`, where one is not among the `count` that there are.
    """
    numbers = np.asarray(members)
    if not numbers.size:
        return np.zeros(0, dtype=int)
    if numbers.dtype == bool and numbers.shape == (count,):
        return np.flatnonzero(numbers)
    if numbers.dtype.kind not in "iuf" or not np.isin(numbers, np.arange(count)).all():
        strange = [number for number in numbers.ravel().tolist() if number not in range(count)]
        told = strange[0] if strange else numbers.ravel()[0]
        raise _bad(f"{name} has the {of} {told!r}, and there are {count} {of}s, from 0 on: the file is damaged")
    return numbers.ravel().astype(int)


def _groups(path: Path, mesh: Any) -> dict[str, np.ndarray]:
    """Points of each named set: of points, of lines, of lines with the tag of a physical name (field_data)."""
    groups: dict[str, list[np.ndarray]] = {name: [np.asarray(points)] for name, points in mesh.point_sets.items()}
    curves = {name: tag for name, (tag, dimension) in _physical_names(mesh).items() if dimension == CURVE}
    for number, block in enumerate(mesh.cells):
        if not block.type.startswith("line"):
            continue
        for name, sets in mesh.cell_sets.items():
            if sets[number] is not None and not name.startswith("gmsh:"):
                chosen = _indices(f"{path}: the set of lines {name!r}", sets[number], len(block.data), "line")
                groups.setdefault(name, []).append(block.data[chosen].ravel())
        tags = np.asarray(mesh.cell_data["gmsh:physical"][number]) if "gmsh:physical" in mesh.cell_data else None
        if tags is not None and tags.shape == (len(block.data),):
            for name, tag in curves.items():
                groups.setdefault(name, []).append(block.data[tags == tag].ravel())
    return {name: points[0] if len(points) == 1 else np.concatenate(points) for name, points in groups.items()}


def _physical_names(mesh: Any) -> dict[str, tuple[float, float]]:
    """Tag and dimension of the physical names of Gmsh. They are field data, which in other formats holds values of any
    shape, such as a time; a name has one tag only.
    """
    pairs = {name: np.asarray(value) for name, value in mesh.field_data.items()}
    return {
        name: (float(pair[0]), float(pair[1]))
        for name, pair in pairs.items()
        if pair.shape == (2,) and pair.dtype.kind in "iuf"
    }
