"""Docstrings of nlsolve for Sphinx, which reads reStructuredText: in them * is a product and |x| a modulus.

Words are escaped; what stands in backticks is code; "name : meaning" becomes an item of a list, and so does "- …"; what
is indented by four columns behind an empty line is code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

ITEM = re.compile(r"([\w*.]+(?:, [\w*.]+)*) : (.*)")
CODE = re.compile(r"(`+[^`]+`+)")


def words(line: str) -> str:
    """A line of words, with all that reStructuredText would read as markup escaped."""
    parts = CODE.split(line)
    return "".join(
        f"``{part.strip('`')}``\\ " if i % 2 else re.sub(r"([\\*`|_])", r"\\\1", part) for i, part in enumerate(parts)
    )


def restructured(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring in reStructuredText."""
    code = in_item = False
    for i, line in enumerate(lines):
        indented, after_gap = line.startswith("    "), i == 0 or not lines[i - 1].strip()
        if not line.strip():
            yield ""
        elif indented and (code or after_gap):
            if not code:
                yield from ("::", "")
            code = True
            yield line
        elif item := ITEM.fullmatch(line):
            if not in_item:
                yield ""
            code, in_item = False, True
            yield f"- {words(item[1])} : {words(item[2])}"
        elif line.startswith("- "):
            if not in_item:
                yield ""
            code, in_item = False, True
            yield f"- {words(line[2:])}"
        elif indented and in_item:
            yield f"  {words(line.strip())}"
        else:
            if in_item:
                yield ""
            code = in_item = False
            yield words(line.strip())


def rewrite(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Replace the lines of a docstring."""
    lines[:] = restructured(list(lines))


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", rewrite)
    return {"parallel_read_safe": True}
