"""Figures a study declares: curves of runs and steps, clouds, profiles and fields, drawn for print.

A figure is a validated value like everything else in a study; `draw` turns it and the result frames into a
`matplotlib.figure.Figure` without touching pyplot, `save` writes it as PNG and PDF, the same bytes every time.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field
from scipy.spatial import cKDTree

from nlsolve.columns import FIELDS, RUNS, STEPS
from nlsolve.component import Component
from nlsolve.status import Status

MILLIMETRE = 1 / 25.4  # [inch]
COLUMN, PAGE = 90 * MILLIMETRE, 180 * MILLIMETRE  # widths of one and of two columns of a journal
DOTS_PER_INCH = 200
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe & Ito 2008
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
UPPER, LOWER, ACCENT = COLOURS[0], COLOURS[4], "#C00000"
SIGNED_MAP, POSITIVE_MAP = "RdBu_r", "viridis"
LEVELS = 20
MANY_POINTS = 40  # beyond, a curve carries a marker here and there only
MOST_PANELS = 12
FLOOR = 1e-12  # of the largest value: what a logarithmic field shows at least

STYLE: Any = {
    "font.family": "STIXGeneral",
    "font.size": 9,
    "mathtext.fontset": "stix",
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.linewidth": 0.6,
    "axes.unicode_minus": True,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 5),
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "axes.xmargin": 0.04,
    "lines.linewidth": 0.9,
    "lines.markersize": 3.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.2,
    "pdf.fonttype": 42,
    "savefig.facecolor": "white",
}

SYMBOLS: Mapping[str, str] = {
    "time": "$t$",
    "range": r"$a_{\max}$",
    "residual_norm": "relative residual",
    "difference": "relative difference",
    "length": "step length",
    "seconds": "time inside the method",
    "probe_x": "$x$",
    "probe_y": "$y$",
    "probe_u": "$u$",
    "probe_v": "$v$",
    "x": "$x$",
    "y": "$y$",
    "u": "$u$",
    "v": "$v$",
    "exx": r"$\dot{\varepsilon}_{xx}$",
    "eyy": r"$\dot{\varepsilon}_{yy}$",
    "exy": r"$\dot{\varepsilon}_{xy}$",
    "rate": r"$\bar{\varepsilon}$",
    "factorizations": "factorisations",
    "validity_time": "time served by the first tangent",
    "velocity_error": "relative error of the velocity",
    "torque_error": "relative error of the torque",
    "fill": "entries of the factors",
    "factor_solve_ratio": "factorisation / triangular solve",
}
"""How a column is called on an axis; others go by their own name. The unit is read from `nlsolve.columns`."""

Scalar = bool | int | float | str
Array = NDArray[np.float64]


class FigureError(ValueError):
    """A declared figure cannot be drawn from these results; the sentence says which, why, and what there is instead."""


@dataclass(frozen=True)
class Frames:
    """The three result frames, as documented in `nlsolve.columns`."""

    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame


def _as_tuple(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


Names = Annotated[tuple[str, ...], BeforeValidator(_as_tuple)]


class BaseFigure(Component, ABC):
    """What all kinds of figures have in common."""

    noun: ClassVar[str] = "figure"

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", description="stem of the files written")
    caption: str = Field("", description="sentence under the figure in the report")
    title: str | None = Field(None, description="heading inside the figure; papers do without")
    where: dict[str, Scalar | list[Scalar]] = Field(
        default_factory=dict, description="runs column -> value, or list of values, a case must have to be drawn"
    )
    group: Names = Field(
        (),
        description="parameters that tell curves or panels apart; absent: those that differ, where a case is a curve",
    )

    @abstractmethod
    def paint(self, figure: Figure, frames: Frames) -> None:
        """Draw on an empty figure."""

    def refuse(self, sentence: str) -> FigureError:
        """The exception for this figure, by name."""
        return FigureError(f'figure "{self.name}": {sentence}')


class _Snapshots(BaseFigure):
    """Figures of the nodes at one time."""

    time: float | None = Field(None, ge=0, description="the nearest recorded time is drawn [s]; absent: the last")


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

    def paint(self, figure: Figure, frames: Frames) -> None:
        frame = frames.steps if self.source == "steps" else frames.runs
        for column in (self.x, *self.y):
            _require(self, column, frame, self.source)
        curves = list(self._groups(frames))
        axes = figure.add_subplot()
        axes.set_xscale("log" if "x" in self.log else "linear")
        axes.set_yscale("log" if "y" in self.log else "linear")
        drawn: dict[str, int] = dict.fromkeys(self.y, 0)
        for number, (label, rows) in enumerate(curves):
            for which, column in enumerate(self.y):
                points = self._points(rows, column)
                drawn[column] += len(points)
                name = ", ".join(filter(None, [label, SYMBOLS.get(column, _plain(column)) if len(self.y) > 1 else ""]))
                place = number if len(curves) > 1 else which
                dashes = DASHES[(which if len(curves) > 1 else 0) % len(DASHES)]
                style = _curve_style(place, len(points), self.markers or not _numeric(points[self.x]), dashes)
                if not _numeric(points[self.x]):
                    style["linestyle"] = "none"
                axes.plot(points[self.x], points[column], label=name if len(points) else f"{name} (no values)", **style)
                self._cross_out(axes, points, column)
        for column, count in drawn.items():
            if not count:
                raise self.refuse(self._nothing(column, frame, [rows for _, rows in curves]))
        if self.reference is not None:
            axes.axhline(self.reference, color="0.5", linewidth=0.6, zorder=0)
        axes.set_xlabel(axis_label([self.x], self.source) if self.xlabel is None else self.xlabel)
        axes.set_ylabel(axis_label(self.y, self.source) if self.ylabel is None else self.ylabel)
        if not _numeric(frame[self.x]):
            axes.margins(x=0.15)
        elif "x" not in self.log and _whole(frame[self.x]):
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        _finish(figure, axes, self.title, COLUMN)

    def _groups(self, frames: Frames) -> Iterator[tuple[str, pd.DataFrame]]:
        cases = select(self, frames.runs)
        for label, runs in labelled(self, cases, one_case=self.source == "steps"):
            if self.source == "runs":
                yield label, runs
                continue
            rows = frames.steps[frames.steps["case"] == runs["case"].iloc[0]]
            ending = _ending(runs.iloc[0])
            label = f"{label} ({ending})" if ending and label else label or ending
            yield label, rows[rows["accepted"].eq(True)] if self.accepted_only else rows

    def _points(self, rows: pd.DataFrame, column: str) -> pd.DataFrame:
        """The rows that can be drawn: finite, and positive along a logarithmic axis."""
        fit = _drawable(rows[self.x], "x" in self.log) & _drawable(rows[column], "y" in self.log)
        points = rows[fit]
        return (
            points.sort_values(self.x, kind="stable") if self.source == "runs" and _numeric(points[self.x]) else points
        )

    def _cross_out(self, axes: Axes, points: pd.DataFrame, column: str) -> None:
        if self.source == "steps" or "status" not in points or "status" in (self.x, column):
            return
        failed = points[points["status"] != Status.CONVERGED.word]
        if len(failed):
            known = any(line.get_label() == "not converged" for line in axes.lines)
            axes.plot(
                failed[self.x],
                failed[column],
                linestyle="none",
                marker="x",
                markersize=6,
                color=ACCENT,
                zorder=5,
                label="" if known else "not converged",
            )

    def _nothing(self, column: str, frame: pd.DataFrame, groups: Sequence[pd.DataFrame]) -> str:
        kept = "accepted steps" if self.source == "steps" and self.accepted_only else self.source
        rows = pd.concat(list(groups)) if groups else frame.iloc[:0]
        if rows.empty:
            return f"there are no {kept} of the chosen cases, so nothing to draw for y = {column!r}"
        positive = " that a logarithmic axis can show" if self.log else ""
        others = [str(name) for name in rows if _numeric(rows[name]) and np.isfinite(rows[name].to_numpy(float)).any()]
        return (
            f"y = {column!r} over x = {self.x!r} holds no number{positive} in the {len(rows)} {kept} "
            f"of the chosen cases; columns with numbers: {_listing(others)}"
        )


class CloudFigure(_Snapshots):
    """The nodes at a time, coloured by the half-disc (sign of y at t = 0) they started in: material mixing."""

    kind: Literal["cloud"] = "cloud"
    probe: tuple[float, float] | None = Field(None, description="place at t = 0 whose nearest node is marked [mm]")
    window: tuple[float, float, float, float] | None = Field(None, description="xmin, xmax, ymin, ymax shown [mm]")

    def paint(self, figure: Figure, frames: Frames) -> None:
        snapshots = _snapshots(self, frames, ("x", "y", "x0", "y0"))
        panels = _panels(figure, self, snapshots, self.window, bar=False)
        for axes, snapshot in panels:
            rows = snapshot.rows
            places = rows[["x", "y"]].to_numpy(float)
            wall = _boundaries(rows) != ""
            upper = rows["y0"].to_numpy(float) > 0
            size = _marker_size(axes, places)
            for half, colour, label in ((upper, UPPER, "$y_0 > 0$"), (~upper, LOWER, r"$y_0 \leq 0$")):
                axes.plot(*places[half & ~wall].T, "o", markersize=size, color=colour, markeredgewidth=0, label=label)
                axes.plot(
                    *places[half & wall].T, "o", markersize=1.2 * size, color=colour, markeredgecolor="black",
                    markeredgewidth=min(0.5, 0.25 * size), clip_on=self.window is not None,
                )  # fmt: skip
            if self.probe is not None:
                start = rows[["x0", "y0"]].to_numpy(float)
                marked = int(np.hypot(*(start - self.probe).T).argmin())
                axes.plot(
                    *places[marked], "o", markersize=max(2.5 * size, 5), markerfacecolor="none", markeredgecolor=ACCENT,
                    markeredgewidth=1.2, label="probe",
                )  # fmt: skip
        handles = [
            Line2D([], [], linestyle="none", marker="o", color=UPPER, markeredgewidth=0, label="$y_0 > 0$"),
            Line2D([], [], linestyle="none", marker="o", color=LOWER, markeredgewidth=0, label=r"$y_0 \leq 0$"),
            Line2D([], [], linestyle="none", marker="o", color="white", markeredgecolor="black", label="boundary"),
        ]
        if self.probe is not None:
            ring: Any = {"markerfacecolor": "none", "markeredgecolor": ACCENT, "markeredgewidth": 1.2}
            handles.append(Line2D([], [], linestyle="none", marker="o", markersize=6, label="probe", **ring))
        figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), handlelength=1)


class ProfileFigure(_Snapshots):
    """A nodal value along a line parallel to an axis, linear on the cloud's triangles, and the exact value with it."""

    kind: Literal["profile"] = "profile"
    axis: Literal["x", "y"] = Field(description="the coordinate that varies along the line")
    at: float = Field(0.0, description="the other coordinate, constant along the line [mm]")
    value: Literal["u", "v", "exx", "eyy", "exy", "rate"] = Field(description="column of `fields`")
    log: bool = Field(False, description="logarithmic vertical axis")

    def paint(self, figure: Figure, frames: Frames) -> None:
        snapshots = _snapshots(self, frames, ("x", "y", self.value))
        axes = figure.add_subplot()
        axes.set_yscale("log" if self.log else "linear")
        exact = f"exact_{self.value}"
        exacts: list[tuple[Array, Array]] = []
        for number, snapshot in enumerate(snapshots):
            label = snapshot.heading if len(snapshots) > 1 else snapshot.label
            if snapshot.rows.empty:
                axes.plot([], [], label=f"{label} (no values)", **_curve_style(number, 0, False))
                continue
            place, value = self._slice(snapshot.rows, self.value)
            axes.plot(place, value, label=label, **_curve_style(number, len(place), False))
            if exact in snapshot.rows and np.isfinite(snapshot.rows[exact].to_numpy(float)).any():
                pair = self._slice(snapshot.rows, exact)
                if not any(np.array_equal(pair, known, equal_nan=True) for known in exacts):
                    exacts.append(pair)
        for number, pair in enumerate(exacts):
            label = "" if number else "exact"
            axes.plot(*pair, color="black", linestyle=(0, (4, 3)), linewidth=0.6, zorder=3, label=label)
        if exacts and len(snapshots) == 1 and not snapshots[0].label:
            axes.lines[0].set_label(SYMBOLS[self.value])
        other = "y" if self.axis == "x" else "x"
        if all(not np.isfinite(line.get_ydata()).any() for line in axes.lines):
            raise self.refuse(f"the line {other} = {self.at:g} mm misses the cloud; move it with `at`")
        axes.set_xlabel(axis_label([self.axis], "fields"))
        axes.set_ylabel(axis_label([self.value], "fields"))
        note = snapshots[0].note if len(snapshots) == 1 else ""
        _finish(figure, axes, _join(self.title, note), COLUMN)

    def _slice(self, rows: pd.DataFrame, column: str) -> tuple[Array, Array]:
        value = rows[column].to_numpy(float)
        along, across = (rows[name].to_numpy(float) for name in (("x", "y") if self.axis == "x" else ("y", "x")))
        return slice_triangles(triangulate(rows, value), along, across - self.at, value)


