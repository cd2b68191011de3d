"""The data beside a figure: what is drawn, under the names of the program's columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pictures import results, snapshot, spec_of

from nlsolve.results.frames import Frames
from nlsolve.show.figures import drawn, write
from nlsolve.show.figures.cases import plain

ANM: dict[str, Any] = {"solver.kind": "anm", "solver.tolerance": 1e-6}
ONE: dict[str, Any] = {"case": "b"}


def told(frames: dict[str, pd.DataFrame], **spec: Any) -> pd.DataFrame:
    return drawn(spec_of(**spec), Frames(**frames))[1]


def test_curves_of_steps_are_the_points_of_the_lines(frames: dict[str, pd.DataFrame]) -> None:
    spec = spec_of(kind="line", y=["range", "probe_u"], where=ANM, log="y")
    figure, data = drawn(spec, Frames(**frames))
    assert list(data) == ["curve", "case", "time", "range", "probe_u"]
    assert list(dict.fromkeys(data["curve"])) == ["order 10", "order 20"]
    lines = iter(figure.axes[0].lines)
    for curve in ("order 10", "order 20"):
        rows = data[data["curve"] == curve]
        for column in ("range", "probe_u"):
            line = next(lines)
            kept = rows[rows[column].notna()]
            np.testing.assert_array_equal(line.get_xdata(), kept["time"])
            np.testing.assert_array_equal(line.get_ydata(), kept[column])


def test_what_a_logarithm_cannot_show_is_not_told(frames: dict[str, pd.DataFrame]) -> None:
    steps = frames["steps"].assign(probe_v=lambda rows: rows["time"] - 0.3)
    data = told(frames | {"steps": steps}, kind="line", y=["range", "probe_v"], where=ONE, log="y")
    assert len(data) == 60
    assert data["probe_v"].min() > 0
    assert data["probe_v"].isna().sum() == (steps[(steps["case"] == "b") & steps["accepted"]]["probe_v"] <= 0).sum()


def test_points_of_runs_are_in_the_order_of_the_line(frames: dict[str, pd.DataFrame]) -> None:
    data = told(frames, kind="line", source="runs", x="tangents", y="solver.order", where=ANM)
    assert data.to_dict("list") == {
        "curve": ["", ""],
        "case": ["b", "a"],
        "tangents": [88, 208],
        "solver.order": [20, 10],
    }


def test_a_map_tells_every_cell_and_its_marks(frames: dict[str, pd.DataFrame]) -> None:
    runs = frames["runs"].assign(doubt=["", "too coarse", "", ""], velocity_error=[0.3, 0.3, 0.01, np.nan])
    data = told(
        frames | {"runs": runs}, kind="map", x="solver.kind", y=["solver.order", "solver.tolerance"], value="tangents"
    )
    assert list(data["tangents"]) == [208, 88, 94, 2252]
    assert list(data["status"]) == ["converged"] * 3 + ["diverged"]
    assert list(data["in_doubt"]) == [False, True, False, False]
    assert list(data["false_success"]) == [True, False, False, False]


def test_a_trade_tells_which_runs_none_beats(frames: dict[str, pd.DataFrame]) -> None:
    data = told(frames, kind="trade", x="tangents", y="solver.tolerance", group="solver.order")
    assert data[["case", "tangents", "solver.tolerance", "front"]].to_dict("list") == {
        "case": ["a", "b", "c"],
        "tangents": [208, 88, 94],
        "solver.tolerance": [1e-6, 1e-6, 1e-8],
        "front": [False, True, True],
    }


def test_shares_of_problems_solved_are_told_at_every_corner(frames: dict[str, pd.DataFrame]) -> None:
    runs = frames["runs"].iloc[:2].assign(p="one", residual_norm=1e-12, velocity_error=1e-3)
    spec: dict[str, Any] = {"kind": "data-profile", "group": "solver.order", "cost": "tangents", "problem": "p"}
    data = told(frames | {"runs": runs}, **spec, bootstrap=0)
    assert list(data) == ["strategy", "cost", "share"]
    assert data[data["strategy"] == "order 10"]["share"].tolist() == [0, 1, 1]
    assert data["cost"].tolist()[:2] == [88, 208]
    assert list(told(frames | {"runs": runs}, **spec)) == ["strategy", "cost", "share", "share_low", "share_high"]


def test_nodes_are_told_with_their_places_and_values(frames: dict[str, pd.DataFrame]) -> None:
    data = told(frames, kind="field", value="v", where=ONE)
    rows = snapshot("b", 0.6)
    assert list(data) == ["panel", "case", "time", "node", "boundary", "x", "y", "v"]
    np.testing.assert_array_equal(data["v"], rows["v"])
    strip = told(frames, kind="cloud", times=[0.0, 0.6], where=ONE)
    assert list(dict.fromkeys(strip["panel"])) == ["t = 0 s", "t = 0.6 s"]
    assert len(strip) == 2 * len(rows)


def test_a_cloud_tells_the_markers_that_it_draws(frames: dict[str, pd.DataFrame]) -> None:
    fields = frames["fields"].assign(marker_x=frames["fields"]["x"] + 9, marker_y=0.0)
    data = told(frames | {"fields": fields}, kind="cloud", where=ONE)
    np.testing.assert_array_equal(data["x"], snapshot("b", 0.6)["x"] + 9)


def test_a_profile_tells_its_curves_and_the_exact_one(frames: dict[str, pd.DataFrame]) -> None:
    figure, data = drawn(spec_of(kind="profile", axis="x", value="v", where=ONE, time=0), Frames(**frames))
    assert list(data) == ["curve", "x", "y", "v"]
    assert list(dict.fromkeys(data["curve"])) == ["", "exact"]
    ours = data[data["curve"] == ""]
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_xdata(), ours["x"])
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), ours["v"])


def test_the_file_has_every_digit(tmp_path: Path) -> None:
    frames = results()
    path = write(spec_of(kind="line", y="probe_u", where=ONE, formats="pdf"), Frames(**frames), tmp_path).paths[-1]
    read = pd.read_csv(path, dtype=str)["probe_u"].map(float)
    np.testing.assert_array_equal(read, told(frames, kind="line", y="probe_u", where=ONE)["probe_u"])


@pytest.mark.parametrize(
    ("label", "text"),
    [
        ("order 20, tolerance $10^{-6}$", "order 20, tolerance 1e-6"),
        (r"limit $2.5\times 10^{-7}$ ($t$ = 0.3 s)", "limit 2.5e-7 (t = 0.3 s)"),
        ("newton (diverged)", "newton (diverged)"),
    ],
)
def test_labels_in_data_have_no_mathematics(label: str, text: str) -> None:
    assert plain(label) == text
