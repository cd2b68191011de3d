"""Curves of steps over time and of runs over a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from nlsolve.contracts.status import Status
from nlsolve.results.columns import STEPS
from nlsolve.results.frames import Frames
from nlsolve.results.selection import Names
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, listing
from nlsolve.show.figures.cases import ending, labelled, plain, select
from nlsolve.show.figures.style import ACCENT, FAILED, axis_label, bracketed, curve_style, finish, join, symbol


class LineFigure(BaseFigure):
    """y over x, a curve a group and column: from `steps` in their order, from `runs` sorted by x."""

    kind: Literal["line"] = "line"
    source: Literal["steps", "runs"] = Field("steps", description="the frame that holds x and y")
    x: str = Field("time", description="column along the horizontal axis")
    y: Names = Field(min_length=1, description="column or columns along the vertical axis")
    log: Literal["", "x", "y", "xy"] = Field("", description="axes with a logarithmic scale")
    accepted_only: bool = Field(True, description="of steps: only the last of each finished increment")
    reference: float | None = Field(None, description="height of a thin horizontal line, such as a_max = 1")
    markers: bool = Field(True, description="markers on the curves, sparse on long ones")
    xlabel: str | None = Field(None, description="absent: the column's symbol and unit")
    ylabel: str | None = Field(None, description="absent: the columns' symbols and units")

    def columns_of_runs(self) -> dict[str, Names]:
        own = {"x": (self.x,), "y": self.y} if self.source == "runs" else {}
        return {**super().columns_of_runs(), **own}

    @property
    def shows_seconds(self) -> bool:
        of_steps = (self.x, *self.y) if self.source == "steps" else ()
        return super().shows_seconds or any(name in STEPS and STEPS[name].timed for name in of_steps)

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        frame = frames.steps if self.source == "steps" else frames.runs
        for column in (self.x, *self.y):
            self.require(column, frame, self.source)
        curves = self._curves(frames)
        several, worded = len(curves) > 1, not _numeric(frame[self.x])
        axes = figure.add_subplot()
        axes.set_xscale("log" if "x" in self.log else "linear")
        axes.set_yscale("log" if "y" in self.log else "linear")
        drawn = dict.fromkeys(self.y, 0)
        told = []
        for number, (label, rows) in enumerate(curves):
            told.append(self._told(label, rows))
            for which, column in enumerate(self.y):
                points = self._points(rows, column)
                drawn[column] += len(points)
                name = join(label, symbol(column, self.source) if len(self.y) > 1 else "")
                place = number if several else which
                style = curve_style(place, len(points), self.markers or worded, number * len(self.y) + which)
                style |= {"linestyle": "none"} if worded else {}
                axes.plot(points[self.x], points[column], label=name if len(points) else f"{name} (no values)", **style)
                self._cross_out(axes, points, column)
        for column, count in drawn.items():
            if not count:
                raise self.refuse(self._nothing(column, frame, [rows for _, rows in curves]))
        if self.reference is not None:
            axes.axhline(self.reference, color="0.5", linewidth=0.6, zorder=0)
        axes.set_xlabel(axis_label([self.x], self.source) if self.xlabel is None else self.xlabel)
        axes.set_ylabel(axis_label(self.y, self.source) if self.ylabel is None else self.ylabel)
        if worded:
            axes.margins(x=0.15)
        elif "x" not in self.log and _whole(frame[self.x]):
            axes.xaxis.set_major_locator(plotting.MaxNLocator(integer=True, steps=[1, 5, 10]))
        finish(figure, axes, self.title)
        return pd.concat(told, ignore_index=True)

    def _told(self, label: str, rows: pd.DataFrame) -> pd.DataFrame:
        """The points of one curve, with its name and the cases that they are of; NaN where a value is not drawn."""
        fits = {column: self._fit(rows, column) for column in self.y}
        shown = rows.assign(**{column: rows[column].where(fit) for column, fit in fits.items()}, curve=plain(label))
        names = [name for name in dict.fromkeys(("curve", "case", self.x, *self.y)) if name in shown]
        return self._sorted(shown.loc[np.any(list(fits.values()), axis=0), names])

    def _curves(self, frames: Frames) -> list[tuple[str, pd.DataFrame]]:
        """Label and rows of every curve."""
        groups = labelled(self, select(self, frames.runs), one_case=self.source == "steps")
        if self.source == "runs":
            return groups
        steps = frames.steps[frames.steps["accepted"].eq(True)] if self.accepted_only else frames.steps
        return [
            (bracketed(label, ending(runs.iloc[0])), steps[steps["case"] == runs["case"].iloc[0]])
            for label, runs in groups
        ]

    def _points(self, rows: pd.DataFrame, column: str) -> pd.DataFrame:
        """The rows that can be drawn: finite, and positive along a logarithmic axis."""
        return self._sorted(rows[self._fit(rows, column)])

    def _fit(self, rows: pd.DataFrame, column: str) -> NDArray[np.bool_]:
        return _drawable(rows[self.x], "x" in self.log) & _drawable(rows[column], "y" in self.log)

    def _sorted(self, points: pd.DataFrame) -> pd.DataFrame:
        sort = self.source == "runs" and _numeric(points[self.x])
        return points.sort_values(self.x, kind="stable") if sort else points

    def _cross_out(self, axes: plotting.Axes, points: pd.DataFrame, column: str) -> None:
        """Mark the runs that did not converge with a cross."""
        if self.source == "steps" or "status" not in points or "status" in (self.x, column):
            return
        failed = points[[status is not Status.CONVERGED for status in points["status"].map(Status.of)]]
        if len(failed):
            label = "" if any(line.get_label() == FAILED for line in axes.lines) else FAILED
            axes.plot(failed[self.x], failed[column], "x", markersize=6, color=ACCENT, zorder=5, label=label)

    def _nothing(self, column: str, frame: pd.DataFrame, groups: Sequence[pd.DataFrame]) -> str:
        """The sentence for a column without numbers to draw, with the columns that have some."""
        kept = "accepted steps" if self.source == "steps" and self.accepted_only else self.source
        rows = pd.concat(list(groups)) if groups else frame.iloc[:0]
        if rows.empty:
            return f"there are no {kept} of the chosen cases, so nothing to draw for y = {column!r}"
        positive = " that a logarithmic axis can show" if self.log else ""
        others = [str(name) for name in rows if _numeric(rows[name]) and np.isfinite(rows[name].to_numpy(float)).any()]
        return (
            f"y = {column!r} over x = {self.x!r} holds no number{positive} in the {len(rows)} {kept} "
            f"of the chosen cases; columns with numbers: {listing(others)}"
        )


def _numeric(column: pd.Series) -> bool:
    return pd.api.types.is_numeric_dtype(column)


def _whole(column: pd.Series) -> bool:
    numbers = column.dropna().to_numpy(float)
    return bool(np.isfinite(numbers).all() and (numbers == np.round(numbers)).all())


def _drawable(column: pd.Series, log: bool) -> NDArray[np.bool_]:
    if not _numeric(column):
        return column.notna().to_numpy(dtype=bool)
    numbers = column.to_numpy(float, na_value=np.nan)
    return np.isfinite(numbers) & ((numbers > 0) | (not log))
