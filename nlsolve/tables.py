"""Tables a study declares: one cell a run, rows and columns by parameter, the paper's values beside them.

Or, of many runs: the cheapest within an error (`cheapest`), how many there are (`count`), the share `solved`, who wins
(`crossover`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, Field, field_validator, model_validator
from rich.markup import escape
from rich.table import Table as RichTable

from nlsolve.audit import ACCEPTED
from nlsolve.columns import RUNS
from nlsolve.component import Component
from nlsolve.condense import COUNT, NO_RUN, WITHIN, Cheapest, counted, key_of, success
from nlsolve.crossover import Crossover
from nlsolve.errors import ABSENT, Problem, StudyError, did_you_mean
from nlsolve.outcomes import AT_A_SOLUTION, OUTCOME, SOLVED, outcome, solved
from nlsolve.papers import PaperValues

MEASURED = (*RUNS, OUTCOME, SOLVED)
"""Columns that are known only when a case has been run."""

SHARE = ".2f"
"""Format of shares where a table gives none."""

Scalar = bool | int | float | str
Names = Annotated[tuple[str, ...], BeforeValidator(lambda value: (value,) if isinstance(value, str) else value)]


class TableSpec(Component):
    """A declared table: which runs, laid out by which of their columns, showing what."""

    noun: ClassVar[str] = "table"

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", description="stem of the files written")
    rows: Names = Field(
        (), description="column or columns of `runs` that tell the rows apart; may be absent with cheapest"
    )
    columns: Names = Field((), description="column or columns of `runs` that tell the columns apart")
    value: Names = Field(
        (),
        description="column or columns of `runs` shown in the cells, or `outcome`; `solved`: the share of a cell's "
        "runs that are solved, with its interval; with count: runs, solved",
    )
    where: dict[str, Scalar | list[Scalar]] = Field(
        default_factory=dict, description="column of `runs` -> value, or list of values, a run must have"
    )
    caption: str = Field("", description="sentence above the table")
    format: str | None = Field(None, description='Python format of a number, such as ".2e"; absent: four digits')
    accepted: float = Field(ACCEPTED, gt=0, description="relative error up to which `outcome` is right")
    error: str = Field("velocity_error", description="column of `runs` by which `outcome` is right or wrong")
    interval: float = Field(0.9, gt=0, lt=1, description="confidence of the interval of a share solved")
    cheapest: Cheapest | None = Field(
        None, description="keep the cheapest run within each error only, of each of the rows and columns"
    )
    crossover: Crossover | None = Field(
        None, description="which strategy is cheapest by the ratio of factorisation to triangular solve"
    )
    count: bool = Field(
        False, description="cells count runs, such as rows = variant, columns = outcome; value = solved: those solved"
    )
    paper: PaperValues | None = Field(None, description="a paper's values to compare with")

    @field_validator("format")
    @classmethod
    def _formats_numbers(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                format(1.0, value)
            except ValueError:
                raise ValueError('should be a Python format of a number, such as ".3g" or ".2e"') from None
        return value

    @model_validator(mode="after")
    def _says_what_it_shows(self) -> TableSpec:
        if self.count and (self.cheapest is not None or not set(self.value) <= {COUNT, SOLVED}):
            drop = "cheapest" if self.cheapest is not None else "value, or show runs or solved"
            raise ValueError(f"count = true shows numbers of runs; drop {drop}")
        if self.crossover is not None:
            given = [name for name in ("rows", "columns", "value", "cheapest", "count", "paper") if getattr(self, name)]
            if given:
                raise ValueError(f"a crossover lays itself out; drop {given[0]}")
            return self
        if not (self.count or self.value):
            raise ValueError("value is required, and missing: columns to show, or count = true")
        if not self.rows and self.cheapest is None:
            raise ValueError("rows is required, and missing: a column that tells the rows apart")
        if not self.count and SOLVED in self.value and (len(self.value) > 1 or self.cheapest is not None):
            drop = "cheapest" if self.cheapest is not None else "the other values"
            raise ValueError(f'value = "solved" shows shares of all the runs of a cell; drop {drop}')
        if self.paper is not None and (self.success or self.cheapest is not None):
            raise ValueError("paper values are compared number by number, so not with cheapest or shares solved")
        return self

    @model_validator(mode="after")
    def _one_value_beside_a_paper(self) -> TableSpec:
        if self.paper is not None and self.columns and len(self.value) > 1:
            raise ValueError("a table with paper values and columns should show one value only")
        return self

    @property
    def success(self) -> bool:
        """Whether cells are shares of runs solved."""
        return self.value == (SOLVED,) and not self.count

    @property
    def shown(self) -> Names:
        """Columns whose values are in the cells."""
        if self.crossover is not None:
            return self.crossover.shown
        return self.value or (COUNT,)

    @property
    def labels(self) -> Names:
        """Columns whose values tell the rows apart."""
        if self.crossover is not None:
            return self.crossover.labels
        return self.rows if self.cheapest is None else (WITHIN, *self.rows)

    def condensed(self, runs: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
        """A record a cell of the runs that fit: themselves, unless they are to be counted or to compete."""
        layout = (*self.rows, *self.columns)
        if self.cheapest is not None:
            return self.cheapest.of(runs, layout)
        if self.success:
            return success(runs, layout, self.interval, self.format or SHARE)
        if self.crossover is not None:
            return self.crossover.of(runs)
        return counted(runs, layout) if self.count else runs

    def text(self, value: Any) -> str:
        """A cell for people."""
        if isinstance(value, str):
            return value
        if isinstance(value, (bool, np.bool_)):
            return "yes" if value else "no"
        if value is None or np.isnan(value):
            return NO_RUN
        if self.format is not None:
            return format(float(value), self.format)
        return str(int(value)) if float(value).is_integer() and abs(value) < 1e9 else f"{value:.4g}"


@dataclass(frozen=True)
class Table:
    """A table of results.

    cells : a number, a word for a run that failed, or NaN where there is no run.
    comparison : "measured (paper) verdict" in the same layout; None without paper values.
    """

    spec: TableSpec
    cells: pd.DataFrame
    comparison: pd.DataFrame | None = None

    @property
    def words(self) -> pd.DataFrame:
        """The cells as they are printed."""
        return self.cells.map(self.spec.text)

    def files(self) -> dict[str, str]:
        """Text of the files a table is written to, by ending."""
        texts = {".csv": self.csv(), ".md": self.markdown(), ".tex": self.latex()}
        if self.comparison is not None:
            texts["-paper.csv"] = _flat(self.comparison).to_csv(index=False)
        return texts

    def csv(self) -> str:
        """The cells at full precision, with labels of rows and columns."""
        return _flat(self.cells).to_csv(index=False)

    def long(self) -> list[dict[str, Any]]:
        """For JSON: a record a row, null where there is no run."""
        flat = _flat(self.cells)
        return [
            {name: None if pd.isna(value) else value for name, value in zip(flat.columns, row, strict=True)}
            for row in flat.itertuples(index=False)
        ]

    def frames(self) -> dict[str, pd.DataFrame]:
        """The table for people, under its caption, then its comparison, under the paper's name."""
        frames = {self.spec.caption or self.spec.name: self.words}
        if self.comparison is not None and self.spec.paper is not None:
            frames[f"{self.spec.name}: measured ({self.spec.paper.source}) verdict"] = self.comparison
        return {title: frame.rename(index=_word, columns=_word) for title, frame in frames.items()}

    def rich(self) -> list[RichTable]:
        """For a terminal."""
        return [_rich(title, frame) for title, frame in self.frames().items()]

    def markdown(self) -> str:
        """GitHub's tables: the table, then its comparison."""
        parts = [_flat(frame).to_markdown(index=False, disable_numparse=True) for frame in self.frames().values()]
        return "\n\n".join(parts) + "\n"

    def latex(self) -> str:
        """A booktabs tabular, captioned, of the comparison if there is one and of the cells if not."""
        frame = self.words if self.comparison is None else self.comparison
        frame = frame.rename(index=_word, columns=_word).rename_axis(index=_escaped, columns=_escaped)
        styler = frame.style.format(escape="latex").format_index(escape="latex", axis=0)
        styler = styler.format_index(escape="latex", axis=1)
        return styler.to_latex(hrules=True, caption=_escaped(self.spec.caption) or None, label=f"tab:{self.spec.name}")


