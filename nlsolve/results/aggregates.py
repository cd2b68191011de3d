"""Many runs -> few cells of a table: the cheapest run within an error, how many runs there are, or the share solved;
and what the work has cost that several of them share.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

import pandas as pd
from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.results.frames import Row
from nlsolve.results.profiles import wilson
from nlsolve.results.verdicts import SOLVED, Run, cheapest, is_error, percent

NO_RUN = "–"
"""Stands where no run belongs."""

WITHIN, COUNT = "within", "runs"
"""Columns that come with the cheapest runs, and with counts."""


class Cheapest(Component):
    """argmin cost over the converged runs with error ≤ each of `within`: what an accuracy costs."""

    noun: ClassVar[str] = "cheapest"

    cost: str = Field("seconds", description="column of `runs` to be least")
    error: str = Field("velocity_error", description="column of `runs` to be small enough")
    within: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (0.01, 0.001), min_length=1, description="largest errors allowed; a row each"
    )

    def text(self, within: float) -> str:
        """One of the largest errors allowed, as a table shows it: in percent where the column is a relative error."""
        return percent(within) if is_error(self.error) else f"{within:g}"

    def of(self, runs: Sequence[Run], groups: tuple[str, ...]) -> list[Row]:
        """A row for each largest error and each group: its cheapest run, with the column `within`.

        The row of a group in which no run is good enough holds the group and `within` only.
        """
        found = []
        for within in self.within:
            for key, members in grouped(runs, groups).items():
                best = cheapest(members, self.cost, self.error, within)
                row = dict(zip(groups, key, strict=True)) if best is None else best
                found.append({**row, WITHIN: self.text(within)})
        return found


def counted(runs: Sequence[Run], groups: tuple[str, ...]) -> list[Row]:
    """A row a group, with its number of runs in the column `runs`, and of solved runs in the column `solved`."""
    return [
        {**dict(zip(groups, key, strict=True)), COUNT: len(members), SOLVED: sum(bool(run[SOLVED]) for run in members)}
        for key, members in grouped(runs, groups).items()
    ]


def success(runs: Sequence[Run], groups: tuple[str, ...], interval: float, form: str) -> list[Row]:
    """A row a group, with the share of its runs that are solved and the share's interval, "0.85 [0.70, 0.95]"."""
    found = []
    for key, members in grouped(runs, groups).items():
        solved = sum(bool(run[SOLVED]) for run in members)
        low, high = (format(end, form) for end in wilson(solved, len(members), interval))
        text = f"{format(solved / len(members), form)} [{low}, {high}]"
        found.append({**dict(zip(groups, key, strict=True)), SOLVED: text})
    return found


def shared_ways(runs: pd.DataFrame) -> str:
    """What the ways to first states have cost that rows share, in a sentence; empty where none is shared."""
    if "start_way" not in runs:
        return ""
    led = runs.dropna(subset="start_way")
    shared = led[led.duplicated("start_way", keep=False)]
    if not len(shared):
        return ""
    solved = shared.drop_duplicates(["start_way", "seconds_start"])
    ways, work = shared["start_way"].nunique(), int(solved["start_factorizations"].sum())
    each = "one way to a first state" if ways == 1 else f"{ways} ways to first states"
    return (
        f"{len(shared)} cases share {each}: in all {work} factorisations and {solved['seconds_start'].sum():.3g} s, "
        "which the columns start_… and seconds_start repeat in each row"
    )


def grouped(runs: Sequence[Run], groups: tuple[str, ...]) -> dict[tuple[Any, ...], list[Run]]:
    """The runs by their values of some columns, in order of appearance."""
    found: dict[tuple[Any, ...], list[Run]] = {}
    for run in runs:
        found.setdefault(key_of(groups, run), []).append(run)
    return found


def key_of(names: tuple[str, ...], run: Run) -> tuple[Any, ...]:
    """A run's values of some columns, NO_RUN for those it has no value of."""
    return tuple(NO_RUN if pd.isna(run.get(name)) else run.get(name) for name in names)
