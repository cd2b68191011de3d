"""Flow charts of Mermaid as SVG within the page, which then needs no script and no other site.

What is known of Mermaid is what the drawing of the packages needs: `flowchart TD`, and lines `upper --> lower`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise
from statistics import mean
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

ARROW = re.compile(r"(\w+) --> (\w+)")
HEAD = "flowchart TD"

WIDTH, HEIGHT, ACROSS, DOWN = 92, 26, 112, 58
"""Size of a box, and the distance of boxes beside and below each other [px]."""

SWEEPS = 8
"""How often each row is put in the order of the row above, then below."""

Place = tuple[str, int]
"""A box, or where a longer arrow passes a row: a name and the row."""

Way = tuple[Place, ...]
"""An arrow, from row to row."""


def arrows_in(text: str) -> list[tuple[str, str]]:
    """The arrows of a chart: (upper, lower). Raises ValueError for what is no such chart."""
    head, *lines = [line.strip() for line in text.splitlines() if line.strip()] or [""]
    found = [ARROW.fullmatch(line) for line in lines]
    if head != HEAD or None in found:
        wrong = head if head != HEAD else lines[found.index(None)]
        raise ValueError(f"only {HEAD!r} with lines 'upper --> lower' can be drawn, not {wrong!r}")
    return [(match[1], match[2]) for match in found if match]


def rows_of(arrows: Sequence[tuple[str, str]]) -> dict[str, int]:
    """Box -> its row: one below the lowest of those that lead to it. Raises ValueError where arrows go in a circle."""
    rows = dict.fromkeys((name for arrow in arrows for name in arrow), 0)
    for _ in range(len(rows) + 1):
        before = dict(rows)
        for upper, lower in arrows:
            rows[lower] = max(rows[lower], rows[upper] + 1)
        if rows == before:
            return rows
    raise ValueError("the arrows go in a circle")


def laid_out(arrows: Sequence[tuple[str, str]]) -> tuple[dict[Place, float], list[Way]]:
    """Where each box and each passage stands across [boxes, from the middle], and the way of each arrow."""
    rows = rows_of(arrows)
    ways = [
        (
            (upper, rows[upper]),
            *((f"{upper} {lower}", row) for row in range(rows[upper] + 1, rows[lower])),
            (lower, rows[lower]),
        )
        for upper, lower in arrows
    ]
    places = dict.fromkeys(place for way in [*(((name, row),) for name, row in rows.items()), *ways] for place in way)
    by_row = [[place for place in places if place[1] == row] for row in range(max(rows.values(), default=-1) + 1)]
    beside = [(one, other) for way in ways for one, other in pairwise(way)]
    across: dict[Place, float] = {}
    for sweep in range(2 * SWEEPS):
        for row in by_row[:: -1 if sweep % 2 else 1]:
            if sweep:
                wanted = {place: mean(_neighbours(place, beside, across) or [across[place]]) for place in row}
                row.sort(key=wanted.__getitem__)
            across |= {place: i - (len(row) - 1) / 2 for i, place in enumerate(row)}
    return across, ways


def _neighbours(place: Place, beside: Sequence[tuple[Place, Place]], across: dict[Place, float]) -> list[float]:
    """Where those stand that arrows join with a place."""
    return [across[pair[pair[0] == place]] for pair in beside if place in pair]


def drawn(text: str) -> str:
    """A chart as SVG, in the colour of the words around it. Raises ValueError for what cannot be drawn."""
    across, ways = laid_out(arrows_in(text))
    left = min(across.values(), default=0.0)
    width = int((max(across.values(), default=0.0) - left) * ACROSS + WIDTH + 4)
    height = max((row for _, row in across), default=0) * DOWN + HEIGHT + 4
    at = {place: ((x - left) * ACROSS + WIDTH / 2 + 2, place[1] * DOWN + 2) for place, x in across.items()}
    return "\n".join(
        (
            f'<svg class="flowchart" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}"'
            ' role="img" style="max-width: 100%" fill="none" stroke="currentColor">',
            '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8"'
            ' orient="auto"><path d="M0 0L8 4L0 8z" fill="currentColor" stroke="none"/></marker></defs>',
            *_lines(at, ways),
            *_boxes(at, {place for way in ways for place in (way[0], way[-1])}),
            "</svg>",
        )
    )


def _lines(at: dict[Place, tuple[float, float]], ways: Sequence[Way]) -> Iterator[str]:
    for way in ways:
        (x, y), *passed, (end, bottom) = (at[place] for place in way)
        points = [(x, y + HEIGHT), *((a, b + c) for a, b in passed for c in (0, HEIGHT)), (end, bottom)]
        path = "L".join(f"{a:g} {b:g}" for a, b in points)
        yield f'<path d="M{path}" marker-end="url(#head)"/>'


def _boxes(at: dict[Place, tuple[float, float]], boxes: set[Place]) -> Iterator[str]:
    for place in sorted(boxes):
        x, y = at[place]
        yield f'<rect x="{x - WIDTH / 2:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="4"/>'
        word = f'<text x="{x:g}" y="{y + HEIGHT / 2 + 5:g}" text-anchor="middle" fill="currentColor" stroke="none"'
        yield f'{word} font-size="14">{escape(place[0])}</text>'


class Flowchart(SphinxDirective):
    """A block `mermaid`."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Called by Sphinx; what cannot be drawn is a warning, and so fails the build."""
        try:
            return [nodes.raw("", drawn("\n".join(self.content)), format="html")]
        except ValueError as error:
            return [self.state.document.reporter.warning(str(error), line=self.lineno)]


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("mermaid", Flowchart)
    return {"parallel_read_safe": True}
