"""Which strategy is cheapest by the price of a factorisation: predicted lines, their envelope, and measured runs."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve.registry.problems import StudyError
from nlsolve.results.costs.crossover import OTHER, Cell, Crossover, by_size, reference_cells
from nlsolve.results.costs.lower_envelope import lower_envelope
from nlsolve.results.frames import Frames, Row, rows_of
from nlsolve.results.selection import Names
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure
from nlsolve.show.figures.cases import select
from nlsolve.show.figures.paper.look import COLUMN, PAGE
from nlsolve.show.figures.style import ACCENT, curve_style, headed, join, legend_outside

MARGIN = 3.0  # of ρ on either side of the cells
POINTS = 200  # of a line; straight lines bend on logarithmic axes
ENVELOPE, LOST = "cheapest by the lines", "another one than predicted was cheapest"


class CrossoverFigure(BaseFigure):
    """cost = n_F ρ + rest over ρ = factorisation / triangular solve, logarithmic; a panel a size, a line a strategy.

    The unit of the cost is the triangular solve of the linear solver of median ρ. A mark is a run: at the ρ of its
    linear solver, as far from its line as its seconds are from those predicted, with a bar over its rounds. The band
    is the lower envelope. A red line is a cell whose cheapest strategy is not the one predicted, beyond the rounds.
    """

    kind: Literal["crossover"] = "crossover"
    strategy: Names = Field(("variant",), description="column or columns that tell strategies apart")
    size: Names = Field(("nodes",), description="column or columns that tell panels apart, such as nodes")
    backend: Names = Field(("linear.ordering",), description="column or columns that tell linear solvers apart")

    def columns_of_runs(self) -> dict[str, Names]:
        return {**super().columns_of_runs(), "strategy": self.strategy, "size": self.size, "backend": self.backend}

    @property
    def shows_seconds(self) -> bool:
        return True

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        for column in (*self.strategy, *self.size, *self.backend):
            self.require(column, frames.runs, "runs")
        axes_of = Crossover(strategy=self.strategy, size=self.size, backend=self.backend)
        try:
            cells = axes_of.cells(rows_of(select(self, frames.runs)))
        except StudyError as error:
            raise self.refuse(str(error)) from error
        strategies = list(dict.fromkeys(name for cell in cells for name in cell.strategies))
        sizes = by_size(cells)
        width = self.wide(PAGE)
        columns = min(2 if width > COLUMN else 1, len(sizes))
        rows = -(-len(sizes) // columns)
        figure.set_size_inches(width, max((0.42 if columns == 2 else 0.5) * width, 0.6 * COLUMN) * rows)
        panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for panel in panels[len(sizes) :]:
            panel.remove()
        for panel in panels[max(0, len(sizes) - columns) : len(sizes)]:  # the lowest of each column
            panel.tick_params(labelbottom=True)
        ratios = [cell.unit.ratio for cell in cells]
        across = np.geomspace(min(ratios) / MARGIN, max(ratios) * MARGIN, POINTS)
        told: list[Row] = []
        for panel, reference, (size, members) in zip(panels, reference_cells(cells), sizes.items(), strict=False):
            told += self._panel(panel, reference, members, strategies, across)
            panel.set_title(headed(figure, join(size, _score(members)), 1 / columns))
        figure.supxlabel("factorisation / triangular solve")
        figure.supylabel("cost [triangular solves]")
        if self.title:
            figure.suptitle(headed(figure, self.title))
        handles: list[Any] = [
            plotting.Line2D([], [], label=name, **curve_style(place, 1, markers=True))
            for place, name in enumerate(strategies)
        ]
        handles.append(plotting.Line2D([], [], color="0.85", linewidth=5, label=ENVELOPE))
        if any(cell.verdict == OTHER for cell in cells):
            handles.append(plotting.Line2D([], [], color=ACCENT, linewidth=0.8, linestyle=":", label=LOST))
        legend_outside(figure, handles, [str(handle.get_label()) for handle in handles])
        return pd.DataFrame(told)

    def _panel(
        self, axes: plotting.Axes, reference: Cell, members: list[Cell], strategies: list[str], across: Any
    ) -> list[Row]:
        """Draw the lines of one size, their envelope, and the runs of its cells. Returns a row a run, with its line."""
        told: list[Row] = []
        slopes, rests = reference.factorizations, reference.rests
        lowest = np.min(slopes[:, None] * across + rests[:, None], axis=0)
        axes.plot(across, lowest, color="0.85", linewidth=5, zorder=1, solid_capstyle="butt")
        for _, low, _ in lower_envelope(slopes, rests)[1:]:
            if across[0] < low < across[-1]:
                axes.axvline(low, color="0.6", linewidth=0.5, zorder=0)
        for slope, rest, name in zip(slopes, rests, reference.strategies, strict=True):
            style = curve_style(strategies.index(name), POINTS, markers=False)
            axes.plot(across, slope * across + rest, zorder=2, **style)
            for cell in members:
                if name not in cell.strategies:
                    continue
                s = cell.strategies.index(name)
                height = (slope * cell.unit.ratio + rest) / cell.predicted[s]
                mark = curve_style(strategies.index(name), 1, markers=True) | {"linestyle": "none", "zorder": 3}
                axes.plot([cell.unit.ratio], [height * cell.seconds[s]], **mark)
                ends = [height * cell.seconds[s], height * cell.slowest[s]]
                axes.plot([cell.unit.ratio] * 2, ends, color=mark["color"], linewidth=0.6, zorder=2)
                told.append(
                    {
                        "size": cell.size,
                        "backend": cell.backend,
                        "strategy": name,
                        "factorizations": slope,
                        "rest": rest,
                        "factor_solve_ratio": cell.unit.ratio,
                        "cost_predicted": slope * cell.unit.ratio + rest,
                        "cost": ends[0],
                        "cost_most": ends[1],
                    }
                )
        for cell in members:
            if cell.verdict == OTHER:
                axes.axvline(cell.unit.ratio, color=ACCENT, linewidth=0.8, linestyle=":", zorder=0)
        axes.set(xscale="log", yscale="log", xlim=(across[0], across[-1]))
        axes.grid(True, color="0.92", linewidth=0.5)
        axes.set_axisbelow(True)
        return told


def _score(members: list[Cell]) -> str:
    """In how many cells the winner was predicted, ties within the rounds included."""
    right = sum(cell.verdict != OTHER for cell in members)
    return f"winner predicted in {right} of {len(members)}"