def build(spec: TableSpec, runs: pd.DataFrame) -> Table:
    """The declared table of these runs. Raises StudyError when two runs claim one cell or a name is unknown."""
    records = [dict(zip(runs.columns, row, strict=True)) for row in runs.itertuples(index=False)]
    judged = (spec.accepted, spec.error)
    records = [{**run, OUTCOME: outcome(run, *judged), SOLVED: solved(run, *judged)} for run in records]
    problems = check(spec, records)
    if problems:
        raise StudyError(*(f"table {spec.name!r}: {problem.expected}" for problem in problems))
    chosen = spec.condensed([run for run in records if _fits(spec, run)])
    rows = list(dict.fromkeys(key_of(spec.labels, run) for run in chosen))
    columns = list(dict.fromkeys(key for run in chosen for key in _column_keys(spec, run)))
    cells = np.full((len(rows), len(columns)), 0 if spec.count else np.nan, dtype=object)
    for run in chosen:
        for value, key in zip(spec.shown, _column_keys(spec, run), strict=True):
            failed = not (spec.count or spec.success) and run["status"] not in AT_A_SOLUTION
            cells[rows.index(key_of(spec.labels, run)), columns.index(key)] = run.get("status" if failed else value)
    names = (*spec.columns, "") if spec.columns and len(spec.shown) > 1 else spec.columns or ("",)
    index, header = _index(rows, spec.labels), _index(columns, names)
    frame = pd.DataFrame(cells, index=index, columns=header, dtype=object)
    if spec.paper is None:
        return Table(spec, frame)
    compared = spec.paper.compare(cells, spec.text)
    return Table(spec, frame, pd.DataFrame(compared, index=index, columns=header, dtype=object))