class FieldFigure(_Snapshots):
    """Filled contours of a nodal value: diverging colours about 0 for what has a sign, sequential ones for ε̄."""

    kind: Literal["field"] = "field"
    value: Literal["u", "v", "exx", "eyy", "exy", "rate"] = Field(description="column of `fields`")
    log: bool = Field(False, description="logarithmic colours; for `rate`")
    limit: float | None = Field(
        None, gt=0, description="largest magnitude the colours distinguish; absent: the largest"
    )
    window: tuple[float, float, float, float] | None = Field(None, description="xmin, xmax, ymin, ymax shown [mm]")

    def paint(self, figure: Figure, frames: Frames) -> None:
        if self.log and self.value != "rate":
            raise self.refuse(f"value = {self.value!r} has a sign, so log = true cannot show it; only 'rate' can")
        snapshots = _snapshots(self, frames, ("x", "y", self.value))
        levels, extend = self._levels(np.concatenate([s.rows[self.value].to_numpy(float) for s in snapshots]))
        panels = _panels(figure, self, snapshots, self.window, bar=True)
        contours = None
        for axes, snapshot in panels:
            value = snapshot.rows[self.value].to_numpy(float)
            triangles = triangulate(snapshot.rows, value)
            shown = np.where(np.isfinite(value), value, levels[0])
            if self.log:
                shown = np.log10(np.maximum(shown, FLOOR * np.nanmax(value)))
            colours = POSITIVE_MAP if self.value == "rate" else SIGNED_MAP
            contours = axes.tricontourf(triangles, shown, levels=levels, cmap=colours, extend=extend)
            contours.set_edgecolor("face")  # hides the seams that PDF viewers draw between bands
            contours.set_linewidth(0.2)
            axes.add_collection(LineCollection(list(outline(triangles)), colors="0.25", linewidths=0.5))
        assert contours is not None
        bar = figure.colorbar(contours, ax=figure.axes, fraction=0.05, pad=0.02, aspect=25)
        bar.set_label(axis_label([self.value], "fields"))
        bar.ax.tick_params(direction="out", right=True)
        bar.outline.set_linewidth(0.5)
        ticks = MaxNLocator(7, integer=self.log, steps=[1, 2, 5, 10]).tick_values(levels[0], levels[-1])
        bar.locator = FixedLocator([tick for tick in ticks if levels[0] <= tick <= levels[-1]])
        if self.log:
            bar.formatter = FuncFormatter(lambda power, _: f"$10^{{{power:.0f}}}$")
        bar.update_ticks()

    def _levels(self, values: Array) -> tuple[Array, Literal["neither", "both", "min", "max"]]:
        largest = float(np.nanmax(np.abs(values)))
        top = self.limit or largest or 1.0
        cut = largest > top * (1 + 1e-12)
        if self.log:
            positive = values[values > 0]
            if not positive.size:
                raise self.refuse(f"value = {self.value!r} is nowhere positive, so log = true shows nothing")
            low = np.floor(np.log10(max(float(positive.min()), FLOOR * largest)))
            high = max(np.ceil(np.log10(top)), low + 1)
            return np.linspace(low, high, int(high - low) * max(1, round(LEVELS / (high - low))) + 1), "neither"
        bottom = 0.0 if self.value == "rate" else -top
        ends: Literal["neither", "both", "max"] = "neither" if not cut else "max" if self.value == "rate" else "both"
        # an odd number of bands, so that one of them is centred on 0 and a field at rest is white
        return np.linspace(bottom, top, LEVELS + 2), ends


