"""Figures on paper: they are as wide as the study says, nothing of them is cut off, and every format can be had."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.transforms import Bbox
from pictures import picture, spec_of

from nlsolve.registry.problems import StudyError
from nlsolve.results.frames import Frames
from nlsolve.show.figures import FigureError, Look, save, write
from nlsolve.show.figures.paper import tex
from nlsolve.show.figures.paper.look import COLUMN, PAGE, inches
from nlsolve.study.study import Study

ANM: dict[str, Any] = {"solver.kind": "anm", "solver.tolerance": 1e-6}
ONE: dict[str, Any] = {"case": "b"}
KINDS: list[dict[str, Any]] = [
    {"kind": "line", "y": ["probe_u", "probe_v"], "where": {"solver.kind": "anm"}},
    {"kind": "line", "source": "runs", "x": "solver.kind", "y": "tangents", "log": "y", "title": "Every run " * 8},
    {"kind": "map", "x": "solver.order", "y": ["solver.kind", "solver.tolerance"], "value": "tangents"},
    {"kind": "trade", "x": "tangents", "y": "solver.tolerance", "group": "solver.order"},
    {"kind": "data-profile", "group": "solver.order", "cost": "tangents", "problem": "p", "bootstrap": 9},
    {"kind": "cloud", "group": ["solver.kind", "solver.order", "solver.tolerance"], "probe": (0, 1.6)},
    {"kind": "cloud", "times": [0.0, 0.3, 0.6], "where": ONE},
    {"kind": "profile", "axis": "y", "value": "u", "where": ANM},
    {"kind": "field", "value": "v", "where": ANM},
    {"kind": "field", "value": "rate", "log": True, "where": ONE},
]
NAMES = [f"{number}-{spec['kind']}" for number, spec in enumerate(KINDS)]


def with_problems(frames: dict[str, pd.DataFrame], spec: dict[str, Any]) -> dict[str, pd.DataFrame]:
    """The frames; for shares of problems solved, of two strategies with a problem each."""
    if "profile" not in spec["kind"] or spec["kind"] == "profile":
        return frames
    runs = frames["runs"].iloc[:2].assign(p="one", residual_norm=1e-12, velocity_error=1e-3)
    return frames | {"runs": runs}


def media_box(path: Path) -> tuple[float, float]:
    """Width and height of the page of a PDF [1/72 inch]."""
    found = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", path.read_bytes())
    assert found is not None
    return float(found[1]), float(found[2])


@pytest.mark.parametrize("spec", KINDS, ids=NAMES)
@pytest.mark.parametrize(("width", "points"), [("single", 255.12), ("double", 510.24), ("75 mm", 212.6), ("4in", 288)])
def test_a_figure_is_as_wide_as_it_should_be(
    frames: dict[str, pd.DataFrame], tmp_path: Path, spec: dict[str, Any], width: str, points: float
) -> None:
    figure = picture(with_problems(frames, spec), **spec, width=width)
    assert figure.get_figwidth() * 72 == pytest.approx(points, abs=0.01)
    (page,) = save(figure, tmp_path, "picture", Look(formats=("pdf",)))
    assert media_box(page)[0] == pytest.approx(points, abs=1.0)


@pytest.mark.parametrize("spec", KINDS, ids=NAMES)
@pytest.mark.parametrize("size", [7, 9, 11])
def test_nothing_is_cut_off_in_a_narrow_column(
    frames: dict[str, pd.DataFrame], spec: dict[str, Any], size: int
) -> None:
    figure = picture(with_problems(frames, spec), **spec, width="84 mm", font_size=size)
    figure.draw_without_rendering()
    drawn = figure.get_tightbbox()
    paper = Bbox([[0, 0], figure.get_size_inches()])
    assert drawn.x0 >= paper.x0 - 0.01
    assert drawn.y0 >= paper.y0 - 0.01
    assert drawn.x1 <= paper.x1 + 0.01
    assert drawn.y1 <= paper.y1 + 0.01
    for axes in figure.axes:
        for name, label in (("title", axes.title), ("x", axes.xaxis.label), ("y", axes.yaxis.label)):
            if label.get_text():
                box = label.get_window_extent()
                assert figure.bbox.x0 - 1 <= box.x0 <= box.x1 <= figure.bbox.x1 + 1, name


def test_letters_have_the_size_that_is_asked_for(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", y="range", where=ANM, font_size=6, title="Ranges")
    (axes,) = figure.axes
    assert (axes.title.get_fontsize(), axes.xaxis.label.get_fontsize()) == (6, 6)
    assert axes.get_xticklabels()[0].get_fontsize() == pytest.approx(6 * 8 / 9)
    assert figure.legends[0].get_texts()[0].get_fontsize() == pytest.approx(6 * 8 / 9)


def test_fonts_are_serif_unless_others_are_asked_for(frames: dict[str, pd.DataFrame]) -> None:
    def family(**look: Any) -> str:
        return str(picture(frames, kind="line", y="range", where=ONE, **look).axes[0].xaxis.label.get_fontname())

    assert family() == family(font="serif") == "STIXGeneral"
    assert family(font="sans-serif") == "DejaVu Sans"
    assert family(font="cmr10") == "cmr10"
    with pytest.raises(
        FigureError, match=r"font 'DejaVu Sams' is not installed; there are serif, sans-serif, DejaVu S"
    ):
        family(font="DejaVu Sams")


@pytest.mark.parametrize("form", ["png", "pdf", "svg"])
def test_a_format_that_is_asked_for_is_written_and_the_same_twice(
    frames: dict[str, pd.DataFrame], tmp_path: Path, form: str
) -> None:
    spec: dict[str, Any] = {"kind": "line", "y": "range", "where": ANM, "formats": form}
    for folder in ("one", "two"):
        written = write(spec_of(**spec), Frames(**frames), tmp_path / folder)
        assert [path.name for path in written.paths] == [f"picture.{form}", "picture.csv"]
        assert written.notes == ()
    assert [path.name for path in (tmp_path / "one").iterdir()] == [path.name for path in (tmp_path / "two").iterdir()]
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
        assert str(tmp_path).encode() not in path.read_bytes()


def test_png_has_the_dots_that_are_asked_for(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    for resolution, pixels in ((None, 472), (300, 708)):
        spec = spec_of(kind="line", y="range", where=ONE, width="60 mm", formats="png", resolution=resolution)
        header = write(spec, Frames(**frames), tmp_path).paths[0].read_bytes()[16:20]
        assert int.from_bytes(header, "big") == pixels


def test_without_data_there_is_none(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    write(spec_of(kind="line", y="range", where=ONE, data=False, formats="pdf"), Frames(**frames), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["picture.pdf"]


def test_pgf_without_an_engine_of_tex_is_a_sentence_and_the_other_formats_are_there(
    frames: dict[str, pd.DataFrame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tex.shutil, "which", lambda name: None)
    written = write(spec_of(kind="line", y="range", where=ONE, formats=["pgf", "png"]), Frames(**frames), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["picture.csv", "picture.png"]
    assert written.notes == (
        'figure "picture": PGF needs an engine of TeX to measure its texts (pdflatex, lualatex or xelatex), and none '
        "is installed",
    )


def test_a_map_whose_cells_would_be_too_narrow_is_refused(frames: dict[str, pd.DataFrame]) -> None:
    runs = pd.concat([frames["runs"].iloc[:1].assign(**{"case": f"r{i}", "solver.order": i}) for i in range(20)])
    spec = {"kind": "map", "x": "solver.order", "y": "solver.kind", "value": "tangents", "width": "60 mm"}
    with pytest.raises(FigureError, match=r"20 columns .* leave 2\.\d mm for a cell of 60 mm; choose a larger width"):
        picture(frames | {"runs": runs}, **spec)


# What a study says


def study(**entries: Any) -> Study:
    figures = [
        {"kind": "line", "name": "one", "y": "residual_norm"},
        {"kind": "line", "name": "two", "y": "residual_norm", "width": "single", "formats": "png"},
    ]
    document: dict[str, Any] = {"question": "?", "scene": {"kind": "published", "problem": "boggs"}, "figure": figures}
    return Study.from_dict({**document, **entries})


def test_figures_are_as_the_study_says_unless_they_say_otherwise() -> None:
    one, two = study(figures={"width": "double", "formats": ["pdf", "svg"], "font_size": 8}).figures
    assert (one.width, one.formats, one.font_size, one.wide(COLUMN)) == ("double", ("pdf", "svg"), 8, PAGE)
    assert (two.width, two.formats, two.font_size, two.wide(PAGE)) == ("single", ("png",), 8, COLUMN)
    plain, _ = study().figures
    assert (plain.width, plain.formats, plain.wide(PAGE)) == (None, None, PAGE)


@pytest.mark.parametrize(
    ("figures", "sentence"),
    [
        ({"width": 84}, r'figures.width = 84: should be a length with its unit: "84 mm" or "84 in"'),
        ({"width": "wide"}, r"figures.width = 'wide': should be single, double, or a length with its unit: 84 mm, "),
        ({"width": "84 m"}, r"a length with its unit"),
        ({"width": "2 mm"}, r"2 mm is no width of a figure, which has 30 to 500 mm"),
        ({"formats": ["sgv"]}, r"figures.formats\[0\] = 'sgv': should be .*; did you mean 'svg'\?"),
        ({"formats": []}, r"figures.formats = \[\]"),
        ({"font_size": 90}, r"figures.font_size = 90"),
        ({"resolution": 1}, r"figures.resolution = 1"),
        ({"widht": "single"}, r"figures.widht = 'single': no such field; did you mean 'width'\?"),
        ([], r"figures"),
    ],
)
def test_a_look_that_cannot_be_is_told_by_key_value_and_way_out(figures: Any, sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence):
        study(figures=figures)


def test_what_figures_look_like_is_no_part_of_what_tells_cases_apart() -> None:
    assert [case.id for case in study().cases] == [case.id for case in study(figures={"width": "double"}).cases]


def test_lengths_in_all_units() -> None:
    lengths = [inches(text) for text in ("84 mm", "8.4cm", "3.307 in", "239 pt")]
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-3)
