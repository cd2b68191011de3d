"""A nodal value along a straight line, beside the exact one."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve.results.columns import FIELDS
from nlsolve.results.frames import Frames
from nlsolve.series import Array
from nlsolve.show import plotting
from nlsolve.show.figures.cases import plain
from nlsolve.show.figures.nodes.panels import NodesFigure, snapshots_of
from nlsolve.show.figures.nodes.sections import NodalValue, slice_triangles, triangulate
from nlsolve.show.figures.style import axis_label, curve_style, finish, join

EXACT: Any = {
    "color": "black",
    "linestyle": (0, (4, 3)),
    "linewidth": 0.6,
    "marker": "+",
    "markersize": 4,
    "markeredgewidth": 0.6,
    "markevery": 0.06,
    "zorder": 3,
}
"""The exact solution, told by its crosses from the curves, which have none."""


class ProfileFigure(NodesFigure):
    """A nodal value, and the exact one, along a line parallel to an axis; both are linear on the cloud's triangles."""

    kind: Literal["profile"] = "profile"
    axis: Literal["x", "y"] = Field(description="the coordinate that varies along the line")
    at: float = Field(0.0, description="the other coordinate, constant along the line [mm]")
    value: NodalValue = Field(description="column of `fields`")
    log: bool = Field(False, description="logarithmic vertical axis")

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        snapshots = snapshots_of(self, frames, ("x", "y", self.value))
        axes = figure.add_subplot()
        axes.set_yscale("log" if self.log else "linear")
        exact = f"exact_{self.value}"
        told = []
        exacts: list[tuple[Array, Array]] = []
        for number, snapshot in enumerate(snapshots):
            label = snapshot.heading if len(snapshots) > 1 else snapshot.label
            if snapshot.rows.empty:
                axes.plot([], [], label=f"{label} (no values)", **curve_style(number, 0, False))
                continue
            place, value = self._slice(snapshot.rows, self.value)
            axes.plot(place, value, label=label, **curve_style(number, len(place), False))
            told.append(self._told(label, place, value))
            if exact in snapshot.rows and np.isfinite(snapshot.rows[exact].to_numpy(float)).any():
                pair = self._slice(snapshot.rows, exact)
                if not any(np.array_equal(pair, known, equal_nan=True) for known in exacts):
                    exacts.append(pair)
        for number, pair in enumerate(exacts):
            label = "" if number else "exact"
            told.append(self._told("exact", *pair))
            axes.plot(*pair, label=label, **EXACT)
        if exacts and len(snapshots) == 1 and not snapshots[0].label:
            axes.lines[0].set_label(FIELDS[self.value].symbol)
        other = "y" if self.axis == "x" else "x"
        if all(not np.isfinite(line.get_ydata()).any() for line in axes.lines):
            raise self.refuse(f"the line {other} = {self.at:g} mm misses the cloud; move it with `at`")
        axes.set_xlabel(axis_label([self.axis], "fields"))
        axes.set_ylabel(axis_label([self.value], "fields"))
        note = snapshots[0].note if len(snapshots) == 1 else ""
        finish(figure, axes, join(self.title, note))
        return pd.concat(told, ignore_index=True)

    def _told(self, label: str, place: Array, value: Array) -> pd.DataFrame:
        """A curve, which has a row of NaN where it is broken."""
        across = "y" if self.axis == "x" else "x"
        return pd.DataFrame({"curve": plain(label), self.axis: place, across: self.at, self.value: value})

    def _slice(self, rows: pd.DataFrame, column: str) -> tuple[Array, Array]:
        value = rows[column].to_numpy(float)
        along, across = (rows[name].to_numpy(float) for name in (("x", "y") if self.axis == "x" else ("y", "x")))
        return slice_triangles(triangulate(rows, value), along, across - self.at, value)
