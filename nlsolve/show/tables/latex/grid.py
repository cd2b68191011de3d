"""A filled table as a paper shows it: headings in words and symbols, cells as text, before it is laid out."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from nlsolve.results.aggregates import NO_RUN
from nlsolve.results.columns import RUNS
from nlsolve.results.parameters import LETTERS
from nlsolve.results.verdicts import number
from nlsolve.show.figures.style import symbol
from nlsolve.show.provenance import digest_of
from nlsolve.show.tables.latex.words import NUMBER, Words, of_symbol, of_text, of_value
from nlsolve.show.tables.numbers import FIXED, alike
from nlsolve.show.tables.spec import Align, TableSpec

PERCENT = re.compile(rf"({NUMBER.pattern})%")


@dataclass(frozen=True)
class GridColumn:
    """A column of a grid.

    heads : its headings from top to bottom; equal ones of neighbours are one heading above them all.
    cells : what is printed in its rows.
    align : where its cells stand; "number": by the points of those that are numbers.
    """

    heads: tuple[Words, ...]
    cells: tuple[str, ...]
    align: Align

    @cached_property
    def aligned(self) -> bool:
        """Whether its numbers stand by their points."""
        return self.align == "number" and any(NUMBER.fullmatch(cell) for cell in self.cells)


@dataclass(frozen=True)
class Grid:
    """A table as a paper shows it.

    labels : the columns that tell the rows apart, of one heading each.
    columns : the others, all with as many headings.
    above : what stands above all headings of `columns`: the value that the cells show, and by what.
    """

    caption: str
    notes: tuple[str, ...]
    labels: tuple[GridColumn, ...]
    columns: tuple[GridColumn, ...]
    above: Words

    @property
    def digest(self) -> str:
        """A digest of all that is told, and not of how it is laid out."""
        columns = [[[head.line for head in column.heads], column.cells] for column in (*self.labels, *self.columns)]
        return digest_of(json.dumps([self.caption, self.notes, columns, self.above.line]))


def grid_of(spec: TableSpec, cells: pd.DataFrame, shown: Sequence[str], notes: Sequence[str]) -> Grid:
    """The grid of a declared table with these cells, whose columns show the values named `shown`."""
    texts = _texts(spec, cells, shown)
    in_percent = {
        name
        for name in shown
        if (of := [text for text, by in zip(texts, shown, strict=True) if by == name])
        and any(PERCENT.fullmatch(cell) for column in of for cell in column)
        and not any(NUMBER.fullmatch(cell) for column in of for cell in column)
    }
    several = len(spec.shown) > 1
    heads = [
        [heading(spec, name, name in in_percent)] if not spec.columns else _heads(spec, cells.columns, key, in_percent)
        for key, name in zip(cells.columns, shown, strict=True)
    ]
    usual: Align = "number" if spec.paper is None else "left"
    columns = tuple(
        GridColumn(tuple(head), tuple(_without_percent(text, name in in_percent)), spec.align.get(name, usual))
        for head, text, name in zip(heads, texts, shown, strict=True)
    )
    labels = tuple(
        GridColumn((heading(spec, name),), tuple(_labels(spec, cells.index, level)), _of_labels(spec, cells, level))
        for level, name in enumerate(spec.row_names)
    )
    above = Words((), ())
    if spec.columns and not several and columns:
        by = [part for name in spec.columns for part in (Words((",",), (3.0,)), heading(spec, name))][1:]
        above = heading(spec, shown[0], shown[0] in in_percent) + of_text("by")
        for part in by:
            above = above.closed_by(part) if part.tex == (",",) else above + part
    return Grid(spec.caption, tuple(notes), labels, columns, above)


def heading(spec: TableSpec, name: str, in_percent: bool = False) -> Words:
    """What a paper prints above a column: its label, or its symbol, or its name; and its unit in brackets."""
    given = spec.labels.get(name)
    described = LETTERS.get(name) or RUNS.get(name)
    unit = spec.units.get(name) or ("%" if in_percent else described.unit if described else "")
    if given is not None:
        return of_text(given if "[" in given or not unit else f"{given} [{unit}]")
    known = of_symbol(LETTERS[name].symbol if name in LETTERS else symbol(name, "runs"))
    return known + of_text(f"[{unit}]" if unit else "")


def _heads(spec: TableSpec, header: pd.Index, key: Any, in_percent: set[str]) -> list[Words]:
    """The headings of a column that values of parameters tell from the others."""
    parts = key if isinstance(key, tuple) else (key,)
    heads = []
    for part, name in zip(parts, map(str, header.names), strict=True):
        if not name:
            heads.append(heading(spec, part, part in in_percent))
            continue
        word = of_value(_short(spec.word(part, name)))
        named = len(spec.shown) > 1 and not isinstance(part, str)
        heads.append(heading(spec, name) + of_text("=") + word if named else word)
    return heads


def _texts(spec: TableSpec, cells: pd.DataFrame, shown: Sequence[str]) -> list[list[str]]:
    """What is printed in the cells, column by column: numbers of one value in one form."""
    forms = {}
    for name in dict.fromkeys(shown):
        places = [place for place, by in enumerate(shown) if by == name]
        values = [number(value) * spec.factor(name) for place in places for value in cells.iloc[:, place]]
        values += [] if spec.paper is None else [each * spec.factor(name) for row in spec.paper.values for each in row]
        described = RUNS.get(name)
        forms[name] = alike(values, 3 if described is None else described.figures)

    def text(value: Any, place: int) -> str:
        name = shown[place]
        known = number(value) * spec.factor(name)
        free = not isinstance(value, bool) and not spec.has_form(name) and abs(known) < float("inf")
        return forms[name](known) if free else spec.text(value, name)

    if spec.paper is not None:
        return [list(column) for column in zip(*spec.paper.compare(cells.to_numpy(), text), strict=True)]
    return [[text(value, place) for value in cells.iloc[:, place]] for place in range(len(shown))]


def _labels(spec: TableSpec, index: pd.Index, level: int) -> list[str]:
    """The words of one column that tells rows apart."""
    name = spec.row_names[level]
    return [_short(spec.word(key[level] if isinstance(key, tuple) else key, name)) for key in index]


def _of_labels(spec: TableSpec, cells: pd.DataFrame, level: int) -> Align:
    """Where the words of such a column stand: numbers right, words left."""
    words = [word for word in _labels(spec, cells.index, level) if word != NO_RUN]
    given = spec.align.get(spec.row_names[level])
    if given in ("left", "center", "right"):
        return given
    return "right" if words and all(NUMBER.fullmatch(word) for word in words) else "left"


def _short(word: str) -> str:
    """A word, or a number without zeros behind its point: 0.0001 is 1e-04."""
    if not NUMBER.fullmatch(word) or not 0 < abs(float(word)) < 10.0 ** FIXED[0]:
        return word
    mantissa, _, exponent = f"{float(word):e}".partition("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{exponent}"


def _without_percent(texts: Sequence[str], in_percent: bool) -> list[str]:
    return [PERCENT.sub(r"\1", text) if in_percent and PERCENT.fullmatch(text) else text for text in texts]
