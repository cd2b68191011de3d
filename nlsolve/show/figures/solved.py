"""The share of the problems that each strategy solves, over the cost it is allowed: performance and data profiles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, Field

from nlsolve.results.columns import is_measured
from nlsolve.results.frames import Frames, rows_of
from nlsolve.results.parameters import differing_parameters, settled
from nlsolve.results.profiles import band, ratios, within
from nlsolve.results.selection import Names
from nlsolve.results.verdicts import ACCEPTED, Run, number, solved
from nlsolve.series import Array
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, listing
from nlsolve.show.figures.cases import label_of, labelled, plain, select
from nlsolve.show.figures.paper.look import COLUMN, PAGE
from nlsolve.show.figures.style import axis_label, curve_style, finish, headed, join, symbol

Weights = Annotated[
    dict[str, Annotated[float, Field(gt=0)]],
    BeforeValidator(lambda value: {value: 1.0} if isinstance(value, str) else value),
    Field(min_length=1),
]
WIDEST_BAND = 0.13  # its opacity: many lie over each other


@dataclass(frozen=True)
class Costs:
    """cost : (S, P), ∞ where strategy s did not solve problem p; labels : the S strategies' names."""

    labels: tuple[str, ...]
    cost: Array


class SolvedFigure(BaseFigure):
    """A rising stair a strategy (`group`) over a logarithmic cost; it ends at the share of problems it solves at all.

    A run is a problem solved when it converged, with a verified residual and an error that is accepted or unknown
    (`verdicts.solved`); any other costs ∞. Bands hold the part `interval` of the shares when the problems are drawn
    anew (Efron 1979).
    """

    group: Names = Field(("variant",), min_length=1, description="columns of `runs` that tell the strategies apart")
    problem: Names = Field(
        (), description="columns that tell the problems apart; absent: those that differ within a strategy"
    )
    cost: Weights = Field(
        {"seconds": 1.0}, description="column of `runs`, or columns and the weights they are added with"
    )
    accepted: float = Field(ACCEPTED, gt=0, description="error above which a run is not solved")
    error: str = Field("velocity_error", description="column of `runs` that holds this error")
    bootstrap: int = Field(1000, ge=0, description="draws of problems behind the bands; 0: no bands")
    interval: float = Field(0.9, gt=0, lt=1, description="confidence of the bands")
    seed: int = Field(0, ge=0, description="of the draws")

    def columns_of_runs(self) -> dict[str, Names]:
        return {
            **super().columns_of_runs(),
            "problem": self.problem,
            "cost": tuple(self.cost),
            "error": (self.error,),
        }

    @abstractmethod
    def abscissa(self, costs: Array) -> Array:
        """The costs (S, P) in the unit of the horizontal axis."""

    @abstractmethod
    def words(self) -> str:
        """The label of the horizontal axis."""

    def paint(self, figure: plotting.Figure, frames: Frames) -> pd.DataFrame:
        runs = select(self, frames.runs)
        for column in (*self.problem, *self.cost, self.error):
            self.require(column, runs, "runs")
        found = self.costs(runs)
        reached = self.abscissa(found.cost)
        places = np.unique(reached[np.isfinite(reached)])
        if not len(places):
            raise self.refuse(f"none of the {len(runs)} chosen runs solved its problem, so there is no cost to show")
        width = self.wide(PAGE)
        figure.set_size_inches(width, max(0.5 * width, 0.6 * COLUMN))
        axes = figure.add_subplot()
        axes.set(xscale="log", xlabel=self.words(), ylabel="share of the problems solved", ylim=(-0.02, 1.02))
        right = places[-1] * max(1.05, (places[-1] / places[0]) ** 0.03)
        told = self._stairs(axes, found.labels, reached, np.r_[places, right])
        axes.set_xlim(places[0], right)
        axes.xaxis.set_major_formatter(plotting.LogFormatter())
        axes.xaxis.set_minor_formatter(plotting.LogFormatter(minor_thresholds=(1.0, 0.4)))
        finish(figure, axes, None)
        hard = int(np.isinf(reached).all(axis=0).sum())
        nobody = f"{hard} of {reached.shape[1]} problems are solved by none" if hard else ""
        axes.set_title(headed(figure, join(self.title, nobody)))
        return told

    def costs(self, runs: pd.DataFrame) -> Costs:
        """The cost of every strategy for every problem. Raises FigureError unless each has run each problem once."""
        groups = labelled(self, runs, one_case=False)
        problem = self.problem or _problem_columns(runs, self.group)
        tables = [self._by_problem(label, members, problem) for label, members in groups]
        everyone = list(dict.fromkeys(key for table in tables for key in table))
        for (label, _), table in zip(groups, tables, strict=True):
            missing = [key for key in everyone if key not in table]
            if missing:
                first = ", ".join(f"{name} = {value}" for name, value in zip(problem, missing[0], strict=True))
                raise self.refuse(
                    f"{label} has no run of {len(missing)} of the {len(everyone)} problems, such as {first}: "
                    "choose with `where`, or say with `problem` what tells the problems apart"
                )
        cost = np.array([[self._cost(table[key]) for key in everyone] for table in tables])
        return Costs(tuple(label for label, _ in groups), cost)

    def _by_problem(self, label: str, members: pd.DataFrame, problem: Names) -> Mapping[tuple[str, ...], Run]:
        table: dict[tuple[str, ...], Run] = {}
        for run in rows_of(members):
            key = tuple(str(run[name]) for name in problem)
            if key in table:
                several = members[[tuple(map(str, row)) == key for row in members[list(problem)].to_numpy(object)]]
                raise self.refuse(
                    f"{len(several)} runs of {label} are of one problem; "
                    f"they differ in {listing(differing_parameters(several))}: "
                    "add one to `problem` or `group`, or choose with `where`"
                )
            table[key] = run
        return table

    def _cost(self, run: Run) -> float:
        """Σ weight · column; ∞ for a run that is not solved."""
        if not solved(run, self.accepted, self.error):
            return np.inf
        total = sum(weight * number(run[column]) for column, weight in self.cost.items())
        if not 0.0 < total < np.inf:
            where = label_of({name: run[name] for name in self.group})
            raise self.refuse(
                f"a solved run of {where} has the cost {total:g}, which a logarithmic axis cannot show: "
                f"choose other columns than {listing(list(self.cost))}"
            )
        return float(total)

    def _stairs(self, axes: plotting.Axes, labels: tuple[str, ...], reached: Array, places: Array) -> pd.DataFrame:
        """Draw the stairs and their bands. Returns their corners: a row a strategy and place."""
        shares = within(reached, places)
        ends = band(reached, places, self.interval, self.bootstrap, self.seed) if self.bootstrap else None
        problems = reached.shape[1]
        told = []
        for line, label in enumerate(labels):
            style = curve_style(line, len(places), markers=False)
            count = int(np.isfinite(reached[line]).sum())
            axes.step(places, shares[line], where="post", label=f"{label} ({count}/{problems})", **style)
            told.append(pd.DataFrame({"strategy": plain(label), "cost": places, "share": shares[line]}))
            if ends is not None:
                low, high = ends[0][line], ends[1][line]
                fill: Any = {"step": "post", "color": style["color"], "alpha": WIDEST_BAND, "linewidth": 0}
                axes.fill_between(places, low, high, **fill)
                told[-1] = told[-1].assign(share_low=low, share_high=high)
        return pd.concat(told, ignore_index=True)

    def work(self) -> str:
        """The cost in words: "time inside the method", "triangular solves + 20 factorisations"."""
        weights = {column: "" if weight == 1 else f"{weight:g} " for column, weight in self.cost.items()}
        return " + ".join(weight + symbol(column, "runs") for column, weight in weights.items())


