"""A figure whose texts are LaTeX, for PGF: every letter of them is printed by the engine and the fonts of the paper."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from nlsolve.show import plotting
from nlsolve.show.tables.latex.words import escaped

ENGINES = ("pdflatex", "lualatex", "xelatex")
PREAMBLE = r"""% What figures in PGF need: \input{preamble} before \begin{document}, or copy the lines.
\usepackage{pgf}
\providecommand{\mathdefault}[1]{#1}
"""

MATHEMATICS = re.compile(r"(?<!\\)\$(?:[^$\\]|\\.)*\$")


def engine() -> str | None:
    """An engine of TeX that is installed here, by which texts are measured."""
    return next((name for name in ENGINES if shutil.which(name)), None)


def in_tex(text: str) -> str:
    r"""A text of matplotlib in LaTeX: "η, $10^{-3}$" becomes "\ensuremath{\eta}, $10^{-3}$"."""
    if "\n" in text:
        return "\n".join(map(in_tex, text.split("\n")))
    if text.replace(r"\$", "").count("$") % 2:  # a dollar without its partner is a letter
        return _words(text)
    parts = MATHEMATICS.split(text)
    inside = [_mathematics(part) for part in MATHEMATICS.findall(text)] + [""]
    return "".join(_words(part.replace(r"\$", "$")) + math for part, math in zip(parts, inside, strict=True))


def _words(text: str) -> str:
    return escaped(text).replace(r"\$", r"\textdollar{}")  # matplotlib takes \$ for a dollar that it has to escape


def _mathematics(text: str) -> str:
    """Mathematics of matplotlib, whose Greek letters may be typed as they are."""
    return "".join(letter if letter.isascii() else escaped(letter) for letter in text)


@contextmanager
def texts_in_tex(figure: plotting.Figure, family: str) -> Iterator[None]:
    """Within, all texts of a figure are LaTeX in this family of fonts: serif or sans-serif."""
    texts = [(text, text.get_text(), text.get_fontfamily()) for text in figure.findobj(plotting.Text)]
    axes = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    formatters = dict.fromkeys(f for axis in axes for f in (axis.get_major_formatter(), axis.get_minor_formatter()))
    for text, before, _ in texts:
        text.set_text(in_tex(before))
        text.set_fontfamily(family)
    for formatter in formatters:  # the texts of ticks are made when they are drawn
        own = vars(formatter)
        own["format_ticks"] = _of_ticks(formatter.format_ticks)
        own["get_offset"] = _of_offset(formatter.get_offset)
    try:
        yield
    finally:
        for formatter in formatters:
            del vars(formatter)["format_ticks"], vars(formatter)["get_offset"]
        for text, before, fonts in texts:
            text.set_text(before)
            text.set_fontfamily(fonts)


def _of_ticks(format_ticks: Callable[[Any], Sequence[str]]) -> Callable[[Any], list[str]]:
    return lambda values: list(map(in_tex, format_ticks(values)))


def _of_offset(get_offset: Callable[[], str]) -> Callable[[], str]:
    return lambda: in_tex(get_offset())
