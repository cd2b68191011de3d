"""Figures: what is on them, that they come out the same twice, and every way a declaration can miss the results."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.text import Text
from matplotlib.tri import TriContourSet
from pictures import ADAPTER, INNER, legend, picture, snapshot
from pydantic import ValidationError

from nlsolve.show.figures import FigureError, draw, save
from nlsolve.show.figures.nodes.panels import MOST_PANELS
from nlsolve.show.figures.nodes.sections import outline, slice_triangles, triangulate
from nlsolve.show.figures.style import axis_label


def curves(axes: Axes) -> list[np.ndarray]:
    return [np.column_stack(line.get_data()) for line in axes.lines if len(line.get_xdata()) > 2]  # type: ignore[arg-type]


ANM: dict[str, Any] = {"solver.kind": "anm", "solver.tolerance": 1e-6}
ONE: dict[str, Any] = {"case": "b"}


# Curves


def test_one_curve_a_group_labelled_and_in_order(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="range", where=ANM, group="solver.order", reference=1)
    assert legend(figure) == ["order 10", "order 20"]
    (axes,) = figure.axes
    assert [len(curve) for curve in curves(axes)] == [60, 60]
    assert axes.get_xlabel() == "$t$ [s]"
    assert axes.get_ylabel() == r"$a_{\max}$"
    assert axes.get_xlim()[1] == pytest.approx(0.6 + 0.04 * 0.59)


def test_all_steps_when_asked(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="residual_norm", log="y", where=ONE, accepted_only=False)
    assert len(curves(figure.axes[0])[0]) == 120
    assert figure.axes[0].get_yscale() == "log"
    assert legend(figure) == []


def test_groups_default_to_what_differs(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="range", where={"solver.order": 20})
    assert legend(figure) == ["tolerance $10^{-6}$", "tolerance $10^{-8}$"]


def test_columns_share_an_axis_with_their_unit(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y=["probe_u", "probe_v"], where=ONE)
    assert legend(figure) == ["$u$", "$v$"]
    assert figure.axes[0].get_ylabel() == "$u$, $v$ [mm/s]"
    assert axis_label(["probe_u", "time"], "steps") == "$u$ [mm/s], $t$ [s]"


def test_a_failed_case_says_so_in_the_legend(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="range", where={"case": ["b", "d"]}, group="solver.kind")
    assert legend(figure) == ["anm", "newton (diverged) (no values)"]


def test_runs_are_sorted_and_failures_crossed_out(frames: dict[str, pd.DataFrame]) -> None:
    shuffled = frames | {"runs": frames["runs"].iloc[[3, 1, 0, 2]]}
    figure = picture(shuffled, kind="line", source="runs", x="tangents", y="solver.order", where=ANM)
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_xdata(), [88, 208])
    figure = picture(shuffled, kind="line", source="runs", x="solver.kind", y="tangents", log="y")
    assert legend(figure) == ["not converged"]
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["newton", "anm"]


def test_own_labels_and_title_win(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="range", where=ONE, xlabel="time", ylabel="", title="Ranges")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("time", "", "Ranges")


def test_legend_is_inside_the_paper_and_off_the_axes(frames: dict[str, pd.DataFrame]) -> None:
    runs = pd.concat([frames["runs"].iloc[:1].assign(**{"case": f"r{i}", "solver.order": 10**i}) for i in range(12)])
    steps = pd.concat([frames["steps"][:120].assign(case=f"r{i}") for i in range(12)])
    figure = draw(
        ADAPTER.validate_python({"name": "many", "kind": "line", "y": "range"}), runs, steps, frames["fields"]
    )
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert figure.bbox.x0 <= box.x0
    assert box.x1 <= figure.bbox.x1
    assert box.y0 >= figure.axes[0].get_window_extent().y1
    styles = {(line.get_color(), str(line._unscaled_dash_pattern)) for line in figure.axes[0].lines}  # type: ignore[attr-defined]
    assert len(styles) == 12


# Clouds, profiles, fields


def test_hole_is_masked_and_the_walls_remain() -> None:
    rows = snapshot("a", 0.0)
    triangulation = triangulate(rows)
    tool = int((rows["boundary"] == "tool").sum())
    plate = int((rows["boundary"] == "plate").sum())
    assert triangulation.mask is not None
    assert triangulation.mask.sum() == tool - 2  # what fills a polygon of that many corners
    assert len(triangulation.get_masked_triangles()) == 2 * len(rows) - tool - plate  # Euler: an annulus
    assert len(outline(triangulation)) == tool + plate


def test_nodes_without_value_leave_holes() -> None:
    rows = snapshot("a", 0.0)
    value = rows["u"].to_numpy(float).copy()
    inside = int(np.flatnonzero(rows["boundary"] == "")[40])
    value[inside] = np.nan
    triangulation = triangulate(rows, value)
    assert inside not in triangulation.get_masked_triangles()
    assert len(triangulation.get_masked_triangles()) < len(triangulate(rows).get_masked_triangles())


def test_boundary_read_from_csv_has_nan_inside() -> None:
    rows = snapshot("a", 0.0)
    blank = rows.assign(boundary=rows["boundary"].replace("", np.nan))
    np.testing.assert_array_equal(triangulate(blank).mask, triangulate(rows).mask)


def test_slice_of_a_linear_field_is_exact_and_broken_at_the_hole() -> None:
    rows = snapshot("a", 0.2)
    x, y = rows["x"].to_numpy(), rows["y"].to_numpy()
    place, value = slice_triangles(triangulate(rows), x, y - 0.4, 3 * x - 2 * y + 1)
    kept = np.isfinite(place)
    np.testing.assert_allclose(value[kept], 3 * place[kept] - 0.8 + 1, atol=1e-12)
    assert (~kept).sum() == 1
    gap = int(np.flatnonzero(~kept)[0])
    assert -INNER < place[gap - 1] < -0.8 * INNER
    assert 0.8 * INNER < place[gap + 1] < INNER
    assert (np.diff(place[:gap]) > 0).all()


def test_profile_meets_the_nodes_and_shows_the_exact_solution(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="profile", axis="x", value="v", where=ONE, time=0)
    assert legend(figure) == ["$v$", "exact"]
    ours, exact = curves(figure.axes[0])
    assert ours[np.nanargmax(ours[:, 1])] == pytest.approx([INNER, 153])
    assert np.nanmax(exact[:, 1]) == pytest.approx(150)
    assert figure.axes[0].get_title() == ""
    assert figure.axes[0].get_ylabel() == "$v$ [mm/s]"


def test_profile_without_exact_solution(frames: dict[str, pd.DataFrame]) -> None:
    unknown = frames | {"fields": frames["fields"].assign(exact_u=np.nan)}
    figure = picture(unknown, kind="profile", axis="y", value="u", where=ANM, group="solver.order")
    assert legend(figure) == ["order 10", "order 20"]
    assert len(curves(figure.axes[0])) == 2


def test_time_is_the_nearest_and_said_when_off(frames: dict[str, pd.DataFrame]) -> None:
    near = picture(frames, kind="profile", axis="y", value="u", where=ONE, time=0.304)
    assert near.axes[0].get_title() == ""
    far = picture(frames, kind="field", value="u", where=ONE, time=0.4)
    assert far.axes[0].get_title() == "$t$ = 0.3 s, nearest to 0.4 s"
    bare = frames | {"runs": frames["runs"].drop(columns="time.increment")}
    assert picture(bare, kind="cloud", where=ONE, time=0.304).axes[0].get_title() == "$t$ = 0.3 s, nearest to 0.304 s"


def test_cloud_shows_both_halves_and_the_probe(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="cloud", where=ONE, time=0.6, probe=(0, 1.6))
    (axes,) = figure.axes
    assert axes.get_aspect() == 1
    rows = snapshot("b", 0.6)
    counts = [len(line.get_xdata()) for line in axes.lines]  # type: ignore[arg-type]
    assert sum(counts[:4]) == len(rows)
    assert counts[0] + counts[1] == (rows["y0"] > 0).sum()
    assert counts[1] + counts[3] == (rows["boundary"] != "").sum()
    probe = np.asarray(axes.lines[4].get_xydata(), dtype=float)[0]
    start = np.array([probe @ [np.cos(0.6), np.sin(0.6)], probe @ [-np.sin(0.6), np.cos(0.6)]])
    assert np.hypot(*start) == pytest.approx(INNER)
    assert legend(figure) == ["$y_0 > 0$", r"$y_0 \leq 0$", "boundary", "probe"]
    assert "probe" not in legend(picture(frames, kind="cloud", where=ONE))


def test_field_is_centred_on_zero(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="field", value="u", where=ONE)
    axes, bar = figure.axes
    low, high = bar.get_ylim()
    assert high == -low == pytest.approx(snapshot("b", 0.6)["u"].abs().max())
    assert axes.get_aspect() == 1
    assert bar.get_ylabel() == "$u$ [mm/s]"
    bands = np.diff(axes.collections[0].levels)  # type: ignore[attr-defined]
    assert len(bands) % 2 == 1


def test_field_limit_window_and_logarithm(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="field", value="u", where=ONE, limit=20, window=(-3, 3, -2, 2))
    assert figure.axes[1].get_ylim() == pytest.approx((-20, 20))
    assert figure.axes[0].get_xlim() == (-3, 3)
    rate = picture(frames, kind="field", value="rate", where=ONE)
    assert rate.axes[1].get_ylim()[0] == 0
    decades = picture(frames, kind="field", value="rate", where=ONE, log=True)
    assert decades.axes[1].get_ylim() == (-4, 3)
    assert decades.axes[1].get_yticklabels()[-1].get_text() == "$10^{3}$"
    assert not isinstance(decades.axes[0].collections[0].norm, BoundaryNorm)


def test_an_overlay_draws_the_second_case_over_the_first(frames: dict[str, pd.DataFrame]) -> None:
    """The second field is half of the first: its contour lines end at the half of the largest level."""
    two: dict[str, Any] = {"where": {"solver.order": 20}, "group": "solver.tolerance", "overlay": True}
    fields = frames["fields"].copy()
    fields.loc[fields["case"] == "c", ["u", "x"]] *= [0.5, 1.0]
    figure = picture(frames | {"fields": fields}, kind="field", value="u", **two)
    axes, _ = figure.axes
    assert legend(figure) == ["tolerance $10^{-6}$", "tolerance $10^{-8}$"]
    filled, lines = [drawn for drawn in axes.collections if isinstance(drawn, TriContourSet)]
    assert filled.filled
    assert not lines.filled
    reached = [level for level, path in zip(lines.levels, lines.get_paths(), strict=True) if len(path)]
    largest = snapshot("b", 0.6)["u"].abs().max()
    assert max(map(abs, reached)) <= 0.5 * largest < max(map(abs, lines.levels))
    cloud = picture(frames, kind="cloud", **two)
    assert len(cloud.axes) == 1
    assert legend(cloud) == ["$y_0 > 0$", r"$y_0 \leq 0$", "boundary", "tolerance $10^{-8}$"]
    assert len(cloud.axes[0].lines[-1].get_xdata()) == len(snapshot("c", 0.6))  # type: ignore[arg-type]
    with pytest.raises(FigureError, match=r"overlay = true: the case 'newton \(diverged\)' left no nodes"):
        picture(
            frames, kind="field", value="u", overlay=True, group=["solver.kind", "solver.order", "solver.tolerance"]
        )


def test_small_multiples_share_colours_and_show_who_is_missing(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="field", value="v", group=["solver.kind", "solver.order", "solver.tolerance"])
    assert [axes.get_title() for axes in figure.axes[:4]] == [
        "anm, order 10, tolerance $10^{-6}$",
        "anm, order 20, tolerance $10^{-6}$",
        "anm, order 20, tolerance $10^{-8}$",
        "newton (diverged)",
    ]
    assert "no values" in [text.get_text() for text in figure.axes[3].findobj(Text)]
    assert len(figure.axes) == 5
    assert figure.get_figwidth() == pytest.approx(180 / 25.4)


def test_every_column_of_panels_has_its_axis_and_a_title_is_off_the_legend(frames: dict[str, pd.DataFrame]) -> None:
    five = [f"r{number}" for number in range(5)]
    runs = pd.concat([frames["runs"].iloc[:1].assign(case=case) for case in five])
    fields = pd.concat([snapshot(case, 0.0) for case in five])
    figure = picture(frames | {"runs": runs, "fields": fields}, kind="cloud", title="Five")
    assert [bool(axes.get_xlabel()) for axes in figure.axes] == [False, False, True, True, True]
    figure.draw_without_rendering()
    (heading,) = [text for text in figure.texts if text.get_text() == "Five"]
    assert not heading.get_window_extent().overlaps(figure.legends[0].get_window_extent())


def test_a_field_at_rest_is_drawn(frames: dict[str, pd.DataFrame]) -> None:
    assert picture(frames, kind="field", value="exx", where=ONE).axes[1].get_ylim() == (-1, 1)


# Files


@pytest.mark.parametrize(
    "spec",
    [
        {
            "kind": "line",
            "y": "residual_norm",
            "log": "y",
            "group": ["solver.kind", "solver.order", "solver.tolerance"],
        },
        {"kind": "line", "source": "runs", "x": "solver.order", "y": "tangents", "group": "solver.tolerance"},
        {"kind": "map", "x": "solver.order", "y": ["solver.kind", "solver.tolerance"], "value": "tangents"},
        {"kind": "trade", "x": "tangents", "y": "solver.tolerance", "group": "solver.order"},
        {"kind": "cloud", "time": 0, "where": ONE, "probe": (0, 1.6)},
        {"kind": "profile", "axis": "y", "value": "u", "where": ANM},
        {"kind": "field", "value": "rate", "log": True, "where": ANM},
    ],
    ids=lambda spec: str(spec["kind"]),
)
def test_files_are_the_same_twice(frames: dict[str, pd.DataFrame], tmp_path: Path, spec: dict[str, Any]) -> None:
    first = save(picture(frames, **spec), tmp_path / "new" / "one", "picture")
    again = save(picture(frames, **spec), tmp_path / "two", "picture")
    assert [path.name for path in first] == ["picture.png", "picture.pdf"]
    assert first[0].read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert first[1].read_bytes().startswith(b"%PDF-")
    assert b"CreationDate" not in first[1].read_bytes()
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in again]


def test_style_of_the_caller_is_left_alone(frames: dict[str, pd.DataFrame]) -> None:
    before = dict(rcParams)
    picture(frames, kind="line", y="range", where=ONE)
    assert dict(rcParams) == before


def test_pyplot_and_its_global_state_are_never_loaded() -> None:
    source = "import sys, nlsolve.show.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", source], check=False).returncode == 0


# Refusals


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ({"kind": "line", "y": "rnage"}, r"column 'rnage' is not in `steps`; the nearest are range"),
        ({"kind": "line", "source": "runs", "x": "zzz", "y": "tangents"}, r"'zzz' is not in `runs`; there are case"),
        ({"kind": "line", "y": "branch"}, r"column 'branch': this column is called tangents now$"),
        ({"kind": "map", "x": "case", "y": "case", "value": "branches"}, r"this column is called tangents now$"),
        ({"kind": "line", "y": "range", "where": {"said_failed_but_is": 0}}, r"is called false_failure now$"),
        (
            {"kind": "line", "y": "range", "where": {"solver.ordr": 20}},
            r"where 'solver.ordr' .* nearest are solver.order",
        ),
        ({"kind": "line", "y": "range", "where": {"solver.order": 25}}, r"solver.order = 25; .* have 10.0, 20.0, nan"),
        (
            {"kind": "line", "y": "range", "where": {"solver.kind": "newton", "solver.order": 20}},
            r"no case has solver.order = 20; the cases left have nan",
        ),
        (
            {"kind": "line", "y": "range", "where": {"case": "d"}},
            r"'range' .* holds no number in the 60 accepted steps",
        ),
        (
            {"kind": "line", "source": "runs", "x": "solver.order", "y": "velocity_error"},
            r"'velocity_error' over x = 'solver.order' holds no number in the 4 runs .* tangents",
        ),
        ({"kind": "line", "y": "range", "group": "solver.oder"}, r"group 'solver.oder' is not in `runs`"),
        (
            {"kind": "line", "y": "range", "group": "solver.order"},
            r"leaves 2 cases under the one label 'order 20'; they differ in solver.tolerance",
        ),
        ({"kind": "profile", "axis": "x", "value": "u", "at": 7, "where": ONE}, r"line y = 7 mm misses the cloud"),
        (
            {"kind": "field", "value": "u", "where": {"case": "d"}},
            r"in x, y, u near the last time; recorded times .* 0.3",
        ),
        ({"kind": "cloud", "where": {"case": "d"}, "time": 0.1}, r"near time = 0.1 s"),
        ({"kind": "field", "value": "u", "log": True, "where": ONE}, r"'u' has a sign"),
        (
            {"kind": "field", "value": "u", "where": ONE, "window": (1, 0, 0, 1)},
            r"window = \(1.0, 0.0, 0.0, 1.0\) is empty",
        ),
    ],
)
def test_refusals_name_figure_field_value_and_way_out(
    frames: dict[str, pd.DataFrame], spec: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(FigureError, match=r'^figure "picture": .*' + sentence):
        picture(frames, **spec)


def test_refusals_of_empty_results(frames: dict[str, pd.DataFrame]) -> None:
    with pytest.raises(FigureError, match="there are no runs"):
        picture(frames | {"runs": frames["runs"].iloc[:0]}, kind="line", y="range")
    with pytest.raises(FigureError, match="there are no accepted steps"):
        picture(frames | {"steps": frames["steps"].assign(accepted=False)}, kind="line", y="range", where=ONE)
    still = frames | {"fields": frames["fields"].assign(rate=0.0)}
    with pytest.raises(FigureError, match="nowhere positive"):
        picture(still, kind="field", value="rate", log=True, where=ONE)
    below = frames | {"steps": frames["steps"].assign(residual_norm=0.0)}
    with pytest.raises(FigureError, match="that a logarithmic axis can show"):
        picture(below, kind="line", y="residual_norm", log="y", where=ONE)
    with pytest.raises(FigureError, match="numbers in x, y, u near the last time"):
        picture(frames | {"fields": frames["fields"].iloc[:0]}, kind="field", value="u", where=ONE)


def test_too_many_panels_are_refused(frames: dict[str, pd.DataFrame]) -> None:
    many = range(MOST_PANELS + 1)
    runs = pd.concat([frames["runs"].iloc[:1].assign(case=f"r{i}") for i in many])
    fields = pd.concat([snapshot(f"r{i}", 0.0) for i in many])
    with pytest.raises(FigureError, match="13 cases are too many panels; choose at most 12"):
        picture(frames | {"runs": runs, "fields": fields}, kind="cloud")


@pytest.mark.parametrize(
    "spec",
    [
        {"kind": "lines", "y": "range"},
        {"kind": "line"},
        {"kind": "line", "y": []},
        {"kind": "line", "y": "range", "logg": "y"},
        {"kind": "line", "y": "range", "name": "../escape"},
        {"kind": "field", "value": "w"},
        {"kind": "field", "value": "u", "limit": 0},
        {"kind": "profile", "axis": "z", "value": "u"},
        {"kind": "cloud", "time": -1},
    ],
)
def test_wrong_declarations_are_refused_before_anything_runs(spec: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ADAPTER.validate_python({"name": "picture", **spec})


def test_values_of_where_may_be_lists_booleans_and_words(frames: dict[str, pd.DataFrame]) -> None:
    columns: dict[str, Any] = {"physics.inertia": [True, False, True, None], "record.probe": [[0.0, 1.6]] * 4}
    runs = frames["runs"].assign(**columns)
    figure = picture(
        frames | {"runs": runs}, kind="line", y="range", where={"physics.inertia": [True, False], "solver.kind": "anm"},
        group=["physics.inertia", "solver.order", "record.probe"],
    )  # fmt: skip
    assert legend(figure) == [
        "inertia, order 10, probe (0, 1.6)",
        "no inertia, order 20, probe (0, 1.6)",
        "inertia, order 20, probe (0, 1.6)",
    ]
