"""Fields for other programs: VTK files by meshio, and data sets of xarray. Both libraries are extras."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import FIELDS
from nlsolve.results.states.triangles import Material

if TYPE_CHECKING:
    import xarray

VTK = (".vtu", ".vtk")
TENSORS = {"strain_rate": ("exx", "eyy", "exy"), "stress": ("sxx", "syy", "sxy")}
SCALARS = ("rate", "viscosity", "pressure")
FIXED = ("boundary", "x0", "y0")
"""Columns of `fields` that a node keeps."""


def library(name: str, extra: str, caller: str) -> Any:
    """An optional library. Raises StudyError, which tells how to get it, where it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise StudyError(f"{caller} needs the library {name}: pip install 'nlsolve[{extra}]'") from error


def write_vtk(path: Path, rows: pd.DataFrame) -> None:
    """Write the nodes of a flow at one time with the triangles of the material: velocity (three components), strain
    rate and viscous stress (xx, yy, xy), equivalent rate, viscosity and pressure.

    Raises StudyError without meshio, and for a file that is not called .vtu or .vtk.
    """
    meshio = library("meshio", "mesh", "to_vtk")
    if path.suffix not in VTK:
        raise StudyError(f"{path}: to_vtk writes files called {' or '.join(VTK)}")
    material = Material(rows)
    nothing = np.zeros(len(rows))
    data = {"velocity": np.stack([rows["u"], rows["v"], nothing], axis=1)}
    data |= {name: rows[list(columns)].to_numpy(float) for name, columns in TENSORS.items()}
    data |= {name: rows[name].to_numpy(float) for name in SCALARS}
    points = np.column_stack([material.nodes, nothing])
    meshio.Mesh(points, [("triangle", material.corners)], point_data=data).write(path)


def dataset(rows: pd.DataFrame) -> xarray.Dataset:
    """The fields of one flow by time and node, or the state of a system by unknown, with units and meanings.

    Raises StudyError without xarray.
    """
    library("xarray", "xarray", "to_xarray")
    if "unknown" in rows and rows["unknown"].notna().any():
        frame = rows[["unknown", "value"]].astype({"unknown": int}).set_index("unknown")
    else:
        frame = rows.drop(columns=["case", "unknown", "value"], errors="ignore").set_index(["time", "node"])
    found: xarray.Dataset = frame.to_xarray()
    for kept in FIXED:
        if kept in found:
            found[kept] = found[kept].isel(time=-1, drop=True)
    found = found.set_coords([name for name in ("x", "y", *FIXED) if name in found])
    for name in found.variables:
        column = FIELDS[str(name)]
        found[name].attrs = {"long_name": column.meaning} | ({"units": column.unit} if column.unit else {})
    return found
