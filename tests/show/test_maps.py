"""Maps: what stands in every cell, what the marks mean, and how a false success is told from a right answer."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from pydantic import TypeAdapter, ValidationError

from nlsolve.contracts.status import Status
from nlsolve.results.parameters import differing_parameters
from nlsolve.results.verdicts import cheapest, outcome, percent
from nlsolve.show.figures import BaseFigure, FigureError, FigureSpec, draw
from nlsolve.show.figures.map import code, short
from nlsolve.show.figures.paper.look import PAGE
from nlsolve.show.figures.style import ACCENT

ADAPTER: TypeAdapter[BaseFigure] = TypeAdapter(FigureSpec)
NOTHING = pd.DataFrame()
RUNS = pd.DataFrame(
    [
        ("n = 1", "disc", "converged", 0.012, ""),
        ("n = 1", "ring", "converged", 0.3, ""),
        ("n = 0.1", "disc", "converged", 0.3, "too coarse"),
        ("n = 0.1", "ring", "budget spent", np.nan, ""),
        ("p = 40", "disc", "converged", 2e-5, np.nan),
    ],
    columns=["variant", "scene.kind", "status", "velocity_error", "doubt"],
).assign(**{"law.index": [1, 1, 0.1, 0.1, 0.5], "seconds": [0.5, 2.0, 1.0, 3.0, 250.0]})


def picture(runs: pd.DataFrame = RUNS, **spec: Any) -> Figure:
    given = {"name": "map", "kind": "map", "x": "scene.kind", "y": "variant"}
    return draw(ADAPTER.validate_python(given | spec), runs, NOTHING, NOTHING)


def words(figure: Figure) -> dict[tuple[int, int], str]:
    """Text of the cells by (column, row)."""
    places = {text.get_position(): text.get_text() for text in figure.axes[0].texts}
    return {(int(x), int(y)): word for (x, y), word in places.items()}


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


def framed(figure: Figure) -> list[tuple[int, int]]:
    """Cells with a red frame."""
    patches = [patch for patch in figure.axes[0].patches if isinstance(patch, Rectangle)]
    red = [patch for patch in patches if to_hex(patch.get_edgecolor()) == ACCENT.lower()]
    return [(round(patch.get_x() + 0.48), round(patch.get_y() + 0.43)) for patch in red]


def test_every_cell_says_what_became_of_its_run() -> None:
    figure = picture()
    assert words(figure) == {(0, 0): "1.2 %", (1, 0): "30 %", (0, 1): "30 %", (1, 1): "BS", (0, 2): "2e-5", (1, 2): "·"}
    axes = figure.axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["disc", "ring"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["n = 1", "n = 0.1", "p = 40"]
    assert axes.get_ylim() == (2.5, -0.5)  # the first row on top
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("scene", "")
    assert figure.axes[1].get_xlabel() == "relative error of the velocity"


def test_a_false_success_is_framed_and_a_doubted_run_is_not() -> None:
    figure = picture()
    assert framed(figure) == [(1, 0)]
    corners = [patch for patch in figure.axes[0].patches if isinstance(patch, Polygon)]
    assert [np.round(patch.get_xy()[0]).tolist() for patch in corners] == [[0, 1]]
    assert legend(figure) == [
        "false success: error above 5 % (1)",
        "in doubt by its audits (1)",
        "BS: budget spent (1)",
    ]
    assert framed(picture(accepted=0.5)) == []
    assert framed(picture(RUNS.drop(columns="doubt"))) == [(1, 0), (0, 1)]


def test_a_value_that_is_no_error_is_judged_by_the_velocity() -> None:
    figure = picture(value="seconds")
    assert framed(figure) == [(1, 0)]
    assert words(figure)[0, 2] == "250"
    assert figure.axes[1].get_xlabel() == "time inside the method [s]"


def test_numbers_are_labels_and_several_columns_are_words() -> None:
    figure = picture(x="scene.kind", y="law.index", where={"variant": ["n = 1", "n = 0.1"]})
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["1", "0.1"]
    assert figure.axes[0].get_ylabel() == "index"
    figure = picture(y=["variant", "law.index"])
    assert figure.axes[0].get_yticklabels()[0].get_text() == "n = 1, index 1"
    missing = RUNS.assign(**{"law.index": [1, 1, 0.1, 0.1, np.nan]})
    assert picture(missing, y="law.index").axes[0].get_yticklabels()[2].get_text() == "–"


def test_families_are_separated_by_a_line() -> None:
    assert len(picture().axes[0].lines) == 0
    lines = picture(separate=True).axes[0].lines
    assert [line.get_ydata()[0] for line in lines] == [1.5]  # type: ignore[index]


def test_only_failures_and_converged_without_a_number() -> None:
    failed = picture(RUNS.assign(status="diverged"))
    assert set(words(failed).values()) == {"DIV", "·"}
    assert len(failed.axes) == 1  # no colours, no bar
    unknown = picture(RUNS.assign(velocity_error=[0.01, *[np.nan] * 4]))
    assert words(unknown)[1, 0] == "–"
    assert framed(unknown) == []


def test_a_page_holds_45_rows_and_6_columns() -> None:
    cells = [(f"a = {row}", f"column {column}") for row in range(45) for column in range(6)]
    runs = pd.DataFrame(cells, columns=["variant", "scene.kind"]).assign(status="converged")
    figure = picture(runs.assign(velocity_error=np.geomspace(1e-6, 1, len(runs))))
    figure.draw_without_rendering()
    assert figure.get_figwidth() <= PAGE
    assert figure.get_figheight() < 1.6 * PAGE
    axes = figure.axes[0]
    width = axes.get_window_extent().width / 6
    assert max(text.get_window_extent().width for text in axes.texts) < 0.9 * width
    labels = [label.get_window_extent() for label in axes.get_yticklabels()]
    assert all(above.y0 >= below.y1 - 1 for above, below in pairwise(labels))


def test_long_names_of_columns_lean_and_do_not_overlap() -> None:
    names = [f"a rather long name of a column, number {column}" for column in range(9)]
    runs = pd.DataFrame({"scene.kind": names, "variant": "a", "status": "converged", "velocity_error": 0.1})
    figure = picture(runs)
    figure.draw_without_rendering()
    assert {label.get_rotation() for label in figure.axes[0].get_xticklabels()} == {35}
    assert figure.get_figwidth() == pytest.approx(PAGE)


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ({"x": "status"}, r"2 runs land in the cell 'converged', 'n = 1'; they differ in scene.kind: add one to `x`"),
        ({"x": "scene.kin"}, r"'scene.kin' is not in `runs`; the nearest are scene.kind"),
        ({"value": "velocity_eror"}, r"'velocity_eror' is not in `runs`"),
        ({"value": "doubt"}, r"value = 'doubt' holds no positive number in the 4 converged runs"),
    ],
)
def test_refusals(spec: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FigureError, match='^figure "map": .*' + sentence):
        picture(**spec)


def test_too_many_cells_are_refused() -> None:
    runs = pd.DataFrame({"variant": range(50), "scene.kind": range(50), "status": "converged", "velocity_error": 1.0})
    with pytest.raises(FigureError, match="50 by 50 cells are too many; choose at most 2000"):
        picture(runs)


def test_wrong_declarations() -> None:
    for wrong in ({"x": []}, {"accepted": 0}, {"colour": "red"}):
        with pytest.raises(ValidationError):
            picture(**wrong)


# The words


@pytest.mark.parametrize(
    ("value", "column", "expected"),
    [
        (0.0123, "velocity_error", "1.2 %"),
        (0.3, "velocity_error_inside", "30 %"),
        (1e-4, "torque_error", "0.01 %"),
        (3.4e-5, "velocity_error", "3e-5"),
        (25.0, "velocity_error", "25"),
        (1234.5, "seconds", "1234"),
        (0.034, "seconds", "0.034"),
        (2e7, "seconds", "2e7"),
        (0.0, "seconds", "0"),
        (np.nan, "seconds", "–"),
    ],
)
def test_numbers_in_two_digits(value: float, column: str, expected: str) -> None:
    assert short(value, column) == expected


def test_codes_and_percent() -> None:
    assert [code(status) for status in (Status.BUDGET_SPENT, Status.DIVERGED, Status.SINGULAR_TANGENT)] == [
        "BS",
        "DIV",
        "ST",
    ]
    assert [percent(value) for value in (0.01, 0.0005, 1e-6)] == ["1 %", "0.05 %", "1e-06"]


# Outcomes


def test_outcomes() -> None:
    good = {"status": "converged", "velocity_error": 0.01}
    assert outcome(good) == "right"
    assert outcome(good | {"velocity_error": 0.06}) == "wrong"
    assert outcome(good | {"velocity_error": 0.06}, accepted=0.1) == "right"
    assert outcome(good | {"velocity_error": 0.06, "doubt": "coarse"}) == "doubted"
    assert outcome(good | {"velocity_error": 0.06, "doubt": np.nan}) == "wrong"
    assert outcome(good | {"velocity_error": np.nan}) == "converged"
    assert outcome({"status": "diverged", "velocity_error": 0.01, "doubt": "coarse"}) == "diverged"
    assert outcome(good | {"torque_error": 1.0}, error="torque_error") == "wrong"


def test_the_cheapest_run() -> None:
    runs = [{"status": "converged", "seconds": s, "velocity_error": e} for s, e in [(1, 0.1), (2, 0.01), (3, 0.001)]]
    runs.append({"status": "diverged", "seconds": 0, "velocity_error": 0})
    runs.append({"status": "converged", "seconds": np.nan, "velocity_error": 0})
    best = cheapest(runs, "seconds", "velocity_error", 0.01)
    assert best is not None
    assert best["seconds"] == 2
    assert cheapest(runs, "seconds", "velocity_error", 1e-4) is None


def test_what_tells_runs_apart() -> None:
    runs = pd.DataFrame({"variant": ["a", "b", "a", "b"], "law.index": [1, 2, 1, 2], "solver.order": [5, 5, 9, 9]})
    assert differing_parameters(runs) == ["variant", "solver.order"]
    assert differing_parameters(runs.drop(columns="variant")) == ["law.index", "solver.order"]
    assert differing_parameters(runs[:1]) == []
