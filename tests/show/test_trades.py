"""Trades: the front, the winners and their names, and what is left out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from pydantic import TypeAdapter, ValidationError

from nlsolve.show.figures import BaseFigure, FigureError, FigureSpec, draw
from nlsolve.show.figures.style import ACCENT

ADAPTER: TypeAdapter[BaseFigure] = TypeAdapter(FigureSpec)
NOTHING = pd.DataFrame()
RUNS = pd.DataFrame(
    [
        ("mls", 10, "converged", 0.1, 0.2, ""),
        ("mls", 20, "converged", 0.42, 0.008, ""),
        ("mls", 30, "converged", 2.0, 0.009, ""),  # dearer and worse than another
        ("rbf", 10, "converged", 1.0, 0.0009, "too coarse"),
        ("rbf", 20, "converged", 9.0, 0.0008, np.nan),
        ("rbf", 30, "diverged", 0.01, np.nan, ""),
        ("rbf", 40, "converged", 0.01, np.nan, ""),
    ],
    columns=["discretizer.kind", "solver.order", "status", "seconds", "velocity_error", "doubt"],
)


def picture(runs: pd.DataFrame = RUNS, **spec: Any) -> Figure:
    given = {"name": "trade", "kind": "trade", "group": "discretizer.kind"}
    return draw(ADAPTER.validate_python(given | spec), runs, NOTHING, NOTHING)


def legends(figure: Figure) -> list[list[str]]:
    return [[text.get_text() for text in each.get_texts()] for each in figure.legends]


def points(line: Line2D) -> list[list[float]]:
    return np.asarray(line.get_xydata(), dtype=float).tolist()


def test_the_front_is_a_stair_down_to_the_dearest_run() -> None:
    figure = picture()
    (stair,) = [line for line in figure.axes[0].lines if line.get_drawstyle() == "steps-post"]
    assert points(stair) == [[0.1, 0.2], [0.42, 0.008], [1.0, 0.0009], [9.0, 0.0008], [9.0, 0.0008]]
    assert (figure.axes[0].get_xscale(), figure.axes[0].get_yscale()) == ("log", "log")
    assert figure.axes[0].get_xlabel() == "time inside the method [s]"


def test_the_cheapest_for_each_target_is_ringed_and_named() -> None:
    figure = picture(targets=[0.01, 0.001, 1e-5])
    rings = [line for line in figure.axes[0].lines if line.get_markeredgecolor() == ACCENT and len(points(line)) == 1]
    assert [points(ring) for ring in rings] == [[[0.42, 0.008]], [[1.0, 0.0009]]]
    assert legends(figure) == [
        ["mls", "rbf", "in doubt by its audits", "no run is cheaper and better"],
        ["1 %: mls, order 20, 0.42 s", "0.1 %: rbf, order 10, 1 s, in doubt", "1e-05: no run reaches it"],
    ]


def test_variants_name_the_winners() -> None:
    named = RUNS.assign(variant=[f"setting {number}" for number in range(len(RUNS))])
    assert legends(picture(named, group=[], targets=[0.01]))[1] == ["1 %: setting 1, 0.42 s"]


def test_doubted_runs_are_hollow_and_the_left_out_are_counted() -> None:
    figure = picture()
    hollow = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [point for line in hollow for point in points(line)] == [[1.0, 0.0009]]
    assert figure.axes[0].get_title() == "1 of 7 runs did not converge, 1 converged without a number"
    assert picture(RUNS[:3], title="All").axes[0].get_title() == "All"
    assert legends(picture(RUNS[:3]))[0] == ["mls", "no run is cheaper and better"]


def test_other_costs_without_targets() -> None:
    figure = picture(x="solver.order", targets=[])
    assert len(figure.legends) == 1
    assert figure.axes[0].get_xlabel() == "order"


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ({"x": "second"}, "'second' is not in `runs`; the nearest are seconds"),
        ({"y": "velocity"}, "'velocity' is not in `runs`"),
        ({"group": "discretiser.kind"}, "group 'discretiser.kind' is not in `runs`"),
        (
            {"where": {"solver.order": 30, "discretizer.kind": "rbf"}},
            "none of the 1 chosen runs converged with positive",
        ),
        ({"x": "doubt"}, "none of the 7 chosen runs converged with positive numbers in 'doubt' and 'velocity_error'"),
    ],
)
def test_refusals(spec: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FigureError, match='^figure "trade": .*' + sentence):
        picture(**spec)


def test_targets_are_positive() -> None:
    with pytest.raises(ValidationError, match="greater than 0"):
        picture(targets=[0.0])
