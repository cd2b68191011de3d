"""A value of every run in a grid, with marks on the runs that failed, are in doubt, or are wrong without a doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve.contracts.status import Status
from nlsolve.results.frames import Frames, rows_of
from nlsolve.results.parameters import differing_parameters, names_settings
from nlsolve.results.selection import Names
from nlsolve.results.verdicts import ACCEPTED, WRONG, Run, doubt, is_error, number, outcome, percent, status_of
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, listing
from nlsolve.show.figures.cases import label_of, number_text, select
from nlsolve.show.figures.paper.look import COLUMN, FONT_SIZE, MILLIMETRE, PAGE
from nlsolve.show.figures.style import (
    ACCENT,
    ERROR_MAP,
    IN_DOUBT,
    axis_label,
    headed,
    legend_outside,
    letters,
)

MOST_CELLS = 2000
ROW, CELL, LETTER, MARGIN = 4.6, 17.0, 1.45, 8.0  # height of a row, widths of a column and of a label's letter [mm]
LETTERS_IN_CELL = 7  # "0.031 %"
LEAST_CELL = 4.0  # width of a cell in which its words can be read [mm]
BAR_HEIGHT = 0.1  # of the bar of colours, at least, which is 40 times as wide [inch]
DOUBT = "#D55E00"
FAILED_FACE: Any = {"facecolor": "0.93", "edgecolor": "0.72", "hatch": "//////", "linewidth": 0}
NO_NUMBER = "–"


@dataclass(frozen=True)
class Tile:
    """A run in the grid: its column and row, its number (NaN for none), how it ended, and how that is judged."""

    column: int
    row: int
    value: float
    status: Status
    doubted: bool
    wrong: bool

    @property
    def failed(self) -> bool:
        return self.status is not Status.CONVERGED


class MapFigure(BaseFigure):
    """value(x, y) in logarithmic colours, a cell a run, categories in their order of appearance.

    A failed run is hatched and shows a code of its status; a corner marks a run in doubt; a red frame marks a false
    success: converged, no doubt, error > accepted. The error is `value` if it is one, else that of the velocity.
    """

    kind: Literal["map"] = "map"
    x: Names = Field(min_length=1, description="column or columns of `runs` along the top")
    y: Names = Field(min_length=1, description="column or columns of `runs` down the side")
    value: str = Field("velocity_error", description="column of `runs` in the cells")
    accepted: float = Field(ACCEPTED, gt=0, description="error above which an undoubted run is a false success")
    separate: bool = Field(False, description='a line where the part of the y label before " = " changes')

    def columns_of_runs(self) -> dict[str, Names]:
        return {**super().columns_of_runs(), "x": self.x, "y": self.y, "value": (self.value,)}

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        runs = select(self, frames.runs)
        for column in (*self.x, *self.y, self.value):
            self.require(column, runs, "runs")
        members = rows_of(runs)
        across, down = ([_category(names, run) for run in members] for names in (self.x, self.y))
        columns, rows = list(dict.fromkeys(across)), list(dict.fromkeys(down))
        self._refuse_twins(runs, list(zip(across, down, strict=True)))
        if len(columns) * len(rows) > MOST_CELLS:
            raise self.refuse(f"{len(rows)} by {len(columns)} cells are too many; choose at most {MOST_CELLS}")
        tiles = [
            self._tile(run, columns.index(x), rows.index(y)) for run, x, y in zip(members, across, down, strict=True)
        ]
        norm = self._norm(tiles)
        scale = (self.font_size or FONT_SIZE) / FONT_SIZE
        beside, above = (scale * LETTER * max(map(letters, labels)) for labels in (rows, columns))
        usual = np.clip(beside + max(CELL, above) * len(columns) + MARGIN, COLUMN / MILLIMETRE, PAGE / MILLIMETRE)
        width = self.wide(float(usual) * MILLIMETRE) / MILLIMETRE
        room = (width - beside - MARGIN) / len(columns)
        if room < LEAST_CELL:
            raise self.refuse(
                f"{len(columns)} columns beside these names leave {max(room, 0):.1f} mm for a cell of {width:.0f} mm; "
                "choose a larger width, a smaller font_size, or fewer columns"
            )
        height = scale * ROW * len(rows) + 6 + 20 * (norm is not None) + 0.6 * above * (above > room)
        figure.set_size_inches(width * MILLIMETRE, height * MILLIMETRE)
        axes = figure.add_subplot()
        self._grid(axes, columns, rows, leaning=above > room)
        largest = 7.5 * scale
        size = float(np.clip(room / LETTERS_IN_CELL / 0.16, min(4.5, largest), largest))  # a letter: 0.16 mm a point
        for tile in tiles:
            self._paint_tile(axes, tile, norm, size)
        self._empty_places(axes, {(tile.column, tile.row) for tile in tiles}, len(columns), len(rows), size)
        if norm is not None:
            self._bar(figure, axes, norm, len(rows))
        if self.title:
            axes.set_title(headed(figure, self.title))
        self._legend(figure, tiles)
        return self._told(runs, tiles)

    def _told(self, runs: pd.DataFrame, tiles: Sequence[Tile]) -> pd.DataFrame:
        """The cells, row by row as `runs` has them, with the marks on them."""
        names = dict.fromkeys(("case", *self.x, *self.y, self.value, "status"))
        told = runs[[name for name in names if name in runs]]
        return told.assign(in_doubt=[tile.doubted for tile in tiles], false_success=[tile.wrong for tile in tiles])

    def _refuse_twins(self, runs: pd.DataFrame, places: Sequence[tuple[str, str]]) -> None:
        for place in dict.fromkeys(places):
            here = [number for number, other in enumerate(places) if other == place]
            if len(here) > 1:
                raise self.refuse(
                    f"{len(here)} runs land in the cell {place[0]!r}, {place[1]!r}; "
                    f"they differ in {listing(differing_parameters(runs.iloc[here]))}: "
                    "add one to `x` or `y`, or choose with `where`"
                )

    def _tile(self, run: Run, column: int, row: int) -> Tile:
        error = self.value if is_error(self.value) else "velocity_error"
        wrong = outcome(run, self.accepted, error) == WRONG
        return Tile(column, row, number(run[self.value]), status_of(run), bool(doubt(run)), wrong)

    def _norm(self, tiles: Sequence[Tile]) -> plotting.LogNorm | None:
        """The colour scale: least to largest number of the converged runs, errors up to 100 %; None without numbers."""
        converged = [tile.value for tile in tiles if not tile.failed]
        numbers = [value for value in converged if np.isfinite(value) and value > 0]
        if converged and not numbers:
            raise self.refuse(f"value = {self.value!r} holds no positive number in the {len(converged)} converged runs")
        if not numbers:
            return None
        low, high = 10 ** np.floor(np.log10(min(numbers))), 10 ** np.ceil(np.log10(max(numbers)))
        if is_error(self.value):
            high = min(high, 1.0)
        return plotting.LogNorm(low, high if high > low else 10 * low, clip=True)

    def _grid(self, axes: plotting.Axes, columns: Sequence[str], rows: Sequence[str], leaning: bool) -> None:
        axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
        axes.set_xticks(range(len(columns)), columns)
        axes.set_yticks(range(len(rows)), rows)
        axes.tick_params(length=0, top=False, right=False, labeltop=True, labelbottom=False)
        if leaning:
            axes.tick_params(axis="x", labelrotation=35)
            for label in axes.get_xticklabels():
                label.set(horizontalalignment="left", rotation_mode="anchor")
        axes.xaxis.set_label_position("top")
        if len(self.x) == 1 and not names_settings(self.x[0]):
            axes.set_xlabel(axis_label(self.x, "runs"))
        if len(self.y) == 1 and not names_settings(self.y[0]):
            axes.set_ylabel(axis_label(self.y, "runs"))
        for spine in axes.spines.values():
            spine.set_visible(False)
        families = [row.split(" = ")[0] for row in rows]
        for row in range(1, len(rows)):
            if self.separate and families[row] != families[row - 1]:
                axes.axhline(row - 0.5, color="0.25", linewidth=0.6, zorder=4)

    def _paint_tile(self, axes: plotting.Axes, tile: Tile, norm: plotting.LogNorm | None, size: float) -> None:
        left, top = tile.column - 0.5, tile.row - 0.5
        ink = "0.1"
        if tile.failed:
            axes.add_patch(plotting.Rectangle((left, top), 1, 1, **FAILED_FACE))
        elif norm is not None and np.isfinite(tile.value):
            red, green, blue, _ = plotting.colormaps[ERROR_MAP](norm(max(tile.value, norm.vmin or 0)))
            ink = "0.1" if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else "white"
            axes.add_patch(plotting.Rectangle((left, top), 1, 1, facecolor=(red, green, blue), edgecolor="none"))
        axes.add_patch(
            plotting.Rectangle((left, top), 1, 1, facecolor="none", edgecolor="white", linewidth=0.8, zorder=2)
        )
        words = code(tile.status) if tile.failed else short(tile.value, self.value)
        box: Any = {"facecolor": "0.93", "edgecolor": "none", "pad": 0.6} if tile.failed else None
        axes.text(
            tile.column,
            tile.row,
            words,
            ha="center",
            va="center_baseline",
            fontsize=size,
            color=ink,
            bbox=box,
            zorder=5,
        )
        if tile.doubted:
            corner = [(left + 0.86, top + 0.04), (left + 0.985, top + 0.04), (left + 0.985, top + 0.5)]
            axes.add_patch(plotting.Polygon(corner, facecolor=DOUBT, edgecolor="white", linewidth=0.4, zorder=3))
        if tile.wrong:
            axes.add_patch(
                plotting.Rectangle(
                    (left + 0.02, top + 0.07), 0.96, 0.86, facecolor="none", edgecolor=ACCENT, linewidth=1.5, zorder=6
                )
            )

    def _empty_places(
        self, axes: plotting.Axes, taken: set[tuple[int, int]], columns: int, rows: int, size: float
    ) -> None:
        for column in range(columns):
            for row in range(rows):
                if (column, row) not in taken:
                    axes.text(column, row, "·", ha="center", va="center", fontsize=size, color="0.6")

    def _bar(self, figure: plotting.Figure, axes: plotting.Axes, norm: plotting.LogNorm, rows: int) -> None:
        bar = figure.colorbar(
            plotting.ScalarMappable(norm, ERROR_MAP),
            ax=axes,
            location="bottom",
            aspect=40,
            fraction=max(0.03, BAR_HEIGHT / figure.get_figheight()),
            pad=0.5 / rows,
            shrink=0.8,
        )
        bar.set_label(axis_label([self.value], "runs"))
        bar.ax.xaxis.set_major_locator(plotting.LogLocator(numticks=12))
        bar.ax.xaxis.set_minor_locator(plotting.NullLocator())
        bar.ax.xaxis.set_major_formatter(plotting.FuncFormatter(lambda value, _: short(value, self.value)))
        bar.outline.set_linewidth(0.5)

    def _legend(self, figure: plotting.Figure, tiles: Sequence[Tile]) -> None:
        """A legend of the marks that occur."""
        handles: list[Any] = []
        wrong = [tile for tile in tiles if tile.wrong]
        if wrong:
            limit = short(self.accepted, "velocity_error")
            words = f"false success: error above {limit} ({len(wrong)})"
            handles.append(plotting.Patch(facecolor="white", edgecolor=ACCENT, linewidth=1.5, label=words))
        doubted = sum(tile.doubted for tile in tiles)
        if doubted:
            corner: Any = {"linestyle": "none", "marker": (3, 0, -45), "markersize": 7, "markeredgewidth": 0}
            handles.append(plotting.Line2D([], [], color=DOUBT, label=f"{IN_DOUBT} ({doubted})", **corner))
        failed = [tile.status for tile in tiles if tile.failed]
        for status in dict.fromkeys(failed):
            words = f"{code(status)}: {status.word} ({failed.count(status)})"
            handles.append(plotting.Patch(**FAILED_FACE, label=words))
        if handles:
            legend_outside(figure, handles, [handle.get_label() for handle in handles], "lower")


def code(status: Status) -> str:
    """A few letters for a status: "BS" for "budget spent", "DIV" for "diverged"."""
    words = status.word.split()
    return ("".join(word[0] for word in words) if len(words) > 1 else status.word[:3]).upper()


def short(value: float, column: str) -> str:
    """A number in two digits: errors from 0.01 % to 1000 % in percent, very small and large ones as 3e-5 and 2e4."""
    if not np.isfinite(value):
        return NO_NUMBER
    if is_error(column) and 1e-4 <= value < 10:
        return percent(float(f"{value:.2g}"))
    if 1e-2 <= abs(value) < 1e4 or not value:
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"
    mantissa, power = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(power)}"


def _category(names: Names, run: Run) -> str:
    """The label of a run's row or column: the bare value of one column, words for several."""
    values = {name: run[name] for name in names if not pd.isna(run[name])}
    return number_text(*values.values()) if len(names) == len(values) == 1 else label_of(values) or NO_NUMBER
