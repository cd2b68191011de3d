"""cost_s(ρ) = n_F ρ + rest_s : what a strategy costs, in triangular solves, where a factorisation costs ρ of them.

At one number of nodes a strategy is a straight line: its counts do not depend on ρ, and `rest` (its solves, residuals,
series, own work) is in the unit of the solve. The cheapest strategy by ρ is the lower envelope of these lines; the
measured linear solvers are points on the ρ axis, and a cell is one of them at one number of nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.contracts.component import Component
from nlsolve.contracts.status import Status
from nlsolve.registry.problems import StudyError
from nlsolve.results.aggregates import NO_RUN, grouped, key_of
from nlsolve.results.costs.cost_prediction import pooled
from nlsolve.results.costs.lower_envelope import at_best, lower_envelope, under, wins
from nlsolve.results.costs.unit_costs import UnitCosts
from nlsolve.results.frames import Row
from nlsolve.results.selection import Names
from nlsolve.results.verdicts import Run, number, status_of
from nlsolve.series import Array

SAME, TIE, OTHER = "same", "tie", "other"
"""Verdicts on a cell: the strategy predicted to win is the one that wins, or its rounds overlap with the winner's, or
neither.
"""


@dataclass(frozen=True)
class Cell:
    """One linear solver at one size: the work and the seconds of its S strategies, arrays (S,).

    seconds, slowest : of the fastest and of the slowest round; in the exclusive lane the median of the rounds and the
        upper end of its interval.
    predicted : seconds by the cost model.
    """

    size: str
    backend: str
    unit: UnitCosts
    strategies: tuple[str, ...]
    factorizations: Array
    seconds: Array
    slowest: Array
    predicted: Array

    @property
    def winners(self) -> tuple[int, int]:
        """Positions of the cheapest strategy by prediction, and by measurement."""
        return int(self.predicted.argmin()), int(self.seconds.argmin())

    @property
    def verdict(self) -> str:
        """SAME, TIE or OTHER. A tie: the predicted winner's seconds are no more than the winner's slowest."""
        predicted, measured = self.winners
        if predicted == measured:
            return SAME
        return TIE if self.seconds[predicted] <= self.slowest[measured] else OTHER

    @property
    def rests(self) -> Array:
        """What a strategy costs besides its factorisations, in triangular solves of this cell."""
        return (self.predicted - self.factorizations * self.unit.factorization) / self.unit.triangular_solve


class Crossover(Component):
    """A report on the cheapest strategies, by the columns of `runs` that tell strategies, sizes and solvers apart."""

    noun: ClassVar[str] = "crossover"

    report: Literal["cells", "lines"] = Field(
        "cells",
        description="cells: predicted and measured winner with each linear solver at each size; lines: where each "
        "strategy wins",
    )
    strategy: Names = Field(("variant",), description="column or columns that tell strategies apart")
    size: Names = Field(("nodes",), description="column or columns that tell problems apart, such as nodes")
    backend: Names = Field(("linear.ordering",), description="column or columns that tell linear solvers apart")
    against: str | None = Field(None, description="lines: a strategy that the others are compared with")

    def columns_of_runs(self) -> dict[str, tuple[str, ...]]:
        """Field -> the columns of `runs` that it names."""
        return {"strategy": self.strategy, "size": self.size, "backend": self.backend}

    @property
    def labels(self) -> tuple[str, ...]:
        """Columns of the report that tell its rows apart."""
        return ("size", "backend" if self.report == "cells" else "strategy")

    @property
    def shown(self) -> tuple[str, ...]:
        """Columns of the report that hold its results."""
        if self.report == "cells":
            return ("ratio", "predicted", "measured", "verdict", "regret", "deviation", "spread")
        return ("factorizations", "rest", "wins", "at best", *([f"beats {self.against}"] if self.against else []))

    def of(self, runs: Sequence[Run]) -> list[Row]:
        """The rows of the report. Raises StudyError, see `cells`."""
        cells = self.cells(runs)
        return _cell_rows(cells) if self.report == "cells" else self._line_rows(cells)

    def cells(self, runs: Sequence[Run]) -> list[Cell]:
        """The cells of the converged runs that have unit costs.

        Raises StudyError when there are none, or when a cell has two runs of one strategy.
        """
        known = [run for run in runs if status_of(run) is Status.CONVERGED and number(run.get("seconds_predicted")) > 0]
        if not known:
            raise StudyError("no run converged with unit costs, from which a crossover is told")
        found = []
        for (size, backend), members in grouped(
            [{**run, "size": _words(self.size, run), "backend": _words(self.backend, run)} for run in known],
            ("size", "backend"),
        ).items():
            strategies = tuple(_words(self.strategy, run) for run in members)
            twice = [name for name in strategies if strategies.count(name) > 1]
            if twice:
                raise StudyError(
                    f"{strategies.count(twice[0])} runs are called {twice[0]!r} at {size} with {backend}: "
                    "name a column in strategy, size or backend that tells them apart"
                )
            unit = pooled(members)
            assert unit is not None  # else there were no predictions
            work, seconds, most, predicted = (
                np.array([number(run[name]) for run in members])
                for name in ("factorizations", "seconds", "seconds_most", "seconds_predicted")
            )
            high = np.array([number(run.get("seconds_high")) for run in members])
            slowest = np.where(np.isnan(high), most, high)
            found.append(Cell(size, backend, unit, strategies, work, seconds, slowest, predicted))
        return found

    def _line_rows(self, cells: Sequence[Cell]) -> list[Row]:
        rows = []
        for cell in reference_cells(cells):
            slopes, rests = cell.factorizations, cell.rests
            intervals = lower_envelope(slopes, rests)
            for s, strategy in enumerate(cell.strategies):
                row = {
                    "size": cell.size,
                    "strategy": strategy,
                    "factorizations": slopes[s],
                    "rest": rests[s],
                    "wins": wins(s, intervals),
                    "at best": at_best(s, slopes, rests, intervals),
                }
                if self.against in cell.strategies:
                    other = cell.strategies.index(self.against)
                    row[f"beats {self.against}"] = under(slopes[s] - slopes[other], rests[s] - rests[other])
                rows.append(row)
        return rows


def reference_cells(cells: Sequence[Cell]) -> list[Cell]:
    """For each size the cell of median ρ, whose triangular solve is the unit of cost of the lines."""
    found = []
    for members in by_size(cells).values():
        ordered = sorted(members, key=lambda cell: cell.unit.ratio)
        found.append(ordered[(len(ordered) - 1) // 2])
    return found


def by_size(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """Size -> its cells, in order of appearance."""
    sizes: dict[str, list[Cell]] = {}
    for cell in cells:
        sizes.setdefault(cell.size, []).append(cell)
    return sizes


def _cell_rows(cells: Sequence[Cell]) -> list[Row]:
    rows: list[Row] = []
    for cell in cells:
        predicted, measured = cell.winners
        rows.append(
            {
                "size": cell.size,
                "backend": cell.backend,
                "ratio": cell.unit.ratio,
                "predicted": cell.strategies[predicted],
                "measured": cell.strategies[measured],
                "verdict": cell.verdict,
                "regret": cell.seconds[predicted] / cell.seconds[measured] - 1.0,
                "deviation": np.abs(cell.seconds / cell.predicted - 1.0).max(),
                "spread": float(np.median(cell.slowest / cell.seconds)) - 1.0,
            }
        )
    same, tie = (sum(row["verdict"] == verdict for row in rows) for verdict in (SAME, TIE))
    total = {"size": "all", "backend": NO_RUN, "verdict": f"{same} of {len(rows)} same, {same + tie} with ties"}
    worst = {name: max(row[name] for row in rows) for name in ("regret", "deviation", "spread")}
    return [*rows, {**total, **worst, "predicted": NO_RUN, "measured": NO_RUN, "ratio": NO_RUN}]


def _words(names: tuple[str, ...], run: Run) -> str:
    """A run's values of some columns, "anm, order 20": words as they are, numbers behind the name of their column."""
    found = []
    for name, value in zip(names, key_of(names, run), strict=True):
        if not np.isnan(number(value)):
            found.append(f"{name.rpartition('.')[2]} {value:g}")
        elif value != NO_RUN:
            found.append(str(value))
    return ", ".join(found) or NO_RUN