class PerformanceFigure(SolvedFigure):
    """ρ_s(τ) = |{p : t_sp ≤ τ min_s t_sp}|/P : share of problems solved within τ times the least cost of all.

    Dolan & Moré (2002). At τ = 1 it says how often a strategy is the cheapest, at the right what it can solve at all.
    """

    kind: Literal["performance-profile"] = "performance-profile"

    def abscissa(self, costs: Array) -> Array:
        return ratios(costs)

    def words(self) -> str:
        return rf"$\tau$: {self.work()}, over the least of all strategies"


class DataFigure(SolvedFigure):
    """d_s(α) = |{p : t_sp ≤ α}|/P : share of problems solved within a budget α. Moré & Wild (2009)."""

    kind: Literal["data-profile"] = "data-profile"

    def abscissa(self, costs: Array) -> Array:
        return costs

    def words(self) -> str:
        return axis_label(list(self.cost), "runs") if len(self.cost) == 1 else self.work()


def _problem_columns(runs: pd.DataFrame, group: Names) -> Names:
    """Parameters that differ between the runs of one strategy: they tell its problems apart."""
    words = {
        str(name): [str(value) for value in runs[name]] for name in runs if not is_measured(str(name)) or name in group
    }
    return tuple(name for name in words if name not in group and not settled(words, name, group))
