"""The fields of one case at one recorded time, at its nodes and at any points, and the state of a system."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.states.triangles import Material
from nlsolve.series import Array

NO_VALUES = ("case", "time", "node", "boundary", "x", "y", "unknown", "value")
"""Columns of `fields` that are not interpolated."""

NEAR = 1e-6
"""How far a recorded time may be from the one asked for, as a part of the last."""


def case_among(runs: pd.DataFrame, case: str | int) -> str:
    """The identity of a case that is given by it, or by its row in `runs`, from 0. Raises StudyError for neither."""
    ids = [str(known) for known in runs["case"]]
    if isinstance(case, str):
        if case not in ids:
            raise StudyError(f"case = {case!r}: no such case in these results; {did_you_mean(case, ids)}")
        return case
    if not -len(ids) <= case < len(ids):
        raise StudyError(f"case = {case}: there are {len(ids)} rows in `runs`, from 0 to {len(ids) - 1}")
    return ids[case]


def snapshot(fields: pd.DataFrame, case: str, time: float | None = None) -> pd.DataFrame:
    """The rows of a flow's nodes at a recorded time [s]; absent: the last. Raises StudyError where there are none."""
    rows = _rows(fields, case)
    rows = rows.dropna(subset="time") if "time" in rows else rows.iloc[:0]
    if rows.empty:
        raise StudyError(f"case {case}: it is a system, whose state has no places: ask for results.state({case!r})")
    times = rows["time"].unique()
    chosen = times.max() if time is None else times[np.abs(times - time).argmin()]
    if time is not None and abs(chosen - time) > NEAR * max(times.max(), abs(time)):
        there = ", ".join(f"{moment:.6g}" for moment in np.sort(times))
        raise StudyError(
            f"case {case}: time = {time:g}: fields were recorded at t = {there} s; choose one of them, or run the "
            f"study with record = {{ times = [{time:g}] }}"
        )
    return rows[rows["time"] == chosen].reset_index(drop=True)


def values_at(rows: pd.DataFrame, points: ArrayLike) -> pd.DataFrame:
    """The nodal values at points (P, 2) [mm], one row each, by the linear interpolant on the triangles of the nodes;
    NaN for a point outside of them. Raises StudyError for points of another shape.
    """
    places = np.asarray(points, dtype=float)
    if places.ndim == 1 and places.shape == (2,):
        places = places[None]
    if places.ndim != 2 or places.shape[1] != 2:
        raise StudyError(f"points of shape {places.shape}: should be of shape (P, 2), a row (x, y) for each point")
    weights, corners = Material(rows).interpolant(places)
    columns = {"x": places[:, 0], "y": places[:, 1]}
    for name in rows.columns:
        if name not in NO_VALUES:
            columns[name] = (weights * rows[name].to_numpy(float)[corners]).sum(axis=1)
    return pd.DataFrame(columns)


def state_of(fields: pd.DataFrame, case: str) -> Array:
    """u (U,), the state that the solve of a system ended at; of a flow the velocities (N, 2) of its nodes at the last
    recorded time [mm/s]. Raises StudyError where the case left none.
    """
    rows = _rows(fields, case)
    if "unknown" in rows and rows["unknown"].notna().any():
        return rows["value"].to_numpy(float)
    return snapshot(fields, case)[["u", "v"]].to_numpy(float)


def _rows(fields: pd.DataFrame, case: str) -> pd.DataFrame:
    rows = fields[fields["case"] == case]
    if rows.empty:
        raise StudyError(f"case {case}: it has left no state; its status and message in `runs` tell why")
    return rows
