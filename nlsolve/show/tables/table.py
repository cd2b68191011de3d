"""A table of results as text: for a terminal, Markdown, LaTeX, CSV and JSON."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import pandas as pd
from rich.markup import escape
from rich.table import Table as RichTable

from nlsolve.results.frames import json_rows
from nlsolve.show.provenance import Provenance
from nlsolve.show.tables.latex.floats import latex, packages_of
from nlsolve.show.tables.latex.grid import Grid, grid_of
from nlsolve.show.tables.markdown import escaped
from nlsolve.show.tables.spec import TableSpec, written

Side = Literal["left", "center", "right"]


@dataclass(frozen=True)
class Table:
    """A declared table, filled.

    cells : numbers and words of runs, the status of a run that failed, NaN where there is no run.
    comparison : "measured (paper) verdict" in the same layout; None without paper values.
    notes : sentences that stand beneath: those declared, and where its seconds come from.
    """

    spec: TableSpec
    cells: pd.DataFrame
    comparison: pd.DataFrame | None = None
    notes: tuple[str, ...] = ()

    @property
    def shown(self) -> list[str]:
        """For each column the name of what it shows."""
        return shown_in(self.spec, self.cells.columns)

    @property
    def words(self) -> pd.DataFrame:
        """The cells as printed."""
        columns = [
            [self.spec.text(value, name) for value in self.cells.iloc[:, place]]
            for place, name in enumerate(self.shown)
        ]
        rows = list(zip(*columns, strict=True)) if columns else [()] * len(self.cells)
        return pd.DataFrame(rows, index=self.cells.index, columns=self.cells.columns, dtype=object)

    def files(self, provenance: Provenance | None = None) -> dict[str, str]:
        """The texts that are written to files, by the ending of the file's name."""
        texts = {".csv": self.csv(), ".md": self.markdown(), ".tex": self.latex(provenance)}
        if self.comparison is not None:
            texts["-paper.csv"] = _flat(self.comparison, str, written).to_csv(index=False)
        return texts

    def csv(self) -> str:
        """The cells at full precision, under the names of their columns."""
        return _flat(self.cells, str, written).to_csv(index=False)

    def long(self) -> list[dict[str, Any]]:
        """For JSON: an object a row, null where there is no run."""
        return json_rows(_flat(self.cells, str, written))

    def frames(self) -> dict[str, pd.DataFrame]:
        """Title -> frame of words: the table under its caption, then its comparison under the paper's name."""
        title = self.spec.caption or self.spec.name
        if len(self.spec.shown) == 1 and self.spec.columns:
            title += self.spec.bracket(self.spec.shown[0])
        frames = {title: self.words}
        if self.comparison is not None and self.spec.paper is not None:
            frames[f"{self.spec.name}: measured ({self.spec.paper.source}) verdict"] = self.comparison
        return {title: self._labelled(frame) for title, frame in frames.items()}

    def flat(self) -> dict[str, pd.DataFrame]:
        """What `frames` holds, the labels of rows as columns."""
        return {title: _flat(frame, str, str) for title, frame in self.frames().items()}

    def rich(self) -> list[RichTable]:
        """What `frames` holds, for a terminal, the notes beneath."""
        tables = [_rich(title, frame, self._sides()) for title, frame in self.flat().items()]
        tables[-1].caption = escape("\n".join(self.notes)) or None
        return tables

    def markdown(self) -> str:
        """What `frames` holds, as GitHub writes tables, the notes beneath."""
        parts = [
            flat.map(escaped)
            .set_axis(list(map(escaped, flat.columns)), axis=1)
            .to_markdown(index=False, disable_numparse=True, colalign=self._sides())
            for flat in self.flat().values()
        ]
        return "\n\n".join([*parts, *map(escaped, self.notes)]) + "\n"

    def grid(self) -> Grid:
        """What a paper shows: the comparison, or the cells where there is none."""
        return grid_of(self.spec, self.cells, self.shown, self.notes)

    def latex(self, provenance: Provenance | None = None) -> str:
        """What a paper shows, in LaTeX that fits into a column; what it comes from and what it needs as comments."""
        grid = self.grid()
        body = latex(self.spec, grid)
        if provenance is None:
            return body
        return provenance.of("table", self.spec.name, grid.digest).around(body, packages_of(self.spec))

    def _labelled(self, frame: pd.DataFrame) -> pd.DataFrame:
        """A frame whose rows and columns are called as the declaration says."""
        index, header = self._renamed(frame.index), self._renamed(frame.columns)
        return pd.DataFrame(frame.to_numpy(dtype=object), index=index, columns=header, dtype=object)

    def _renamed(self, axis: pd.Index) -> pd.Index:
        """The labels of an axis in words, which depend on the name of their level."""
        names = [str(name) for name in axis.names]
        keys = [key if isinstance(key, tuple) else (key,) for key in axis]
        words = [tuple(self.spec.word(part, name) for part, name in zip(key, names, strict=True)) for key in keys]
        headings = tuple(self.spec.heading(name) if name else name for name in names)
        if isinstance(axis, pd.MultiIndex):
            return pd.MultiIndex.from_tuples(words, names=headings)
        return pd.Index([word for (word,) in words], name=headings[0], dtype="object")

    def _sides(self) -> list[Side]:
        """At which side the cells of each column stand in a text, the labels of the rows first."""
        given = self.spec.align
        left: list[Side] = [_side(given.get(name, "left")) for name in self.spec.row_names]
        return left + [_side(given.get(name, "number")) for name in self.shown]


def shown_in(spec: TableSpec, header: pd.Index) -> list[str]:
    """For each column of a table the name of what it shows."""
    several = len(spec.shown) > 1 or not spec.columns
    return [(key[-1] if isinstance(key, tuple) else key) if several else spec.shown[0] for key in header]


def _side(align: str) -> Side:
    return "left" if align == "left" else "center" if align == "center" else "right"


def _flat(frame: pd.DataFrame, heading: Callable[[Any], str], word: Callable[[Any], str]) -> pd.DataFrame:
    """The frame with its row labels as columns, and with one text a column label."""
    names = [heading(name) for name in frame.columns.names if name]
    prefix = f"{', '.join(names)} = " if names and not isinstance(frame.columns, pd.MultiIndex) else ""
    labels = [
        prefix + " · ".join(word(part) for part in (key if isinstance(key, tuple) else (key,)) if part != "")
        for key in frame.columns
    ]
    keys = [[word(part) for part in (key if isinstance(key, tuple) else (key,))] for key in frame.index]
    rows = [[*key, *row] for key, row in zip(keys, frame.to_numpy(dtype=object), strict=True)]
    header = pd.Index([*map(heading, frame.index.names), *labels])
    return pd.DataFrame(rows, columns=header, dtype=object)


def _rich(title: str, flat: pd.DataFrame, sides: list[Side]) -> RichTable:
    table = RichTable(title=escape(title))
    for name, side in zip(flat.columns, sides, strict=True):
        table.add_column(escape(name), justify=side)
    for row in flat.itertuples(index=False):
        table.add_row(*map(escape, row))
    return table
