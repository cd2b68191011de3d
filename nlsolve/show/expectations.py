"""What a study expects to find, and whether its results bear it out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import pandas as pd
from pydantic import Field, model_validator

from nlsolve.contracts.component import Component
from nlsolve.registry.problems import Problem, StudyError, did_you_mean
from nlsolve.results.aggregates import key_of
from nlsolve.results.columns import is_measured, no_such_column
from nlsolve.results.frames import Row, rows_of
from nlsolve.results.selection import CLOSE, Names, Scalar, Where, fits, same
from nlsolve.results.verdicts import number
from nlsolve.show.tables import TableSpec, build


class Expectation(Component):
    """A finding that a study asserts of its results: of a column of `runs`, or of a declared table."""

    noun: ClassVar[str] = "expect"

    that: str = Field("", description="the finding, in a sentence")
    table: str = Field("", description="name of the declared table that is judged; absent: the runs")
    column: str = Field(description="column of `runs`, or of the table as its CSV file has it, that is judged")
    where: Where = Field(
        default_factory=dict, description="column -> value, or list of values, of the rows judged; absent: all rows"
    )
    at_most: float | None = Field(None, description="largest value that a row may have")
    at_least: float | None = Field(None, description="smallest value that a row may have")
    equals: Scalar | list[Scalar] | None = Field(None, description="value, or one of the values, that a row must have")
    tolerance: float = Field(CLOSE, ge=0, description="relative difference up to which numbers are equal")
    order: tuple[Scalar, ...] = Field(
        (), description="values of `by`, in the order in which the judged column grows strictly"
    )
    by: str = Field("", description="column whose values `order` lists")
    within: Names = Field((), description="column or columns; the order must hold within each group of equal values")

    @model_validator(mode="after")
    def _asserts_something(self) -> Expectation:
        if (self.at_most, self.at_least, self.equals) == (None, None, None) and not self.order:
            raise ValueError("says nothing: give at_most, at_least, equals or order")
        if bool(self.order) != bool(self.by):
            raise ValueError("order lists values of the column that by names: give both, or neither")
        if self.within and not self.order:
            raise ValueError("within divides the rows of an order, and there is none; drop it")
        if len(self.order) == 1:
            raise ValueError("order needs two values or more")
        return self

    @property
    def sentence(self) -> str:
        """The finding, in the study's words or as it is written."""
        if self.that:
            return self.that
        limits = {"at most": self.at_most, "at least": self.at_least, "equal to": self.equals}
        words = [f"{word} {limit}" for word, limit in limits.items() if limit is not None]
        words += [f"growing along {', '.join(map(str, self.order))}"] if self.order else []
        where = f" where {_words(self.where)}" if self.where else ""
        return f"{self.column} is {' and '.join(words)}{where}"

    def problems(self, known: Sequence[str], tables: Iterable[str]) -> list[Problem]:
        """A problem for each name that is no column of `runs`, and for a table that is not declared."""
        if self.table:
            names = list(tables)
            wrong = [] if self.table in names else [f"no such table; {did_you_mean(self.table, names)}"]
            return [Problem(("table",), self.table, sentence) for sentence in wrong]
        asked = {"column": (self.column,), "where": tuple(self.where), "by": (self.by,), "within": self.within}
        return [
            Problem((place,), name, no_such_column(name, known))
            for place, names in asked.items()
            for name in filter(None, names)
            if name not in known and not is_measured(name)
        ]

    def refutation(self, rows: Sequence[Row]) -> str:
        """Why these rows do not bear the finding out; empty when they do."""
        columns = dict.fromkeys(name for row in rows for name in row)
        for name in filter(None, (self.column, *self.where, self.by, *self.within)):
            if name not in columns:
                return f"there is no column {name!r}; {did_you_mean(name, map(str, columns))}"
        chosen = [row for row in rows if fits(row, self.where)]
        if not chosen:
            return "no row has these values"
        for row in chosen:
            if wrong := self._wrong(row[self.column]):
                return f"{self._place(row)}{self.column} is {_shown(row[self.column])}, {wrong}"
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for row in chosen if self.order else ():
            groups.setdefault(key_of(self.within, row), []).append(row)
        return next(filter(None, (self._disorder(key, group) for key, group in groups.items())), "")

    def _wrong(self, value: Any) -> str:
        """What is expected of a value that it is not; empty when it is right."""
        if self.equals is not None and not any(self._equal(value, wanted) for wanted in _listed(self.equals)):
            return f"and not {' or '.join(map(_shown, _listed(self.equals)))}"
        if self.at_most is not None and not number(value) <= self.at_most:
            return f"and should be at most {self.at_most:g}"
        if self.at_least is not None and not number(value) >= self.at_least:
            return f"and should be at least {self.at_least:g}"
        return ""

    def _equal(self, value: Any, wanted: Scalar) -> bool:
        if same(value, wanted):
            return True
        return math.isclose(number(value), number(wanted), rel_tol=self.tolerance)

    def _disorder(self, key: tuple[Any, ...], rows: Sequence[Row]) -> str:
        """Where the order is broken among the rows of one group; empty when it is not."""
        where = f" where {_words(dict(zip(self.within, key, strict=True)))}" if self.within else ""
        before, largest = self.order[0], -math.inf
        for entry in self.order:
            values = [number(row[self.column]) for row in rows if same(row[self.by], entry)]
            if not values:
                return f"no row has {self.by} = {entry}{where}"
            if any(map(math.isnan, values)):
                return f"{self.column} has no number for {self.by} = {entry}{where}"
            if min(values) <= largest:
                return (
                    f"{self.column} is {_shown(min(values))} for {self.by} = {entry} and {_shown(largest)} "
                    f"for {before}{where}"
                )
            before, largest = entry, max(values)
        return ""

    def _place(self, row: Row) -> str:
        return f"case {row['case']}: " if "case" in row else f"{next(iter(row.items()))[1]}: "


@dataclass(frozen=True)
class Finding:
    """An expectation, judged. refutation : why the results do not bear it out; empty when they do."""

    sentence: str
    refutation: str

    @property
    def holds(self) -> bool:
        """Whether the results bear the expectation out."""
        return not self.refutation

    def __str__(self) -> str:
        return (
            f"found, as expected: {self.sentence}"
            if self.holds
            else (f"not found, though expected: {self.sentence.rstrip('.')}: {self.refutation}")
        )


def judged(expectations: Sequence[Expectation], tables: Sequence[TableSpec], runs: pd.DataFrame) -> tuple[Finding, ...]:
    """The expectations of a study, held against the runs and the declared tables."""
    specs = {spec.name: spec for spec in tables}
    rows = rows_of(runs) if expectations else []
    found = []
    for expectation in expectations:
        try:
            judged_rows = build(specs[expectation.table], runs).long() if expectation.table else rows
        except StudyError as error:
            refutation = str(error)
        else:
            refutation = expectation.refutation(judged_rows)
        found.append(Finding(expectation.sentence, refutation))
    return tuple(found)


def _words(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items())


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _listed(value: Scalar | list[Scalar]) -> list[Scalar]:
    return value if isinstance(value, list) else [value]
