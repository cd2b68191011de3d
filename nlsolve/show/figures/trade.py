"""Error over cost of every run, the front of runs that none beats in both, and the cheapest run for each target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS
from nlsolve.results.frames import Frames, rows_of
from nlsolve.results.parameters import differing_parameters
from nlsolve.results.selection import Names
from nlsolve.results.verdicts import Run, cheapest, doubt, is_error, number, percent
from nlsolve.series import Array
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure
from nlsolve.show.figures.cases import label_of, labelled, select
from nlsolve.show.figures.paper.look import COLUMN, PAGE
from nlsolve.show.figures.style import ACCENT, COLOURS, IN_DOUBT, MARKERS, axis_label, headed, join, legend_outside

FRONT = "no run is cheaper and better"


class TradeFigure(BaseFigure):
    """error over cost, both logarithmic, a mark a converged run, hollow where it is in doubt.

    The stair is the front min {error : cost ≤ c}; the cheapest run with error ≤ each target is ringed and named.
    """

    kind: Literal["trade"] = "trade"
    x: str = Field("seconds", description="column of `runs`: the cost")
    y: str = Field("velocity_error", description="column of `runs`: the error")
    targets: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (0.01, 0.001), description="errors for which the cheapest run is named"
    )

    def columns_of_runs(self) -> dict[str, Names]:
        return {**super().columns_of_runs(), "x": (self.x,), "y": (self.y,)}

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        for column in (self.x, self.y):
            self.require(column, frames.runs, "runs")
        chosen = select(self, frames.runs)
        converged = chosen[[status is Status.CONVERGED for status in chosen["status"].map(Status.of)]]
        cost, error = (converged[name].map(number).to_numpy(float) for name in (self.x, self.y))
        runs = converged[(cost > 0) & (error > 0) & np.isfinite(cost + error)]
        if runs.empty:
            raise self.refuse(
                f"none of the {len(chosen)} chosen runs converged with positive numbers in {self.x!r} and {self.y!r}"
            )
        width = self.wide(PAGE)
        figure.set_size_inches(width, max(0.5 * width, 0.6 * COLUMN))
        axes = figure.add_subplot()
        axes.set(xscale="log", yscale="log", xlabel=axis_label([self.x], "runs"), ylabel=axis_label([self.y], "runs"))
        handles = self._points(axes, runs)
        front = _front(runs[self.x].to_numpy(float), runs[self.y].to_numpy(float))
        reached = set(zip(*front, strict=True))
        axes.margins(0.06)
        axes.step(*front, where="post", color="0.35", linewidth=0.8, zorder=1)
        handles.append(plotting.Line2D([], [], color="0.35", linewidth=0.8, label=FRONT))
        axes.grid(True, color="0.92", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.set_title(headed(figure, join(self.title, *self._left_out(chosen, converged, runs))))
        legend_outside(figure, handles, [str(handle.get_label()) for handle in handles])
        winners = self._winners(axes, runs)
        if winners:
            legend_outside(figure, winners, [str(handle.get_label()) for handle in winners], "lower")
        names = dict.fromkeys(("case", *differing_parameters(runs), *self.group, self.x, self.y))
        told = runs[[name for name in names if name in runs]]
        places = zip(runs[self.x].astype(float), runs[self.y].astype(float), strict=True)
        doubted = [bool(doubt(run)) for run in rows_of(runs)]
        return told.assign(in_doubt=doubted, front=[place in reached for place in places])

    def _points(self, axes: plotting.Axes, runs: pd.DataFrame) -> list[Any]:
        """Draw the marks by group; returns their entries of the legend."""
        handles: list[Any] = []
        doubted = runs.apply(lambda run: bool(doubt(run)), axis=1).to_numpy(bool)
        position = {case: place for place, case in enumerate(runs.index)}
        for place, (label, members) in enumerate(labelled(self, runs, one_case=False)):
            colour = COLOURS[place % len(COLOURS)]
            marker = MARKERS[(place + place // len(COLOURS)) % len(MARKERS)]
            style: Any = {"linestyle": "none", "marker": marker, "color": colour, "markersize": 5, "zorder": 3}
            for hollow in (False, True):
                which = members[[doubted[position[case]] == hollow for case in members.index]]
                face: Any = (
                    {"markerfacecolor": "white"} if hollow else {"markeredgecolor": "white", "markeredgewidth": 0.4}
                )
                axes.plot(which[self.x], which[self.y], **style, **face)
            if label:
                handles.append(plotting.Line2D([], [], label=label, **style))
        if doubted.any():
            hollow_mark: Any = {
                "linestyle": "none",
                "marker": "o",
                "markerfacecolor": "white",
                "color": "0.35",
                "markersize": 5,
            }
            handles.append(plotting.Line2D([], [], label=IN_DOUBT, **hollow_mark))
        return handles

    def _winners(self, axes: plotting.Axes, runs: pd.DataFrame) -> list[Any]:
        """Draw a ring and a line for each target; returns entries of the legend with the names of the cheapest runs."""
        candidates, words = rows_of(runs), differing_parameters(runs)
        handles = []
        for place, target in enumerate(self.targets):
            best = cheapest(candidates, self.x, self.y, target)
            ring: Any = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "markeredgecolor": ACCENT}
            ring |= {"markersize": 9 + 3 * place, "markeredgewidth": 1.1, "zorder": 4}
            goal = percent(target) if is_error(self.y) else f"{target:g}"
            if best is None:
                handles.append(plotting.Line2D([], [], linestyle="none", label=f"{goal}: no run reaches it"))
                continue
            axes.axhline(target, color=ACCENT, linewidth=0.5, linestyle=(0, (1, 3)), zorder=1)
            axes.plot([best[self.x]], [best[self.y]], **ring)
            handles.append(plotting.Line2D([], [], label=f"{goal}: {self._name(best, words)}", **ring))
        return handles

    def _name(self, run: Run, words: Sequence[str]) -> str:
        """A run in words: "mls, graded-rings, first 0.05, 0.42 s"."""
        unit = RUNS[self.x].unit if self.x in RUNS else ""
        price = f"{float(run[self.x]):.2g} {unit}".strip()
        return join(label_of({name: run[name] for name in words}), price, "in doubt" if doubt(run) else "")

    def _left_out(self, chosen: pd.DataFrame, converged: pd.DataFrame, runs: pd.DataFrame) -> list[str]:
        """Sentences on the runs that are not drawn."""
        failed, without = len(chosen) - len(converged), len(converged) - len(runs)
        return [
            f"{failed} of {len(chosen)} runs did not converge" if failed else "",
            f"{without} converged without a number" if without else "",
        ]


def _front(cost: Array, error: Array) -> tuple[Array, Array]:
    """Cost and error of the runs that none beats in both, by rising cost; last, the same error at the largest cost."""
    order = np.lexsort((error, cost))
    cost, error = cost[order], error[order]
    best = np.minimum.accumulate(error)
    kept = np.r_[True, best[1:] < best[:-1]]
    return np.r_[cost[kept], cost[-1]], np.r_[error[kept], best[-1]]