def check(spec: TableSpec, runs: Sequence[Mapping[str, Any]], measured: Iterable[str] = MEASURED) -> list[Problem]:
    """What keeps a table from being laid out: unknown names, cells with several runs, a paper of another shape.

    Works on the parameters of cases before anything has been computed, and on rows of `runs` afterwards.
    """
    known = list(dict.fromkeys([*measured, *(name for run in runs for name in run)]))
    contest = () if spec.cheapest is None else (spec.cheapest.cost, spec.cheapest.error)
    axes = {} if spec.crossover is None else spec.crossover.columns_of_runs()
    problems = [
        Problem(place, name, f"no such column of the results; {did_you_mean(name, known)}")
        for place, names in [
            (("rows",), spec.rows),
            (("columns",), spec.columns),
            (("value",), () if spec.count else spec.value),
            (("where",), spec.where),
            (("cheapest", "cost"), contest[:1]),
            (("cheapest", "error"), contest[1:]),
            *((("crossover", field), columns) for field, columns in axes.items()),
        ]
        for name in names
        if name not in known
    ]
    layout = (*spec.rows, *spec.columns)
    unmeasured = {name for name in measured if not all(name in run for run in runs)}
    if problems or unmeasured.intersection((*layout, *spec.where)):
        return problems
    chosen = [run for run in runs if _fits(spec, run)]
    if not chosen:
        asked = ", ".join(f"{name} = {value!r}" for name, value in spec.where.items())
        return [Problem(("where",), ABSENT, f"no case has these values: {asked}")]
    if spec.success or spec.cheapest is not None or spec.crossover is not None:
        return []
    cells: dict[tuple[Any, ...], Mapping[str, Any]] = {}
    for run in () if spec.count else chosen:
        other = cells.setdefault(key_of(layout, run), run)
        if other is not run:
            differing = [name for name in run if name not in measured and not _same(run[name], other.get(name))]
            hint = f"; they differ in {differing[0]!r}: put it in rows, columns or where" if differing else ""
            here = ", ".join(f"{name} = {value!r}" for name, value in zip(layout, key_of(layout, run), strict=True))
            return [Problem(("rows",), list(spec.rows), f"several runs land in the cell {here}{hint}")]
    if spec.paper is not None:
        height = len({key_of(spec.rows, run) for run in chosen})
        width = len({key for run in chosen for key in _column_keys(spec, run)})
        lengths = [len(row) for row in spec.paper.values]
        if lengths != [width] * height:
            expected = f"should be {height} lists of {width} numbers, as the table has; there are lists of {lengths}"
            return [Problem(("paper", "values"), [list(row) for row in spec.paper.values], expected)]
    return []


def _fits(spec: TableSpec, run: Mapping[str, Any]) -> bool:
    wanted = {name: value if isinstance(value, list) else [value] for name, value in spec.where.items()}
    return all(any(_same(run.get(name), value) for value in values) for name, values in wanted.items())


def _same(a: Any, b: Any) -> bool:
    return bool(a == b) or (pd.isna(a) and pd.isna(b))


def _column_keys(spec: TableSpec, run: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """The table's columns that a run has a value for."""
    if spec.columns and len(spec.shown) == 1:
        return [key_of(spec.columns, run)]
    return [(*key_of(spec.columns, run), value) for value in spec.shown]


def _index(keys: list[tuple[Any, ...]], names: tuple[str, ...]) -> pd.Index:
    if len(names) == 1:
        return pd.Index([key[0] for key in keys], name=names[0], dtype=object)
    return pd.MultiIndex.from_tuples(keys, names=names)


def _flat(frame: pd.DataFrame) -> pd.DataFrame:
    """Row labels as columns, column labels as one text, named by what they are."""
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
    """Text for LaTeX."""
    special = {"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"}
    return "".join(special.get(letter, letter) for letter in str(text or ""))
