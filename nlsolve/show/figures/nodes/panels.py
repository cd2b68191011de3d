"""Figures of the nodes at one time: the snapshots of the chosen cases, and panels of equal aspect to show them in."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from nlsolve.results.frames import Frames
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, listing
from nlsolve.show.figures.cases import ending, labelled, plain, select
from nlsolve.show.figures.paper.look import COLUMN, MILLIMETRE, PAGE
from nlsolve.show.figures.style import axis_label, bracketed, headed, join

MOST_PANELS, MOST_COLUMNS = 12, 6
Animation = Literal["gif", "apng", "mp4"]
ANIMATIONS: tuple[Animation, ...] = get_args(Animation)
Window = tuple[float, float, float, float]


class NodesFigure(BaseFigure):
    """Base of figures that show the nodes at one time."""

    time: float | None = Field(None, ge=0, description="the nearest recorded time is drawn [s]; absent: the last")

    @property
    def moments(self) -> tuple[float | None, ...]:
        """The times that are drawn; None is the last."""
        return (self.time,)


@dataclass(frozen=True)
class Snapshot:
    """The nodes of one case at one recorded time; no rows when the case left none.

    moment : the time, where a figure shows several, in words.
    """

    label: str
    note: str
    rows: pd.DataFrame
    moment: str = ""

    @property
    def heading(self) -> str:
        return bracketed(join(self.label, self.moment), self.note)

    def told(self, columns: Sequence[str]) -> pd.DataFrame:
        """The nodes and their values in these columns, under the name of the panel or curve."""
        names = [name for name in ("case", "time", "node", "boundary", *columns) if name in self.rows]
        return self.rows[names].assign(panel=plain(self.heading))[["panel", *names]]


class PanelsFigure(NodesFigure):
    """Base of figures with a panel a case and time, in which places of the plane are shown."""

    times: tuple[Annotated[float, Field(ge=0)], ...] = Field(
        (), description="a frame strip: times in place of `time`, a panel each [s]"
    )
    animation: Animation | None = Field(
        None, description="also a moving picture of all recorded times, NAME.gif, NAME.apng or NAME.mp4 (needs ffmpeg)"
    )
    frames_per_second: int = Field(5, gt=0, le=60, description="of the animation")
    window: Window | None = Field(None, description="xmin, xmax, ymin, ymax shown [mm]")
    overlay: bool = Field(False, description="one panel: the first case in colours, the others as outlines over it")

    @model_validator(mode="after")
    def _shows_times_in_one_way(self) -> PanelsFigure:
        if self.times and self.time is not None:
            raise ValueError("time and times exclude each other; drop one of them")
        if self.overlay and (self.times or self.animation):
            raise ValueError("overlay draws cases over each other at one time; drop it, or times and animation")
        return self

    @property
    def moments(self) -> tuple[float | None, ...]:
        return self.times or (self.time,)

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """The columns of `fields` in which a node needs numbers."""

    @abstractmethod
    def show(self, figure: plotting.Figure, shown: Sequence[Snapshot], among: Sequence[Snapshot]) -> None:
        """Draw some snapshots on an empty figure, in the window and the colours of those that they are among."""

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        snapshots = snapshots_of(self, frames, self.columns)
        self.show(figure, snapshots, snapshots)
        told = [replace(snapshot, rows=self.drawn(snapshot.rows)).told(self.columns) for snapshot in snapshots]
        return pd.concat(told, ignore_index=True)

    def drawn(self, rows: pd.DataFrame) -> pd.DataFrame:
        """What is drawn of the nodes of a case at one time."""
        return rows

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
        found = [_snapshot(label, run, rows, moment, columns, len(spec.moments) > 1) for moment in spec.moments]
        _refuse_twins(spec, found, rows)
        snapshots += found
    if all(snapshot.rows.empty for snapshot in snapshots):
        asked = ", ".join("the last time" if time is None else f"time = {time:g} s" for time in spec.moments)
        raise spec.refuse(
            f"no chosen case has nodes with numbers in {listing(columns)} near {asked}; "
            f"recorded times [s]: {_recorded(fields)}"
        )
    return snapshots


def _snapshot(
    label: str, run: pd.Series, rows: pd.DataFrame, asked: float | None, columns: Sequence[str], several: bool
) -> Snapshot:
    """The nodes at the recorded time that is the nearest to the one asked for, of the rows of a case."""
    notes, moment = [ending(run)], ""
    if len(rows):
        times = rows["time"].fillna(0.0).to_numpy(float)
        chosen = times.max() if asked is None else times[np.abs(times - asked).argmin()]
        moment = f"$t$ = {chosen:.4g} s" if several else ""
        if asked is not None and abs(chosen - asked) > _half_increment(run, asked):
            notes.append(f"nearest to {asked:.4g} s" if several else f"$t$ = {chosen:.4g} s, nearest to {asked:.4g} s")
        rows = rows[times == chosen]
    if len(rows) < 3 or not np.isfinite(rows[list(columns)].to_numpy(float)).any(axis=0).all():
        rows = rows.iloc[:0]
    return Snapshot(label, join(*notes), rows, moment)


def _refuse_twins(spec: NodesFigure, found: Sequence[Snapshot], rows: pd.DataFrame) -> None:
    """Raise FigureError when two of the times asked for are nearest to one recorded time."""
    moments = [snapshot.moment for snapshot in found if not snapshot.rows.empty and snapshot.moment]
    if len(set(moments)) < len(moments):
        twice = next(moment for moment in moments if moments.count(moment) > 1)
        raise spec.refuse(
            f"several of the times asked for are nearest to {twice.replace('$', '')}; recorded times [s]: "
            f"{_recorded(rows)}; further ones are recorded with record = {{ times = […] }}"
        )


def _recorded(fields: pd.DataFrame) -> str:
    """The recorded times in words."""
    return ", ".join(f"{time:.6g}" for time in sorted(fields["time"].dropna().unique())[:12]) or "none"


def _half_increment(run: pd.Series, time: float) -> float:
    """Half the case's increment: a record farther from the time asked for is labelled with its own time."""
    increment = pd.to_numeric(run.get("time.increment", np.nan), errors="coerce")
    return 0.5 * (1 + 1e-6) * float(increment) if np.isfinite(increment) else 1e-9 * time


