"""The base of all kinds of figures: name, caption, selection of runs, and the error when nothing can be drawn."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from difflib import get_close_matches
from typing import ClassVar

import pandas as pd
from pydantic import Field

from nlsolve.registry.problems import StudyError
from nlsolve.results.columns import RENAMED, is_timed, no_such_column
from nlsolve.results.costs.lanes import ONE, Lanes, on_seconds
from nlsolve.results.frames import Frames, rows_of
from nlsolve.results.selection import Names, Where, fits
from nlsolve.show import plotting
from nlsolve.show.figures.paper.look import Look


class FigureError(ValueError):
    """A declared figure cannot be drawn from these results; its sentence says why, and what there is instead."""


class BaseFigure(Look, ABC):
    """A figure as a study declares it: a kind adds its fields and paints itself."""

    noun: ClassVar[str] = "figure"

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100, description="stem of the files written")
    caption: str = Field("", description="sentence under the figure in the report")
    title: str | None = Field(None, description="heading inside the figure; papers do without")
    where: Where = Field(
        default_factory=dict, description="runs column -> value, or list of values, a case must have to be drawn"
    )
    group: Names = Field(
        (),
        description="parameters that tell curves or panels apart; absent: those that differ, where a case is a curve",
    )

    lanes: Lanes = ONE

    def columns_of_runs(self) -> dict[str, Names]:
        """Field -> the columns of `runs` that it names, which a study checks before it is run."""
        return {"where": tuple(self.where), "group": self.group}

    @property
    def shows_seconds(self) -> bool:
        """Whether it shows what was read from a clock."""
        return any(is_timed(name) for names in self.columns_of_runs().values() for name in names)

    def on_seconds(self, runs: pd.DataFrame) -> tuple[str, ...]:
        """What is said of the seconds that it shows. Raises FigureError where they may not come from several lanes."""
        if not self.shows_seconds or runs.empty:
            return ()
        try:
            return on_seconds((run for run in rows_of(runs) if fits(run, self.where)), self.lanes)
        except StudyError as error:
            raise self.refuse(str(error)) from error

    @abstractmethod
    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        """Draw on an empty figure. Returns what is drawn: a row a point or cell, columns by their names in results."""

    def refuse(self, sentence: str) -> FigureError:
        """The exception that says why this figure cannot be drawn."""
        return FigureError(f'figure "{self.name}": {sentence}')

    def require(self, column: str, frame: pd.DataFrame, source: str, what: str = "column") -> None:
        """Raise FigureError when the frame called `source` has no such column."""
        if column in frame:
            return
        if column in RENAMED:
            raise self.refuse(f"{what} {column!r}: {no_such_column(column, map(str, frame))}")
        there = [str(name) for name in frame]
        near = get_close_matches(column, there, n=3)
        known = f"the nearest are {listing(near)}" if near else f"there are {listing(there)}"
        raise self.refuse(f"{what} {column!r} is not in `{source}`; {known}")


def listing(names: Sequence[str], most: int = 12) -> str:
    """Names with commas between; of more than `most`, the first ones and how many more there are."""
    shown = ", ".join(names[:most]) or "none"
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"