FigureSpec = Annotated[LineFigure | CloudFigure | ProfileFigure | FieldFigure, Field(discriminator="kind")]
"""What a study's `[[figure]]` may be."""


def draw(spec: BaseFigure, runs: pd.DataFrame, steps: pd.DataFrame, fields: pd.DataFrame) -> Figure:
    """The declared figure of these results. Raises FigureError when there is nothing to draw."""
    with rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, 0.72 * COLUMN), layout="constrained")
        spec.paint(figure, Frames(runs, steps, fields))
    return figure


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write `name`.png and `name`.pdf into the folder, without dates, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.pdf"]
    with rc_context(STYLE):
        figure.savefig(paths[0], dpi=DOTS_PER_INCH)
        figure.savefig(paths[1], metadata={"CreationDate": None})
    return paths


# Which cases, and what they are called


def select(spec: BaseFigure, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that have every value `where` asks for."""
    if runs.empty:
        raise spec.refuse("there are no runs to draw")
    for column, wanted in spec.where.items():
        _require(spec, column, runs, "runs", what="where")
        values = wanted if isinstance(wanted, list) else [wanted]
        fit = np.logical_or.reduce([_equals(runs[column], value) for value in values])
        if not fit.any():
            there = list(dict.fromkeys(_value(value) for value in runs[column]))
            raise spec.refuse(f"no case has {column} = {wanted!r}; the cases left have {_listing(there)}")
        runs = runs[fit]
    return runs


def labelled(spec: BaseFigure, cases: pd.DataFrame, one_case: bool) -> list[tuple[str, pd.DataFrame]]:
    """The cases group by group, in their order, each with the words that tell it apart."""
    by = list(spec.group)
    for column in by:
        _require(spec, column, cases, "runs", what="group")
    if not by and one_case and len(cases) > 1:
        by = _differing(cases) or ["case"]
    if not by:
        return [("", cases)]
    groups: dict[tuple[str, ...], list[int]] = {}
    for position, values in enumerate(cases[by].itertuples(index=False, name=None)):
        groups.setdefault(tuple(map(str, values)), []).append(position)
    found = []
    for positions in groups.values():
        members = cases.iloc[positions]
        label = _label({column: members[column].iloc[0] for column in by})
        if one_case and len(members) > 1:
            raise spec.refuse(
                f"group = {by} leaves {len(members)} cases under the one label {label!r}; "
                f"they differ in {_listing(_differing(members))}: add one to `group`, or choose with `where`"
            )
        found.append((label, members))
    return found


def _differing(cases: pd.DataFrame) -> list[str]:
    """Parameters that are not the same in all cases."""
    return [str(name) for name in cases if name not in RUNS and len({str(value) for value in cases[name]}) > 1]


def _label(parameters: Mapping[str, Any]) -> str:
    """{"solver.kind": "anm", "solver.order": 20} -> "anm, order 20"."""
    last = [name.rpartition(".")[2] for name in parameters]
    words = []
    for name, short in zip(parameters, last, strict=True):
        value = parameters[name]
        called = (short if last.count(short) == 1 else name).replace("_", " ")
        if isinstance(value, (bool, np.bool_)):
            words.append(called if value else f"no {called}")
        elif isinstance(value, str):
            words.append(value)
        elif not (value is None or (np.ndim(value) == 0 and pd.isna(value))):
            words.append(f"{called} {_number(value)}")
    return ", ".join(words)


def _number(value: Any) -> str:
    """20 -> "20", 1e-6 -> "$10^{-6}$"."""
    if np.ndim(value):
        return "(" + ", ".join(map(_number, value)) + ")"
    text = f"{value:.6g}" if isinstance(value, (int, float, np.number)) else str(value)
    match = re.fullmatch(r"(-?[\d.]+)e([+-]\d+)", text)
    if match is None and re.fullmatch(r"0\.000\d+", text):
        match = re.fullmatch(r"(-?[\d.]+)e([+-]\d+)", re.sub(r"\.?0*e", "e", f"{value:.5e}"))
    if match is None:
        return text
    mantissa, power = match[1], int(match[2])
    return f"$10^{{{power}}}$" if mantissa == "1" else rf"${mantissa}\times 10^{{{power}}}$"


def _value(value: Any) -> str:
    return repr(value.item() if isinstance(value, np.generic) else value)


def _equals(column: pd.Series, value: Scalar) -> NDArray[np.bool_]:
    if isinstance(value, str):
        return column.astype(str).to_numpy() == value
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(float, na_value=np.nan)
    return np.isclose(numbers, float(value), rtol=1e-9, atol=0)


def _require(spec: BaseFigure, column: str, frame: pd.DataFrame, source: str, what: str = "column") -> None:
    if column in frame:
        return
    near = get_close_matches(column, [str(name) for name in frame], n=3)
    there = f"the nearest are {_listing(near)}" if near else f"there are {_listing([str(name) for name in frame])}"
    raise spec.refuse(f"{what} {column!r} is not in `{source}`; {there}")


def _listing(names: Sequence[str], most: int = 12) -> str:
    shown = ", ".join(names[:most]) or "none"
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"


def _ending(run: pd.Series) -> str:
    """The status of a case that did not converge; empty for one that did."""
    status = str(run.get("status", Status.CONVERGED.word))
    return "" if status == Status.CONVERGED.word else status


# Words on axes


def axis_label(columns: Sequence[str], source: Literal["runs", "steps", "fields"] | str) -> str:
    """Symbols and unit, e.g. "$u$, $v$ [mm/s]"."""
    descriptions = {"runs": RUNS, "steps": STEPS, "fields": FIELDS}[source]
    found = [re.search(r"\[[^\]]+\](?!.*\[)", descriptions.get(column, "")) for column in columns]
    units = [match[0] if match else "" for match in found]
    names = [SYMBOLS.get(column, _plain(column)) for column in columns]
    if len(set(units)) == 1:
        return f"{', '.join(names)} {units[0]}".strip()
    return ", ".join(f"{name} {unit}".strip() for name, unit in zip(names, units, strict=True))


def _plain(column: str) -> str:
    return column.rpartition(".")[2].replace("_", " ")


def _join(*parts: str | None) -> str:
    return ", ".join(filter(None, parts))


# Snapshots and triangles


@dataclass(frozen=True)
class _Snapshot:
    """The nodes of one case at one recorded time; no rows when the case left none."""

    label: str
    note: str
    rows: pd.DataFrame

    @property
    def heading(self) -> str:
        return f"{self.label} ({self.note})" if self.label and self.note else self.label or self.note


def _snapshots(spec: _Snapshots, frames: Frames, columns: Sequence[str]) -> list[_Snapshot]:
    """A snapshot a chosen case; at least one of them has numbers in every one of the columns."""
    fields = frames.fields
    for column in columns:
        _require(spec, column, fields, "fields")
    snapshots = []
    for label, runs in labelled(spec, select(spec, frames.runs), one_case=True):
        run = runs.iloc[0]
        rows = fields[fields["case"] == run["case"]]
        rows = rows[np.isfinite(rows[["x", "y"]].to_numpy(float)).all(axis=1)]
        notes = [_ending(run)]
        if len(rows):
            times = rows["time"].fillna(0.0).to_numpy(float)
            chosen = times.max() if spec.time is None else times[np.abs(times - spec.time).argmin()]
            if spec.time is not None and abs(chosen - spec.time) > _half_increment(run, spec.time):
                notes.append(f"$t$ = {chosen:.4g} s, nearest to {spec.time:.4g} s")
            rows = rows[times == chosen]
        if len(rows) < 3 or not np.isfinite(rows[list(columns)].to_numpy(float)).any(axis=0).all():
            rows = rows.iloc[:0]
        snapshots.append(_Snapshot(label, _join(*notes), rows))
    if all(snapshot.rows.empty for snapshot in snapshots):
        times = ", ".join(f"{time:.6g}" for time in sorted(fields["time"].dropna().unique())[:12]) or "none"
        asked = "the last time" if spec.time is None else f"time = {spec.time:g} s"
        raise spec.refuse(
            f"no chosen case has nodes with numbers in {_listing(columns)} near {asked}; recorded times [s]: {times}"
        )
    return snapshots


def _half_increment(run: pd.Series, time: float) -> float:
    increment = pd.to_numeric(run.get("scene.increment", np.nan), errors="coerce")
    return (0.5 if np.isfinite(increment) else 1e-9) * float(increment if np.isfinite(increment) else time) * (1 + 1e-6)


def _boundaries(rows: pd.DataFrame) -> NDArray[Any]:
    return rows["boundary"].astype(object).fillna("").astype(str).to_numpy()


def triangulate(rows: pd.DataFrame, value: Array | None = None) -> Triangulation:
    """Delaunay triangles of the cloud. Masked: those between nodes of one boundary group (holes, and slivers along the
    hull), those without area, and those with a node whose value is not finite."""
    x, y = rows["x"].to_numpy(float), rows["y"].to_numpy(float)
    triangulation = Triangulation(x, y)
    corners = triangulation.triangles
    group = _boundaries(rows)[corners]
    hole = (group[:, 0] != "") & (group == group[:, :1]).all(axis=1)
    (ax, bx, cx), (ay, by, cy) = x[corners].T, y[corners].T
    area = np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    flat = area <= 1e-12 * np.ptp(x) * np.ptp(y)
    unknown = ~np.isfinite(value[corners]).all(axis=1) if value is not None else np.zeros(len(corners), dtype=bool)
    triangulation.set_mask(hole | flat | unknown)
    return triangulation


def outline(triangulation: Triangulation) -> Array:
    """Edges of a single unmasked triangle, shape (E, 2, 2): the walls."""
    corners = triangulation.get_masked_triangles()
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    pairs, counts = np.unique(edges, axis=0, return_counts=True)
    return np.stack([triangulation.x, triangulation.y], axis=1)[pairs[counts == 1]]


def slice_triangles(triangulation: Triangulation, along: Array, across: Array, value: Array) -> tuple[Array, Array]:
    """The piecewise linear interpolant of nodal values on the line across = 0: places and values, NaN between pieces.

    Every crossed triangle contributes its straight piece, so the result is exact whatever the resolution of the cloud;
    sampling would miss the thin layer at a tool.
    """
    corners = triangulation.get_masked_triangles()
    start, end = corners, np.roll(corners, -1, axis=1)
    a, b = across[start], across[end]
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(a == b, np.where(a == 0, 0.0, np.nan), a / (a - b))
    fraction[(fraction < 0) | (fraction > 1)] = np.nan
    crossed = np.isfinite(fraction).sum(axis=1) >= 2
    start, end, fraction = start[crossed], end[crossed], fraction[crossed]
    place = along[start] + fraction * (along[end] - along[start])
    height = value[start] + fraction * (value[end] - value[start])
    if not len(place):
        return np.empty(0), np.empty(0)
    rows = np.arange(len(place))
    first, last = np.nanargmin(place, axis=1), np.nanargmax(place, axis=1)
    pieces = sorted(
        zip(place[rows, first], place[rows, last], height[rows, first], height[rows, last], strict=True),
        key=lambda piece: (piece[0], piece[1]),
    )
    gap = 1e-9 * float(np.ptp(along))
    places, heights = [pieces[0][0]], [pieces[0][2]]
    for left, right, left_height, right_height in pieces:
        if left > places[-1] + gap:
            places += [np.nan, left]
            heights += [np.nan, left_height]
        if right > places[-1] + gap:
            places.append(right)
            heights.append(right_height)
    return np.array(places), np.array(heights)


# Paper, axes, legends


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


def _curve_style(number: int, points: int, markers: bool, dashes: str = "-") -> dict[str, Any]:
    style: dict[str, Any] = {"color": COLOURS[number % len(COLOURS)], "linestyle": dashes}
    if number >= len(COLOURS):
        style["linestyle"] = DASHES[number // len(COLOURS) % len(DASHES)]
    if markers:
        style |= {"marker": MARKERS[number % len(MARKERS)], "markerfacecolor": "white", "markeredgewidth": 0.8}
        if points > MANY_POINTS:
            step = points // 8
            style["markevery"] = (step * (number % 5) // 5, step)
    return style


def _finish(figure: Figure, axes: Axes, title: str | None, width: float) -> None:
    """Title, and the legend above the axes, where it covers nothing."""
    axes.grid(True, color="0.92", linewidth=0.5)
    axes.set_axisbelow(True)
    if title:
        axes.set_title(title)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        _legend_above(figure, handles, labels, width)


def _legend_above(figure: Figure, handles: Sequence[Any], labels: Sequence[str], width: float) -> None:
    longest = max(len(re.sub(r"\\[a-z]+|[${}_^]", "", label)) for label in labels)
    columns = max(1, min(len(labels), int((width / MILLIMETRE - 4) // (1.35 * longest + 10))))
    rows = -(-len(labels) // columns)
    columns = -(-len(labels) // rows)
    figure.set_figheight(figure.get_figheight() + 4 * rows * MILLIMETRE)
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


def _panels(
    figure: Figure,
    spec: _Snapshots,
    snapshots: Sequence[_Snapshot],
    window: tuple[float, float, float, float] | None,
    bar: bool,
) -> list[tuple[Axes, _Snapshot]]:
    """An equal-aspect panel a case, on paper of the right shape; returns those that have nodes."""
    if len(snapshots) > MOST_PANELS:
        raise spec.refuse(f"{len(snapshots)} cases are too many panels; choose at most {MOST_PANELS} with `where`")
    places = np.concatenate([snapshot.rows[["x", "y"]].to_numpy(float) for snapshot in snapshots])
    if window is None:
        (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
        margin = 0.03 * max(right - left, top - bottom)
        window = (left - margin, right + margin, bottom - margin, top + margin)
    left, right, bottom, top = window
    if not (left < right and bottom < top):
        raise spec.refuse(f"window = {window} is empty; it is xmin, xmax, ymin, ymax with xmin < xmax and ymin < ymax")
    columns = len(snapshots) if len(snapshots) < 4 else 2 if len(snapshots) == 4 else 3
    rows = -(-len(snapshots) // columns)
    width = COLUMN if columns == 1 else PAGE
    side = (width - (18 if bar else 0) * MILLIMETRE - 10 * MILLIMETRE) / columns
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
        if number // columns == rows - 1:
            axes.set_xlabel(axis_label(["x"], "fields"))
        if number % columns == 0:
            axes.set_ylabel(axis_label(["y"], "fields"))
        if snapshot.heading and len(snapshots) > 1:
            axes.set_title(snapshot.heading)
        if snapshot.rows.empty:
            axes.text(0.5, 0.5, "no values", transform=axes.transAxes, ha="center", va="center", color="0.4")
        else:
            drawn.append((axes, snapshot))
    if len(snapshots) == 1 and _join(spec.title, snapshots[0].note):
        grid.flat[0].set_title(_join(spec.title, snapshots[0].note))
    elif spec.title:
        figure.suptitle(spec.title, fontsize=9)
    return drawn


def _marker_size(axes: Axes, places: Array) -> float:
    """Diameter in points: half the typical distance between neighbours as it will be printed."""
    spacing = float(np.median(cKDTree(places).query(places, 2)[0][:, 1]))
    left, right = axes.get_xlim()
    figure = axes.get_figure()
    assert isinstance(figure, Figure)
    columns = axes.get_gridspec().ncols  # type: ignore[union-attr]
    printed = 0.8 * figure.get_figwidth() / columns * 72 / (right - left) * spacing
    return float(np.clip(0.55 * printed, 0.5, 4))
