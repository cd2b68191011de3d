"""Frame strips and animations: a picture a recorded time, all in one window and with one scale of colours."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.animation import FFMpegWriter
from pictures import picture, snapshot, spec_of
from PIL import Image
from pydantic import ValidationError

from nlsolve.results.frames import Frames
from nlsolve.show.figures import FigureError, write
from nlsolve.show.figures.paper.look import COLUMN, PAGE

ONE: dict[str, Any] = {"case": "b"}


def titles(frames: dict[str, pd.DataFrame], **spec: Any) -> list[str]:
    return [axes.get_title() for axes in picture(frames, **spec).axes if axes.get_xlabel() or axes.get_title()]


def test_a_strip_is_a_row_of_pictures_at_the_times(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="cloud", times=[0.0, 0.3, 0.6], where=ONE)
    assert [axes.get_title() for axes in figure.axes] == ["$t$ = 0 s", "$t$ = 0.3 s", "$t$ = 0.6 s"]
    grids = [axes.get_gridspec() for axes in figure.axes]  # type: ignore[union-attr]
    assert {(grid.nrows, grid.ncols) for grid in grids if grid is not None} == {(1, 3)}
    assert figure.get_figwidth() == pytest.approx(PAGE)
    for axes, time in zip(figure.axes, (0.0, 0.3, 0.6), strict=True):
        drawn = np.concatenate([line.get_xydata() for line in axes.lines[:4]])  # type: ignore[misc]
        rows = snapshot("b", time)
        assert sorted(drawn[:, 0]) == pytest.approx(sorted(rows["x"]))


def test_several_cases_are_rows_of_a_strip(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="field", value="v", times=[0.0, 0.6], where={"solver.order": 20})
    grid = figure.axes[0].get_gridspec()
    assert grid is not None
    assert (grid.nrows, grid.ncols) == (2, 2)
    assert [axes.get_title() for axes in figure.axes[:4]] == [
        "tolerance $10^{-6}$, $t$ = 0 s",
        "tolerance $10^{-6}$, $t$ = 0.6 s",
        "tolerance $10^{-8}$, $t$ = 0 s",
        "tolerance $10^{-8}$, $t$ = 0.6 s",
    ]


def test_more_times_than_a_row_holds_go_on_in_the_next(frames: dict[str, pd.DataFrame]) -> None:
    times = [round(0.05 * number, 2) for number in range(8)]
    fields = pd.concat([snapshot("b", time) for time in times])
    figure = picture(frames | {"fields": fields}, kind="cloud", times=times, where=ONE)
    grid = figure.axes[0].get_gridspec()
    assert grid is not None
    assert (grid.nrows, grid.ncols) == (2, 4)


def test_a_time_that_is_not_recorded_is_the_nearest_and_two_of_them_are_refused(
    frames: dict[str, pd.DataFrame],
) -> None:
    assert titles(frames, kind="cloud", times=[0.0, 0.4], where=ONE) == [
        "$t$ = 0 s",
        "$t$ = 0.3 s (nearest to 0.4 s)",
    ]
    sentence = (
        r"several of the times asked for are nearest to t = 0.3 s; recorded times \[s\]: 0, 0.3, 0.6; "
        r"further ones are recorded with record = \{ times = \[…\] \}$"
    )
    with pytest.raises(FigureError, match=sentence):
        picture(frames, kind="cloud", times=[0.28, 0.32], where=ONE)
    with pytest.raises(FigureError, match=r"near time = 0.1 s, time = 0.2 s; recorded times"):
        picture(frames, kind="cloud", times=[0.1, 0.2], where={"case": "d"})
    many = [round(0.01 * number, 2) for number in range(18)]
    fields = pd.concat([snapshot("b", time) for time in many])
    with pytest.raises(FigureError, match="18 cases and times are too many panels"):
        picture(frames | {"fields": fields}, kind="cloud", times=many, where=ONE)


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ({"time": 0.1, "times": [0.2]}, "time and times exclude each other"),
        ({"overlay": True, "times": [0.2]}, "overlay draws cases over each other at one time"),
        ({"overlay": True, "animation": "gif"}, "overlay draws cases over each other at one time"),
        ({"animation": "avi"}, "'gif', 'apng' or 'mp4'"),
        ({"times": [-1]}, "greater than or equal to 0"),
    ],
)
def test_what_does_not_go_together_is_refused_before_anything_runs(spec: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        spec_of(kind="cloud", **spec)


# Animations


@pytest.mark.parametrize("form", ["gif", "apng"])
def test_an_animation_has_a_frame_a_recorded_time(frames: dict[str, pd.DataFrame], tmp_path: Path, form: str) -> None:
    given: dict[str, Any] = {"kind": "field", "value": "v", "where": ONE, "animation": form, "frames_per_second": 4}
    spec = spec_of(**given, formats="png", resolution=72)
    written = write(spec, Frames(**frames), tmp_path)
    assert [path.name for path in written.paths] == ["picture.png", "picture.csv", f"picture.{form}"]
    with Image.open(written.paths[-1]) as moving:
        assert moving.n_frames == 3  # type: ignore[attr-defined]
        assert moving.info["duration"] == 250
        assert moving.width == pytest.approx(72 * COLUMN, abs=1)
        pictures = []
        for number in range(3):
            moving.seek(number)
            pictures.append(np.asarray(moving.convert("RGB"), dtype=int))
    bar = [picture[:, -40:] for picture in pictures]  # the scale of colours is the same in all
    assert all(np.abs(one - bar[0]).mean() < 2 for one in bar)
    assert all(np.abs(one - other).sum() > 0 for one, other in pairwise(pictures))
    again = write(spec, Frames(**frames), tmp_path / "again")
    assert again.paths[-1].read_bytes() == written.paths[-1].read_bytes()


def test_an_animation_of_several_cases_has_the_times_that_all_have(
    frames: dict[str, pd.DataFrame], tmp_path: Path
) -> None:
    fields = frames["fields"]
    fewer = fields[~((fields["case"] == "c") & (fields["time"] == 0.3))]
    spec = spec_of(
        kind="cloud",
        where={"solver.kind": ["anm", "newton"]},
        group=["solver.kind", "solver.order", "solver.tolerance"],
        animation="gif",
        formats="png",
        resolution=60,
    )
    path = write(spec, Frames(**frames | {"fields": fewer}), tmp_path).paths[-1]
    with Image.open(path) as moving:
        assert moving.n_frames == 2  # type: ignore[attr-defined]
        assert moving.width == pytest.approx(60 * PAGE, abs=1)


def test_a_strip_with_an_animation_is_both(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    spec = spec_of(kind="cloud", where=ONE, times=[0.0, 0.6], animation="gif", formats="png", resolution=60)
    strip, _, moving = write(spec, Frames(**frames), tmp_path).paths
    with Image.open(strip) as still, Image.open(moving) as film:
        assert still.width == pytest.approx(60 * PAGE, abs=1)
        assert film.width == pytest.approx(60 * COLUMN, abs=1)
        assert film.n_frames == 3  # type: ignore[attr-defined]


def test_one_recorded_time_makes_no_animation(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    spec = spec_of(kind="cloud", where=ONE, animation="gif", formats="png")
    fields = frames["fields"]
    sentence = r"two recorded times or more, and only t = 0.6 s is recorded; .* record = \{ times = \[…\] \}"
    with pytest.raises(FigureError, match=sentence):
        write(spec, Frames(**frames | {"fields": fields[fields["time"] == 0.6]}), tmp_path)


def test_mp4_needs_ffmpeg(frames: dict[str, pd.DataFrame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = spec_of(kind="cloud", where=ONE, animation="mp4", formats="png", resolution=60)
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    written = write(spec, Frames(**frames), tmp_path)
    assert [path.name for path in written.paths] == ["picture.png", "picture.csv"]
    assert written.notes == (
        'figure "picture": MP4 needs the program ffmpeg, which is not installed; gif and apng need nothing',
    )


def test_mp4_where_there_is_ffmpeg(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    if not FFMpegWriter.isAvailable():
        pytest.skip("ffmpeg is not installed")
    spec = spec_of(kind="cloud", where=ONE, animation="mp4", formats="png", resolution=61)
    assert write(spec, Frames(**frames), tmp_path).paths[-1].stat().st_size > 1000
