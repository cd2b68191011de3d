"""A table of results as text: for a terminal, Markdown, LaTeX, CSV and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd
from rich.markup import escape
from rich.table import Table as RichTable

from nlsolve.results.frames import json_rows
from nlsolve.show.tables.spec import TableSpec


@dataclass(frozen=True)
class Table:
    """A declared table, filled.

    cells : numbers and words of runs, the status of a run that failed, NaN where there is no run.
    comparison : "measured (paper) verdict" in the same layout; None without paper values.
    notes : sentences that stand beneath, on where its seconds come from.
    """

    spec: TableSpec
    cells: pd.DataFrame
    comparison: pd.DataFrame | None = None
    notes: tuple[str, ...] = ()

    @property
    def words(self) -> pd.DataFrame:
        """The cells as printed."""
        return self.cells.map(self.spec.text)

    def files(self) -> dict[str, str]:
        """The texts that are written to files, by the ending of the file's name."""
        texts = {".csv": self.csv(), ".md": self.markdown(), ".tex": self.latex()}
        if self.comparison is not None:
            texts["-paper.csv"] = _flat(self.comparison).to_csv(index=False)
        return texts

    def csv(self) -> str:
        """The cells at full precision, with labels of rows and columns."""
        return _flat(self.cells).to_csv(index=False)

    def long(self) -> list[dict[str, Any]]:
        """For JSON: an object a row, null where there is no run."""
        return json_rows(_flat(self.cells))

    def frames(self) -> dict[str, pd.DataFrame]:
        """Title -> frame of words: the table under its caption, then its comparison under the paper's name."""
        frames = {self.spec.caption or self.spec.name: self.words}
        if self.comparison is not None and self.spec.paper is not None:
            frames[f"{self.spec.name}: measured ({self.spec.paper.source}) verdict"] = self.comparison
        return {title: frame.rename(index=_word, columns=_word) for title, frame in frames.items()}

    def flat(self) -> dict[str, pd.DataFrame]:
        """What `frames` holds, the labels of rows as columns."""
        return {title: _flat(frame) for title, frame in self.frames().items()}

    def rich(self) -> list[RichTable]:
        """What `frames` holds, for a terminal, the notes beneath."""
        tables = [_rich(title, frame) for title, frame in self.frames().items()]
        tables[-1].caption = escape("\n".join(self.notes)) or None
        return tables

    def markdown(self) -> str:
        """What `frames` holds, as GitHub writes tables, the notes beneath."""
        parts = [_flat(frame).to_markdown(index=False, disable_numparse=True) for frame in self.frames().values()]
        return "\n\n".join([*parts, *self.notes]) + "\n"

    def latex(self) -> str:
        """A captioned booktabs table of the comparison, or of the cells where there is none; the notes as comments."""
        frame = self.words if self.comparison is None else self.comparison
        frame = frame.rename(index=_word, columns=_word).rename_axis(index=_escaped, columns=_escaped)
        styler = frame.style.format(escape="latex").format_index(escape="latex", axis=0)
        styler = styler.format_index(escape="latex", axis=1)
        text = styler.to_latex(hrules=True, caption=_escaped(self.spec.caption) or None, label=f"tab:{self.spec.name}")
        return text + "".join(f"% {note}\n" for note in self.notes)


def _flat(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with its row labels as columns, and with one text a column label."""
    names = [str(name) for name in frame.columns.names if name]
    flat = frame.reset_index()
    labels = [
        " · ".join(_word(part) for part in (key if isinstance(key, tuple) else (key,)) if part != "") for key in flat
    ]
    depth = frame.index.nlevels
    prefix = f"{', '.join(names)} = " if names and not isinstance(frame.columns, pd.MultiIndex) else ""
    flat.columns = pd.Index([*labels[:depth], *(prefix + label for label in labels[depth:])])
    for name in labels[:depth]:
        flat[name] = flat[name].map(_word)
    return flat


def _word(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _rich(title: str, frame: pd.DataFrame) -> RichTable:
    flat = _flat(frame)
    table = RichTable(title=escape(title))
    for position, name in enumerate(flat.columns):
        table.add_column(escape(name), justify="left" if position < frame.index.nlevels else "right")
    for row in flat.itertuples(index=False):
        table.add_row(*map(escape, row))
    return table


def _escaped(text: Any) -> str:
    """Text whose special letters LaTeX prints."""
    special = {"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"}
    return "".join(special.get(letter, letter) for letter in str(text or ""))
