"""What notebooks show of a value, as HTML: facts by name, sentences, and frames. All text is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

import pandas as pd

MOST_ROWS = 60
"""Rows of a frame that a notebook shows; of a longer one, those at both ends."""


def facts(told: Mapping[str, str]) -> str:
    """A table of two columns: a name, and what is told of it."""
    row = "<tr><th style='text-align:left'>{}</th><td>{}</td></tr>".format
    rows = (row(escape(name), escape(text)) for name, text in told.items())
    return f"<table>{''.join(rows)}</table>"


def sentences(lines: Iterable[str]) -> str:
    """A paragraph for each sentence."""
    return "".join(f"<p>{escape(line)}</p>" for line in lines if line)


def frame(title: str, cells: pd.DataFrame) -> str:
    """A frame under its title."""
    body = cells.to_html(border=0, escape=True, na_rep="", max_rows=MOST_ROWS, float_format=lambda x: f"{x:.4g}")
    return f"<h4>{escape(title)}</h4>{body}"
