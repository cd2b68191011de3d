"""How figures look: paper, type, colours, words on axes, legends."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from nlsolve.results.columns import FRAMES
from nlsolve.show import plotting
from nlsolve.show.figures.paper.look import FONT_SIZE, MILLIMETRE, Look

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe & Ito 2008
DASHES: tuple[Any, ...] = (
    "-",
    "--",
    ":",
    "-.",
    (0, (5, 1.5, 1, 1.5, 1, 1.5)),
    (0, (9, 3)),
    (0, (1, 4)),
)
"""Lines that are told apart without their colours, a pattern each."""
MARKERS = ("o", "s", "^", "D", "v", "<", ">")
UPPER, LOWER, ACCENT = COLOURS[0], COLOURS[4], "#C00000"
SIGNED_MAP, POSITIVE_MAP, ERROR_MAP = "RdBu_r", "viridis", "YlGnBu"
MARK = 1.5  # width of a mark without a line in the legend, over the size of letters
FAILED = "not converged"  # last in every legend
IN_DOUBT = "in doubt by its audits"
MANY_POINTS = 40  # beyond, a curve carries a marker here and there only
LETTER, HANDLE = 1.35 / 8, 1.6  # widths of a letter, and of a line in the legend, over the size of letters [mm/pt]

FONTS: dict[str, tuple[list[str], str]] = {
    # the second family has the letters that the first lacks, such as ₀
    "serif": (["STIXGeneral", "DejaVu Serif"], "stix"),
    "sans-serif": (["DejaVu Sans"], "dejavusans"),
}
"""Families of letters, and the letters of mathematics that go with them, by what a study calls them."""


def style_of(look: Look) -> Any:
    """The settings of matplotlib that a look asks for."""
    size = look.font_size or FONT_SIZE
    small = size * 8 / 9
    families, mathematics = FONTS.get(look.font or "serif") or ([str(look.font), *FONTS["serif"][0]], "stix")
    return {
        "font.family": families,
        "font.size": size,
        "mathtext.fontset": mathematics,
        "axes.titlesize": size,
        "axes.labelsize": size,
        "figure.titlesize": size,
        "figure.labelsize": size,
        "axes.linewidth": 0.6,
        "axes.formatter.use_mathtext": True,
        "axes.formatter.limits": (-3, 5),
        "xtick.labelsize": small,
        "ytick.labelsize": small,
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
        "legend.fontsize": small,
        "legend.frameon": False,
        "legend.handlelength": 3.2,
        "legend.columnspacing": 1.2,
        "pdf.fonttype": 42,
        "svg.hashsalt": "nlsolve",  # the same identities in the file every time
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


def curve_style(number: int, points: int, markers: bool, line: int | None = None) -> dict[str, Any]:
    """Keywords of `Axes.plot` for one of several curves, which differs from the others in colour, line and marker.

    line : number of its pattern, where it is not that of the curve.
    """
    again = number // len(COLOURS)  # the next pattern for the next curve of the same colour
    pattern = (number if line is None else line) + again
    style: dict[str, Any] = {"color": COLOURS[number % len(COLOURS)], "linestyle": DASHES[pattern % len(DASHES)]}
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
        axes.set_title(headed(figure, title))
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        order = sorted(range(len(labels)), key=lambda number: labels[number] == FAILED)
        legend_outside(figure, [handles[number] for number in order], [labels[number] for number in order])


def legend_outside(figure: plotting.Figure, handles: Sequence[Any], labels: Sequence[str], edge: str = "upper") -> None:
    """Add a legend at the edge of the paper, in as many columns as fit; the paper grows by its rows.

    A label that is wider than the paper goes on in a further line.
    """
    size = float(plotting.rcParams["legend.fontsize"])
    width = figure.get_figwidth() / MILLIMETRE - 4
    room = int((width - HANDLE * size) / (LETTER * size))
    labels = [wrapped(label, room) for label in labels]
    longest = max(letters(line) for label in labels for line in label.split("\n"))
    columns = max(1, min(len(labels), int(width // (LETTER * size * longest + HANDLE * size))))
    rows = -(-len(labels) // columns)
    columns = -(-len(labels) // rows)
    lines = rows + max(label.count("\n") for label in labels) * rows
    figure.set_figheight(figure.get_figheight() + 0.575 * size * lines * MILLIMETRE)
    place: Any = f"outside {edge} center"
    lined = any(isinstance(handle, plotting.Line2D) and handle.get_linestyle() != "None" for handle in handles)
    figure.legend(handles, labels, loc=place, ncols=columns, handlelength=None if lined else MARK)


def wrapped(text: str, room: int) -> str:
    """A text on lines of at most so many letters, broken between words; mathematics stays whole."""
    lines: list[str] = []
    for word in re.findall(r"(?:\$[^$]*\$|[^\s$]|\$)+", text):
        if lines and letters(f"{lines[-1]} {word}") <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)


def headed(figure: plotting.Figure, text: str, share: float = 1.0) -> str:
    """A title over a share of the width of a figure, on as many lines as it needs."""
    width = share * (figure.get_figwidth() / MILLIMETRE - 8)
    return wrapped(text, int(width / (LETTER * float(plotting.rcParams["axes.titlesize"]))))


def letters(label: str) -> int:
    """How many letters of a label are printed, without the commands of its mathematics."""
    return len(re.sub(r"\\[a-z]+|[${}_^]", "", label))
