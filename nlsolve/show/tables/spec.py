"""The declaration of a table: its cells, how they are worded, and how they are set on paper."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from nlsolve.results.aggregates import NO_RUN
from nlsolve.results.columns import RUNS
from nlsolve.results.selection import Names
from nlsolve.show.tables.cells import Cells
from nlsolve.show.tables.numbers import plain, significant

Align = Literal["left", "center", "right", "number"]
"""How the cells of a column stand: at one of its sides, or by their decimal points."""

CONVERSIONS: dict[str, dict[str, float]] = {
    "s": {"ms": 1e3, "µs": 1e6, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600},
    "mm": {"m": 1e-3, "cm": 0.1, "µm": 1e3},
    "": {"%": 1e2, "‰": 1e3},
}
"""Unit of a column -> the units it can be shown in, each with the factor."""

PER_COLUMN = "of all columns, or column -> number"


class TableSpec(Cells):
    """A table as a study declares it."""

    labels: dict[str, str] = Field(
        default_factory=dict,
        description='column, or value in rows, columns or cells -> what is printed of it, as plain text: { anm = "ours '
        '(𝑝 = 20)" }; absent: in LaTeX the symbol of the column',
    )
    units: dict[str, str] = Field(
        default_factory=dict,
        description='column -> unit that it is shown in, { seconds = "ms" }; numbers in s, in mm and without a unit '
        "are converted (to ms, µs, ns, min, h; m, cm, µm; %, ‰), of a parameter or a plugin's column it is a label",
    )
    align: dict[str, Align] = Field(
        default_factory=dict, description="column -> where its cells stand; absent: numbers by their points, words left"
    )
    digits: Annotated[int, Field(ge=0, le=17)] | dict[str, Annotated[int, Field(ge=0, le=17)]] = Field(
        default_factory=dict, description=f"digits after the point, {PER_COLUMN}"
    )
    figures: Annotated[int, Field(ge=1, le=17)] | dict[str, Annotated[int, Field(ge=1, le=17)]] = Field(
        default_factory=dict,
        description=f"significant figures, {PER_COLUMN}; absent: four, in LaTeX those that the column is worth",
    )
    notes: Names = Field((), description="sentences beneath the table")
    label: str = Field(
        "", pattern=r"^[A-Za-z0-9:._/+-]*$", description=r"what \ref calls the table in LaTeX; absent: tab:NAME"
    )
    width: Literal["single", "half", "double", "landscape"] = Field(
        "single",
        description="what the table fits into in LaTeX: the column of a page with one (single) or two (half), both "
        "columns (double), or a page turned (landscape)",
    )
    fit: Literal["auto", "small", "wrap", "split"] = Field(
        "auto",
        description="how a table that is too wide is made to fit in LaTeX: in smaller letters (small), words on "
        "several lines (wrap), columns in several parts (split), or the first of these that is enough (auto)",
    )

    @model_validator(mode="after")
    def _prints_a_number_in_one_way(self) -> TableSpec:
        both = sorted(set(_named(self.digits)) & set(_named(self.figures)))
        if both or (isinstance(self.digits, int) and isinstance(self.figures, int)):
            of = f" of {both[0]}" if both else ""
            raise ValueError(f"digits and figures{of} exclude each other; drop one of them")
        return self

    @model_validator(mode="after")
    def _shows_units_it_can_convert_to(self) -> TableSpec:
        for name, unit in self.units.items():
            own = RUNS[name].unit if name in RUNS else None
            known = CONVERSIONS.get(own or "", {})
            if own is not None and unit != own and unit not in known:
                there = ", ".join(filter(None, (own, *known)))
                raise ValueError(f"units of {name} cannot be {unit!r}; it can be shown in {there}")
        return self

    @property
    def styled(self) -> dict[str, tuple[str, ...]]:
        """Field -> the columns that it says something of."""
        numbers = {field: tuple(_named(getattr(self, field))) for field in ("digits", "figures")}
        return {"units": tuple(self.units), "align": tuple(self.align), **numbers}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns of `runs`, or of what is made of them, that the table has."""
        return (*self.row_names, *self.columns, *self.shown)

    def factor(self, column: str) -> float:
        """What numbers of a column are multiplied by."""
        unit = self.units.get(column, "")
        own = RUNS[column].unit if column in RUNS else ""
        return CONVERSIONS.get(own, {}).get(unit, 1.0)

    def has_form(self, column: str) -> bool:
        """Whether the declaration says how numbers of a column are written."""
        return self.format is not None or any(
            isinstance(given, int) or column in given for given in (self.digits, self.figures)
        )

    def number(self, value: float, column: str) -> str:
        """A number of a column, already in the unit it is shown in."""
        for of_column in (True, False):
            for given, form in ((self.digits, _fixed), (self.figures, significant)):
                if isinstance(given, int) != of_column and (isinstance(given, int) or column in given):
                    return form(value, given if isinstance(given, int) else given[column])
        return plain(value) if self.format is None else format(value, self.format)

    def text(self, value: Any, column: str) -> str:
        """What is printed in a cell of a column that holds this value."""
        if isinstance(value, (bool, np.bool_)):
            value = "yes" if value else "no"
        if isinstance(value, str):
            return self.labels.get(value, value)
        if value is None or np.isnan(value):
            return NO_RUN
        return self.number(float(value) * self.factor(column), column)

    def word(self, value: Any, column: str) -> str:
        """What is printed of a value that tells rows or columns apart; its column is empty where it names another."""
        if not column:
            return self.heading(str(value))
        given = written(value)
        if given in self.labels or not isinstance(value, (int, float, np.number)) or isinstance(value, bool):
            return self.labels.get(given, given)
        changed = column in self.units or any(column in _named(each) for each in (self.digits, self.figures))
        return self.text(value, column) if changed else given

    def heading(self, column: str) -> str:
        """What is printed above a column: its label, or its name; and the unit, where the declaration has one."""
        return f"{self.labels.get(column, column)}{self.bracket(column)}"

    def bracket(self, column: str) -> str:
        """The unit that the declaration has of a column, in brackets."""
        return f" [{self.units[column]}]" if self.units.get(column) else ""


def written(value: Any) -> str:
    """A value that tells rows or columns apart, as it is written in `labels`."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _fixed(value: float, digits: int) -> str:
    return f"{value:.{digits}f}"


def _named(given: int | dict[str, Any]) -> dict[str, Any]:
    """Column -> what is given of it alone."""
    return {} if isinstance(given, int) else given