def panels_of(
    figure: plotting.Figure, spec: PanelsFigure, snapshots: Sequence[Snapshot], among: Sequence[Snapshot], bar: bool
) -> list[Panel]:
    """Panels of equal aspect, one a snapshot, on paper of a fitting height; returns those that have nodes.

    They show the window of the snapshots that these are among.
    """
    if len(snapshots) > MOST_PANELS:
        what = "cases and times" if spec.times else "cases"
        raise spec.refuse(f"{len(snapshots)} {what} are too many panels; choose at most {MOST_PANELS} with `where`")
    left, right, bottom, top = _shown(spec, among)
    columns = len(snapshots) if len(snapshots) < 4 else 2 if len(snapshots) == 4 else 3
    if 1 < len(spec.times) <= len(snapshots):
        rows = -(-len(spec.times) // MOST_COLUMNS)
        columns = -(-len(spec.times) // rows)
    rows = -(-len(snapshots) // columns)
    width = spec.wide(COLUMN if columns == 1 else PAGE)
    side = (width - (28 if bar else 10) * MILLIMETRE) / columns
    heading = 5 if len(snapshots) > 1 or snapshots[0].note or snapshots[0].moment or spec.title else 0
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
            axes.set_title(headed(figure, snapshot.heading, 1 / columns))
        if snapshot.rows.empty:
            axes.text(0.5, 0.5, "no values", transform=axes.transAxes, ha="center", va="center", color="0.4")
        else:
            drawn.append((axes, snapshot))
    if len(snapshots) == 1:
        grid.flat[0].set_title(headed(figure, join(spec.title, snapshots[0].moment, snapshots[0].note)))
    elif spec.title:
        figure.suptitle(headed(figure, spec.title))
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
