"""Text -> Markdown that shows every letter of it, within a cell of a table too."""

from __future__ import annotations

import re

SPECIAL = re.compile(r"[\\|`*<>$~]|(?<!\w)_|_(?!\w)|&(?=#?\w+;)|\[(?=\^)|\](?=[(\[:])")
"""Letters that begin or end something in Markdown as GitHub reads it. A line within a word is none, and a bracket only
that of a link."""


def escaped(text: str) -> str:
    """A text on one line in which Markdown sees words only."""
    return SPECIAL.sub(lambda found: f"\\{found[0]}", " ".join(str(text).split()))
