"""How wide a grid is in LaTeX, and how it is made to fit: smaller letters, words on several lines, several parts.

Widths are estimates. A table that is still too wide where it is printed is scaled down there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from nlsolve.show.tables.latex.grid import Grid, GridColumn
from nlsolve.show.tables.latex.words import NUMBER, WIDTHS, Words, of_comparison, of_value

AVAILABLE = {"single": (345.0, 550.0), "half": (229.0, 550.0), "double": (469.0, 550.0), "landscape": (550.0, 330.0)}
"""Width and height that `article` has for a table [pt], by the field `width` of tables."""


@dataclass(frozen=True)
class Size:
    """A size of letters: its command, its factor over 10 pt, the distance of lines and half that of columns [pt]."""

    command: str
    factor: float
    line: float
    between: float


NORMAL = Size("", 1.0, 12.0, 6.0)
SMALL = Size(r"\small", 0.92, 11.0, 4.5)
SMALLEST = Size(r"\footnotesize", 0.85, 9.5, 3.0)

SCALED = 1.05
"""How much wider than the line the last attempt at one part may be, which is then scaled down."""


@dataclass(frozen=True)
class Setting:
    """How a grid is set: size of letters, widths at which headings and words in cells are wrapped [pt, at 10 pt]."""

    size: Size = NORMAL
    heads: float = math.inf
    limit: float = math.inf

    def body(self, column: GridColumn) -> float:
        """Width of the cells of a column in letters of 10 pt."""
        words = max((words_of(cell).within(self.limit) for cell in column.cells), default=0.0)
        return words if not column.aligned else max(NumberFormat.of(column).width, _words_width(column, self.limit))

    def width(self, column: GridColumn) -> float:
        """Width of a column in letters of 10 pt, with its last heading."""
        body, head = self.body(column), column.heads[-1]
        return max(body, head.within(max(body, head.longest, self.heads)))

    def heading_limit(self, column: GridColumn) -> float:
        """Width at which the last heading of a column is wrapped."""
        return max(self.body(column), column.heads[-1].longest, self.heads)

    def total(self, columns: Sequence[GridColumn]) -> float:
        """Width of some columns beside each other [pt]."""
        return sum(map(self.width, columns)) * self.size.factor + 2 * self.size.between * (len(columns) - 1)


ONCE = tuple(Setting(NORMAL, heads) for heads in (math.inf, 110.0, 80.0, 60.0, 40.0, 0.0))
SMALLER = tuple(Setting(size, heads) for size in (SMALL, SMALLEST) for heads in (60.0, 0.0))
ATTEMPTS: dict[str, tuple[Setting, ...]] = {
    "small": (*ONCE, *SMALLER),
    "wrap": (*ONCE, *(Setting(NORMAL, 0.0, limit) for limit in (160.0, 120.0, 90.0, 70.0, 50.0, 35.0))),
    "split": (*ONCE, Setting(NORMAL, 60.0, 120.0)),
    "auto": (
        *ONCE,
        *SMALLER,
        *(Setting(size, 0.0, limit) for limit in (160.0, 110.0) for size in (SMALL, SMALLEST)),
    ),
}
"""What is tried to make a table fit, by the field `fit` of tables; the last of them is kept."""

SPLIT = ("split", "auto")
"""Of these the ones that split a table whose columns fit in no other way."""


@dataclass(frozen=True)
class NumberFormat:
    """The longest parts of the numbers of a column: sign, digits before and after the point, and of the exponent."""

    sign: bool
    before: int
    after: int
    exponent_sign: bool
    exponent: int

    @classmethod
    def of(cls, column: GridColumn) -> NumberFormat:
        """The format of the cells that are numbers."""
        mantissas, exponents = [], []
        for cell in filter(NUMBER.fullmatch, column.cells):
            mantissa, _, exponent = cell.partition("e")
            mantissas.append(mantissa)
            exponents.append(str(int(exponent)) if exponent else "")
        points = [mantissa.lstrip("+-").partition(".") for mantissa in mantissas]
        return cls(
            any(mantissa[0] in "+-" for mantissa in mantissas),
            max(len(before) for before, _, _ in points),
            max(len(after) for _, _, after in points),
            any(exponent.startswith("-") for exponent in exponents),
            max(len(exponent.lstrip("-")) for exponent in exponents),
        )

    @property
    def tex(self) -> str:
        """The column for siunitx."""
        power = f"e{'-' * self.exponent_sign}{self.exponent}" if self.exponent else ""
        return f"S[table-format={'-' * self.sign}{self.before}.{self.after}{power}]"

    @property
    def width(self) -> float:
        """Width in letters of 10 pt."""
        narrow, digit, sign, _ = WIDTHS
        power = 2 * sign + 2 * digit + 4.5 * self.exponent + sign * self.exponent_sign if self.exponent else 0.0
        return sign * self.sign + digit * (self.before + self.after) + narrow * bool(self.after) + power


@dataclass(frozen=True)
class Plan:
    """How a grid is set, and its parts: numbers of the columns that stand beside each other."""

    setting: Setting
    parts: tuple[range, ...]


def plan_of(grid: Grid, width: float, fit: str) -> Plan:
    """The first attempt by which the grid fits into the width [pt], in as few parts as may be; else the last one."""
    attempts, number = ATTEMPTS[fit], len(grid.columns)
    most = range(1, max(number, 1) + 1) if fit in SPLIT else range(1, 2)
    for parts in (_even(number, count) for count in most):
        scaled = SCALED if len(parts) == 1 else 1.0
        if not _fits(grid, attempts[-1], parts, width * scaled):
            continue
        first = next((setting for setting in attempts if _fits(grid, setting, parts, width)), attempts[-1])
        return Plan(first, parts)
    return Plan(attempts[-1], _even(number, most[-1]))


def _fits(grid: Grid, setting: Setting, parts: Sequence[range], width: float) -> bool:
    """Whether each part is no wider than the width [pt], the labels of the rows beside it."""
    return all(setting.total((*grid.labels, *(grid.columns[k] for k in part))) <= width for part in parts)


@lru_cache(maxsize=2**16)
def words_of(cell: str) -> Words:
    """A cell as words: a number, a comparison with a paper, or text."""
    return of_value(cell) if "(" not in cell else of_comparison(cell)


def _words_width(column: GridColumn, limit: float) -> float:
    return max((words_of(cell).within(limit) for cell in column.cells if not NUMBER.fullmatch(cell)), default=0.0)


def _even(length: int, number: int) -> tuple[range, ...]:
    """As many ranges, as equal as may be, one after the other."""
    ends = [round(length * k / number) for k in range(number + 1)]
    return tuple(range(start, end) for start, end in pairwise(ends))
