"""The cells of a table as a study declares them: which runs, by which columns laid out, and which are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field, field_validator, model_validator

from nlsolve.contracts.component import Component
from nlsolve.results.aggregates import COUNT, WITHIN, Cheapest, counted, success
from nlsolve.results.columns import is_timed
from nlsolve.results.costs.crossover import Crossover
from nlsolve.results.costs.lanes import ONE, Lanes
from nlsolve.results.published_values import PublishedValues
from nlsolve.results.selection import Names, Scalar, Where
from nlsolve.results.verdicts import ACCEPTED, SOLVED, SPEEDUP, Run

SHARE = ".2f"
"""Format of shares where a table gives none."""


class Cells(Component):
    """What is in the cells of a declared table."""

    noun: ClassVar[str] = "table"

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100, description="stem of the files written")
    rows: Names = Field(
        (), description="column or columns of `runs` that tell the rows apart; may be absent with cheapest"
    )
    columns: Names = Field((), description="column or columns of `runs` that tell the columns apart")
    value: Names = Field(
        (),
        description="column or columns of `runs` shown in the cells, or `outcome`; `speedup`: seconds of the run named "
        "by `against` over those of the run; `solved`: the share of a cell's runs that are solved, with its interval; "
        "with count: runs, solved",
    )
    where: Where = Field(
        default_factory=dict, description="column of `runs` -> value, or list of values, a run must have"
    )
    against: dict[str, Scalar] = Field(
        default_factory=dict,
        description="column of `runs` -> value of the run that `speedup` compares with; elsewhere it is like the run "
        "in rows and columns",
    )
    caption: str = Field("", description="sentence above the table, as plain text: 50 %, x_1, η ≤ 10⁻⁶")
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
    lanes: Lanes = ONE
    paper: PublishedValues | None = Field(None, description="a paper's values to compare with")

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
    def _says_what_it_shows(self) -> Cells:
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
        if SPEEDUP in self.value and not self.against:
            raise ValueError('a speedup compares with a run: say with which, as in against = { variant = "newton" }')
        if self.paper is not None and (self.success or self.cheapest is not None):
            raise ValueError("paper values are compared number by number, so not with cheapest or shares solved")
        return self

    @model_validator(mode="after")
    def _one_value_beside_a_paper(self) -> Cells:
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
    def row_names(self) -> Names:
        """Columns whose values tell the rows apart."""
        if self.crossover is not None:
            return self.crossover.labels
        return self.rows if self.cheapest is None else (WITHIN, *self.rows)

    @property
    def aggregates(self) -> bool:
        """Whether a cell says something of many runs, and not of one."""
        return self.count or self.success or self.cheapest is not None or self.crossover is not None

    @property
    def shows_seconds(self) -> bool:
        """Whether cells hold what was read from a clock, or are chosen by it."""
        names = (*self.value, *(() if self.cheapest is None else (self.cheapest.cost,)))
        return self.crossover is not None or SPEEDUP in names or any(map(is_timed, names))

    def aggregated(self, runs: Sequence[Run]) -> Sequence[Run]:
        """What the cells are filled from: the chosen runs themselves, or a row for many of them."""
        layout = (*self.rows, *self.columns)
        if self.cheapest is not None:
            return self.cheapest.of(runs, layout)
        if self.success:
            return success(runs, layout, self.interval, self.format or SHARE)
        if self.crossover is not None:
            return self.crossover.of(runs)
        return counted(runs, layout) if self.count else runs
