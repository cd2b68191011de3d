"""How figures look: paper, type, colours, words on axes, legends."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from nlsolve.results.columns import FRAMES
from nlsolve.show import plotting

MILLIMETRE = 1 / 25.4  # [inch]
COLUMN, PAGE = 90 * MILLIMETRE, 180 * MILLIMETRE  # widths of one and of two columns of a journal
DOTS_PER_INCH = 200
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe & Ito 2008
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "<", ">")
UPPER, LOWER, ACCENT = COLOURS[0], COLOURS[4], "#C00000"
ERROR_MAP = "YlGnBu"
FAILED = "not converged"  # last in every legend
IN_DOUBT = "in doubt by its audits"
MANY_POINTS = 40  # beyond, a curve carries a marker here and there only

STYLE: Any = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],  # the second has the letters the first lacks, such as ₀
    "font.size": 9,
    "mathtext.fontset": "stix",
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.linewidth": 0.6,
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


def symbol(column: str, frame: str) -> str:
    """What an axis calls a column of `runs`, `steps` or `fields`: its symbol, or its own name in words."""
    known = FRAMES[frame].get(column)
    in_words = column.removesuffix(".kind").rpartition(".")[2].replace("_", " ")
    return known.symbol or in_words if known else in_words


def axis_label(columns: Sequence[str], frame: str) -> str:
    """Symbols and unit of columns of `runs`, `steps` or `fields`, e.g. "$u$, $v$ [mm/s]"."""
    units = [FRAMES[frame][column].unit if column in FRAMES[frame] else "" for column in columns]
    brackets = [f" [{unit}]" if unit else "" for unit in units]
    names = [symbol(column, frame) for column in columns]
    if len(set(units)) == 1:
        return f"{', '.join(names)}{brackets[0]}"
    return ", ".join(f"{name}{bracket}" for name, bracket in zip(names, brackets, strict=True))


def join(*parts: str | None) -> str:
    """The parts that are not empty, with commas between."""
    return ", ".join(filter(None, parts))


def bracketed(label: str, note: str) -> str:
    """A label with a note in brackets, or the one of them that is not empty."""
    return f"{label} ({note})" if label and note else label or note


def curve_style(number: int, points: int, markers: bool, dashes: str = "-") -> dict[str, Any]:
    """Keywords of `Axes.plot` for one of several curves; colours first, dashes when they are used up."""
    style: dict[str, Any] = {"color": COLOURS[number % len(COLOURS)], "linestyle": dashes}
    if number >= len(COLOURS):
        style["linestyle"] = DASHES[number // len(COLOURS) % len(DASHES)]
    if markers:
        style |= {"marker": MARKERS[number % len(MARKERS)], "markerfacecolor": "white", "markeredgewidth": 0.8}
        if points > MANY_POINTS:
            step = points // 8
            style["markevery"] = (step * (number % 5) // 5, step)
    return style


def finish(figure: plotting.Figure, axes: plotting.Axes, title: str | None) -> None:
    """Add grid, title, and a legend above the axes."""
    axes.grid(True, color="0.92", linewidth=0.5)
    axes.set_axisbelow(True)
    if title:
        axes.set_title(title)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        order = sorted(range(len(labels)), key=lambda number: labels[number] == FAILED)
        legend_outside(figure, [handles[number] for number in order], [labels[number] for number in order])


def legend_outside(figure: plotting.Figure, handles: Sequence[Any], labels: Sequence[str], edge: str = "upper") -> None:
    """Add a legend at the edge of the paper, in as many columns as fit; the paper grows by its rows."""
    longest = max(map(letters, labels))
    width = figure.get_figwidth() / MILLIMETRE
    columns = max(1, min(len(labels), int((width - 4) // (1.35 * longest + 10))))
    rows = -(-len(labels) // columns)
    columns = -(-len(labels) // rows)
    figure.set_figheight(figure.get_figheight() + 4.6 * rows * MILLIMETRE)
    place: Any = f"outside {edge} center"
    figure.legend(handles, labels, loc=place, ncols=columns)


def letters(label: str) -> int:
    """How many letters of a label are printed, without the commands of its mathematics."""
    return len(re.sub(r"\\[a-z]+|[${}_^]", "", label))
