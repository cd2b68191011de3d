"""Figures of the nodes at one time: the snapshots of the chosen cases, and panels of equal aspect to show them in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve.results.frames import Frames
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, listing
from nlsolve.show.figures.cases import ending, labelled, select
from nlsolve.show.figures.style import COLUMN, MILLIMETRE, PAGE, axis_label, bracketed, join

MOST_PANELS = 12
Window = tuple[float, float, float, float]


class NodesFigure(BaseFigure):
    """Base of figures that show the nodes at one time."""

    time: float | None = Field(None, ge=0, description="the nearest recorded time is drawn [s]; absent: the last")


@dataclass(frozen=True)
class Snapshot:
    """The nodes of one case at one recorded time; no rows when the case left none."""

    label: str
    note: str
    rows: pd.DataFrame

    @property
    def heading(self) -> str:
        return bracketed(self.label, self.note)


class PanelsFigure(NodesFigure):
    """Base of figures with a panel a case, in which places of the plane are shown."""

    window: Window | None = Field(None, description="xmin, xmax, ymin, ymax shown [mm]")
    overlay: bool = Field(False, description="one panel: the first case in colours, the others as outlines over it")

    def layers(self, snapshots: Sequence[Snapshot]) -> tuple[Sequence[Snapshot], Sequence[Snapshot]]:
        """The snapshots that have panels, and those drawn over the first of them, none unless `overlay` asks for it.

        Raises FigureError when a layer has no nodes.
        """
        if not self.overlay:
            return snapshots, ()
        for snapshot in snapshots:
            if snapshot.rows.empty:
                raise self.refuse(f"overlay = true: the case {snapshot.heading!r} left no nodes to draw over others")
        return snapshots[:1], snapshots[1:]


def layer_names(first: Snapshot, over: Sequence[Snapshot]) -> list[str]:
    """What a legend calls the layers over the first; a note that its title has is not repeated."""
    return [layer.label if layer.note == first.note else layer.heading for layer in over]


Panel = tuple["plotting.Axes", Snapshot]


def snapshots_of(spec: NodesFigure, frames: Frames, columns: Sequence[str]) -> list[Snapshot]:
    """A snapshot of every chosen case. Raises FigureError when none of them has numbers in all of the columns."""
    fields = frames.fields
    for column in columns:
        spec.require(column, fields, "fields")
    snapshots = []
    for label, runs in labelled(spec, select(spec, frames.runs), one_case=True):
        run = runs.iloc[0]
        rows = fields[fields["case"] == run["case"]]
        rows = rows[np.isfinite(rows[["x", "y"]].to_numpy(float)).all(axis=1)]
        notes = [ending(run)]
        if len(rows):
            times = rows["time"].fillna(0.0).to_numpy(float)
            chosen = times.max() if spec.time is None else times[np.abs(times - spec.time).argmin()]
            if spec.time is not None and abs(chosen - spec.time) > _half_increment(run, spec.time):
                notes.append(f"$t$ = {chosen:.4g} s, nearest to {spec.time:.4g} s")
            rows = rows[times == chosen]
        if len(rows) < 3 or not np.isfinite(rows[list(columns)].to_numpy(float)).any(axis=0).all():
            rows = rows.iloc[:0]
        snapshots.append(Snapshot(label, join(*notes), rows))
    if all(snapshot.rows.empty for snapshot in snapshots):
        times = ", ".join(f"{time:.6g}" for time in sorted(fields["time"].dropna().unique())[:12]) or "none"
        asked = "the last time" if spec.time is None else f"time = {spec.time:g} s"
        raise spec.refuse(
            f"no chosen case has nodes with numbers in {listing(columns)} near {asked}; recorded times [s]: {times}"
        )
    return snapshots


def _half_increment(run: pd.Series, time: float) -> float:
    """Half the case's increment: a record farther from the time asked for is labelled with its own time."""
    increment = pd.to_numeric(run.get("time.increment", np.nan), errors="coerce")
    return 0.5 * (1 + 1e-6) * float(increment) if np.isfinite(increment) else 1e-9 * time


def panels_of(figure: plotting.Figure, spec: PanelsFigure, snapshots: Sequence[Snapshot], bar: bool) -> list[Panel]:
    """Panels of equal aspect, one a case, on paper of a fitting height; returns those whose case has nodes."""
    if len(snapshots) > MOST_PANELS:
        raise spec.refuse(f"{len(snapshots)} cases are too many panels; choose at most {MOST_PANELS} with `where`")
    left, right, bottom, top = _shown(spec, snapshots)
    columns = len(snapshots) if len(snapshots) < 4 else 2 if len(snapshots) == 4 else 3
    rows = -(-len(snapshots) // columns)
    width = COLUMN if columns == 1 else PAGE
    side = (width - (28 if bar else 10) * MILLIMETRE) / columns
    heading = 5 if len(snapshots) > 1 or snapshots[0].note or spec.title else 0
    height = rows * (side * (top - bottom) / (right - left) + heading * MILLIMETRE) + (11 if bar else 17) * MILLIMETRE
    figure.set_size_inches(width, min(height, 1.3 * PAGE))
    figure.set_layout_engine("compressed", h_pad=(5 if rows > 1 else 3) / 72)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    drawn = []
    for number, axes in enumerate(grid.flat):
        if number >= len(snapshots):
            axes.remove()
            continue
        snapshot = snapshots[number]
        axes.set_aspect("equal")
        axes.set(xlim=(left, right), ylim=(bottom, top))
        if number + columns >= len(snapshots):  # nothing below
            axes.set_xlabel(axis_label(["x"], "fields"))
            axes.tick_params(labelbottom=True)
        if number % columns == 0:
            axes.set_ylabel(axis_label(["y"], "fields"))
        if snapshot.heading and len(snapshots) > 1:
            axes.set_title(snapshot.heading)
        if snapshot.rows.empty:
            axes.text(0.5, 0.5, "no values", transform=axes.transAxes, ha="center", va="center", color="0.4")
        else:
            drawn.append((axes, snapshot))
    if len(snapshots) == 1:
        grid.flat[0].set_title(join(spec.title, snapshots[0].note))
    elif spec.title:
        figure.suptitle(spec.title, fontsize=9)
    return drawn


def _shown(spec: PanelsFigure, snapshots: Sequence[Snapshot]) -> Window:
    """The window asked for, or one around all nodes."""
    if spec.window is None:
        places = np.concatenate([snapshot.rows[["x", "y"]].to_numpy(float) for snapshot in snapshots])
        (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
        margin = 0.03 * max(right - left, top - bottom)
        return left - margin, right + margin, bottom - margin, top + margin
    left, right, bottom, top = spec.window
    if not (left < right and bottom < top):
        raise spec.refuse(
            f"window = {spec.window} is empty; it is xmin, xmax, ymin, ymax with xmin < xmax and ymin < ymax"
        )
    return spec.window
