r"""A grid as LaTeX: one or several floats, each with its parts of the table, no wider than the line where it stands.

Columns of numbers are those of siunitx, lines those of booktabs; ``\resizebox`` scales what is wider than its line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, groupby, pairwise

from nlsolve.show.tables.latex.fit import AVAILABLE, NumberFormat, Plan, Setting, plan_of, words_of
from nlsolve.show.tables.latex.grid import Grid, GridColumn
from nlsolve.show.tables.latex.words import NUMBER, Words, of_paragraph, stacked, width_of
from nlsolve.show.tables.spec import TableSpec

PACKAGES = ("booktabs", "graphicx", "siunitx")
TURNED = "pdflscape"
PREAMBLE_FILE = "preamble.tex"
PREAMBLE = "\n".join(
    (
        "% What the tables beside this file need: \\input{preamble} before \\begin{document}, or copy the lines.",
        *(rf"\usepackage{{{name}}}" for name in PACKAGES),
        rf'\usepackage{{{TURNED}}} % for tables with width = "landscape" alone',
        "",
    )
)
"""What the tables need, in a file beside them."""

GAP = 0.5
"""Height of the space between groups of rows, in lines."""

LETTER = {"left": "l", "center": "c", "right": "r", "number": "l"}


def packages_of(spec: TableSpec) -> tuple[str, ...]:
    """The packages that a table needs."""
    return (*PACKAGES, TURNED) if spec.width == "landscape" else PACKAGES


def latex(spec: TableSpec, grid: Grid) -> str:
    """The table in LaTeX."""
    width, height = AVAILABLE[spec.width]
    plan = plan_of(grid, width, spec.fit)
    tabulars = [_Tabular(grid, plan.setting, part) for part in plan.parts]
    around = sum(width_of(text) // width + 1 for text in (f"Table 99: {grid.caption}", *grid.notes)) * 12.0 + 36.0
    floats = list(_floats(tabulars, height - around))
    texts = [_float(spec, grid, plan, content, n == 0, n == len(floats) - 1) for n, content in enumerate(floats)]
    if spec.width == "landscape":
        texts = ["\\begin{landscape}\n", *texts, "\\end{landscape}\n"]
    return "".join(texts)


@dataclass(frozen=True)
class _Tabular:
    """A part of a grid as one tabular: the labels of the rows and some of the columns."""

    grid: Grid
    setting: Setting
    part: range

    @property
    def columns(self) -> tuple[GridColumn, ...]:
        return (*self.grid.labels, *(self.grid.columns[k] for k in self.part))

    @property
    def rows(self) -> range:
        return range(len(self.columns[0].cells) if self.columns else 0)

    @cached_property
    def lines(self) -> list[int]:
        """How many lines of text each row takes."""
        limit = self.setting.limit
        return [max(len(words_of(column.cells[row]).lines(limit)) for column in self.columns) or 1 for row in self.rows]

    @cached_property
    def begins(self) -> set[int]:
        """The rows above which a space parts groups: where the first label changes, and has several rows."""
        if len(self.grid.labels) < 2:
            return set()
        ends = accumulate(len(list(rows)) for _, rows in groupby(self.grid.labels[0].cells))
        groups = list(pairwise((0, *ends)))
        return {start for before, (start, end) in pairwise(groups) if max(end - start, before[1] - before[0]) > 1}

    @cached_property
    def heads(self) -> list[list[str]]:
        """The lines of the last heading of each column."""
        return [column.heads[-1].lines(self.setting.heading_limit(column)) for column in self.columns]

    def height(self, rows: range) -> float:
        """Height of these rows with headings and rules [pt]; headings above several columns may have two lines."""
        above = 2 * (len(self.columns[-1].heads) - 1 + bool(self.grid.above.tex))
        last = max(map(len, self.heads))
        gaps = GAP * sum(row in self.begins for row in rows[1:])
        return self.setting.size.line * (above + last + sum(self.lines[row] for row in rows) + gaps + 2)

    def cell(self, column: GridColumn, row: int) -> str:
        """A cell of a row; numbers that stand by their points are left to siunitx."""
        text = column.cells[row]
        if column.aligned and NUMBER.fullmatch(text):
            mantissa, _, exponent = text.partition("e")
            return f"{mantissa}e{int(exponent)}" if exponent else mantissa
        lines = words_of(text).lines(self.setting.limit)
        found = stacked(lines, "t", "c" if column.aligned else LETTER[column.align])
        return f"{{{found}}}" if column.aligned else found

    def tex(self, rows: range) -> str:
        """The tabular of some rows, no wider than its line."""
        parts = [
            r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
            rf"\begin{{tabular}}{{@{{}}{' '.join(self.formats)}@{{}}}}",
            r"\toprule",
            *self.headings,
            r"\midrule",
            *self._body(rows),
            r"\bottomrule",
            r"\end{tabular}}",
        ]
        return "\n".join(parts)

    @cached_property
    def formats(self) -> list[str]:
        """How LaTeX sets each column."""
        return [NumberFormat.of(each).tex if each.aligned else LETTER[each.align] for each in self.columns]

    @cached_property
    def headings(self) -> list[str]:
        """The rows of headings."""
        return list(self._headings())

    def _headings(self) -> Iterator[str]:
        """The rows of headings, those above several columns with a line beneath."""
        blank, shown = len(self.grid.labels), [self.grid.columns[k] for k in self.part]
        widths = [self.setting.width(column) for column in shown]
        if self.grid.above.tex and shown:
            yield from self._spanning(blank, [(self.grid.above, len(shown), sum(widths))])
        for level in range(len(shown[0].heads) - 1 if shown else 0):
            groups = [list(group) for _, group in groupby(range(len(shown)), lambda k: shown[k].heads[: level + 1])]
            spans = [(shown[each[0]].heads[level], len(each), sum(widths[k] for k in each)) for each in groups]
            yield from self._spanning(blank, spans)
        last = []
        for column, lines in zip(self.columns, self.heads, strict=True):
            text = stacked(lines, "b", "c" if column.aligned else LETTER[column.align])
            last.append(f"{{{text}}}" if column.aligned else text)
        yield " & ".join(last) + r" \\"

    def _spanning(self, blank: int, spans: Sequence[tuple[Words, int, float]]) -> Iterator[str]:
        """A row of headings above several columns each: (heading, number of columns, width)."""
        cells, rules, start = [""] * blank, [], blank + 1
        for head, number, width in spans:
            lines = head.lines(width if self.setting.heads < math.inf else math.inf)
            cells.append(rf"\multicolumn{{{number}}}{{c}}{{{stacked(lines, 'b', 'c')}}}")
            rules.append(rf"\cmidrule(lr){{{start}-{start + number - 1}}}")
            start += number
        yield " & ".join(cells) + r" \\"
        yield " ".join(rules)

    def _body(self, rows: range) -> Iterator[str]:
        """The rows. What the one above has said of several columns of labels is not said again."""
        labels = self.grid.labels
        for row in rows:
            cells = [self.cell(column, row) for column in self.columns]
            for level in range(len(labels) - 1) if row > rows[0] else ():
                if any(each.cells[row] != each.cells[row - 1] for each in labels[: level + 1]):
                    break
                cells[level] = ""
            if row > rows[0] and row in self.begins:
                yield r"\addlinespace"
            yield " & ".join(cells) + r" \\"


def _floats(tabulars: Sequence[_Tabular], height: float) -> Iterator[list[tuple[_Tabular, range]]]:
    """Which rows of which parts share a float, so that none is higher than the page."""
    content: list[tuple[_Tabular, range]] = []
    left = height
    for tabular in tabulars:
        for rows in _pieces(tabular, height):
            needed = tabular.height(rows)
            if content and needed > left:
                yield content
                content, left = [], height
            content.append((tabular, rows))
            left -= needed
    yield content


def _pieces(tabular: _Tabular, height: float) -> Iterator[range]:
    """Ranges of rows that are no higher than the page each."""
    start = 0
    for end in tabular.rows:
        if end > start and tabular.height(range(start, end + 1)) > height:
            yield range(start, end)
            start = end
    yield range(start, len(tabular.rows))


def _float(
    spec: TableSpec, grid: Grid, plan: Plan, content: Sequence[tuple[_Tabular, range]], first: bool, last: bool
) -> str:
    """One float: the caption, its parts of the table, and under the last of them the notes."""
    star = "*" if spec.width == "double" else ""
    parts = [rf"\begin{{table{star}}}[htbp]", r"\centering", r"\sloppy", r"\setlength{\belowcaptionskip}{6pt}"]
    caption = of_paragraph(grid.caption)
    if caption and not first:
        parts += [r"\addtocounter{table}{-1}", rf"\caption[]{{{caption} (continued)}}"]
    elif caption:
        parts += [rf"\caption{{{caption}}}"]
    if first and (caption or spec.label):
        parts.append(rf"\label{{{spec.label or f'tab:{spec.name}'}}}")
    size = plan.setting.size
    parts += [size.command] if size.command else []
    parts.append(rf"\setlength{{\tabcolsep}}{{{size.between:g}pt}}")
    parts.append("\n\\par\\medskip\n".join(tabular.tex(rows) for tabular, rows in content))
    if last and grid.notes:
        parts.append(r"\par\smallskip")
        notes = "\\par\n".join(map(of_paragraph, grid.notes))
        parts.append(f"\\begin{{minipage}}{{\\linewidth}}\\footnotesize\\sloppy\n{notes}\n\\end{{minipage}}")
    return "\n".join([*parts, rf"\end{{table{star}}}", ""])
