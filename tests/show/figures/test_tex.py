"""PGF: texts that are LaTeX, in documents that every engine compiles without losing a letter or a point of width."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.text import Text
from pictures import picture, spec_of
from typesetting import ENGINES, as_letters, compiled, needs, words_on

from nlsolve.results.frames import Frames
from nlsolve.show.figures import FigureError, Look, save, write
from nlsolve.show.figures.paper.tex import in_tex, texts_in_tex

PACKAGES = ("pgf.sty", "underscore.sty")
HOSTILE = r"50 % of #1_x & {b} ~ ^ \η <‖R‖₂> ε̄"


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        ("tangents", "tangents"),
        ("50 % & #1_x", r"50 \% \& \#1\_x"),
        ("η ≤ $10^{-3}$", r"\ensuremath{\eta} \ensuremath{\leq} $10^{-3}$"),
        (r"$\bar{ε}$ [1/s]", r"$\bar{\ensuremath{\varepsilon}}$ {[}1/s{]}"),
        ("$5", r"\textdollar{}5"),
        (r"\$5 and $a_{\max}$", r"\textdollar{}5 and $a_{\max}$"),
        ("two\nlines_", "two\nlines\\_"),
        (r"$\mathdefault{−2}$", r"$\mathdefault{\ensuremath{-}2}$"),
        ("", ""),
    ],
)
def test_a_text_in_latex(text: str, tex: str) -> None:
    assert in_tex(text) == tex


def test_texts_are_as_before_when_pgf_is_written(frames: dict[str, pd.DataFrame]) -> None:
    figure = picture(frames, kind="line", source="runs", x="solver.kind", y="tangents", title="η_x")
    figure.draw_without_rendering()

    def texts() -> list[tuple[str, list[str]]]:
        return [(text.get_text(), text.get_fontfamily()) for text in figure.findobj(Text)]

    before = texts()
    with texts_in_tex(figure, "sans-serif"):
        figure.draw_without_rendering()
        within = [text for text, _ in texts()]
        assert r"\ensuremath{\eta}\_x" in within
        assert all(family == ["sans-serif"] for text, family in texts() if "eta" in text)
    figure.draw_without_rendering()
    assert texts() == before


def hostile(frames: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Results whose cases are called by everything that TeX understands otherwise."""
    return frames | {"runs": frames["runs"].assign(variant=[HOSTILE, "$5", "plain", "newton"])}


DRAWN: list[dict[str, Any]] = [
    {"kind": "line", "y": "range", "group": "variant", "title": f"title {HOSTILE}"},
    {"kind": "line", "source": "runs", "x": "variant", "y": "tangents", "where": {"case": ["a", "b"]}},
    {"kind": "map", "x": "solver.kind", "y": "variant", "value": "tangents"},
    {"kind": "field", "value": "rate", "log": True, "where": {"case": "b"}, "title": HOSTILE},
    {"kind": "cloud", "times": [0.0, 0.6], "where": {"case": "b"}},
]


@pytest.mark.parametrize("engine", ENGINES)
def test_every_letter_is_on_the_page_and_the_width_is_that_of_the_line(
    frames: dict[str, pd.DataFrame], tmp_path: Path, engine: str
) -> None:
    needs(engine, PACKAGES)
    for number, given in enumerate(DRAWN):
        spec = spec_of(**given).with_(name=f"f{number}", formats=("pgf",), width="345 pt")  # article's line
        assert write(spec, Frames(**hostile(frames)), tmp_path).notes == ()
    body = "\n\n".join(rf"\noindent\input{{f{number}.pgf}}\clearpage" for number in range(len(DRAWN)))
    page = compiled(tmp_path, body, engine)
    words = words_on(page)
    for text in ("$5", "tangents", "boundary"):
        assert words.count(as_letters(text, engine)) >= 1, text
    assert words.count(as_letters(HOSTILE, engine)) >= 3


def test_the_letters_are_those_of_the_paper_and_of_the_size_asked_for(
    frames: dict[str, pd.DataFrame], tmp_path: Path
) -> None:
    needs("pdflatex", PACKAGES)
    figure = picture(frames, kind="line", y="range", where={"case": "b"}, font_size=7)
    (path,) = save(figure, tmp_path, "picture", Look(formats=("pgf",), font_size=7))
    text = path.read_text(encoding="utf-8")
    assert text.isascii()
    assert set(re.findall(r"\\(?:rmfamily|sffamily|fontfamily|setmainfont)", text)) == {r"\rmfamily"}
    assert {float(size) for size in re.findall(r"\\fontsize\{([\d.]+)\}", text)} >= {7.0}
    (path,) = save(figure, tmp_path, "picture", Look(formats=("pgf",), font="sans-serif"))
    assert set(re.findall(r"\\(?:rm|sf)family", path.read_text(encoding="utf-8"))) == {r"\sffamily"}


def test_pgf_is_the_same_twice(frames: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    needs("pdflatex", PACKAGES)
    spec: dict[str, Any] = {"kind": "field", "value": "u", "where": {"case": "b"}}
    texts = []
    for folder in ("one", "two"):
        (path,) = save(picture(frames, **spec), tmp_path / folder, "picture", Look(formats=("pgf",)))
        texts.append(path.read_text(encoding="utf-8"))
        assert "usepackage{pgf}" in (tmp_path / folder / "preamble.tex").read_text(encoding="utf-8")
    assert texts[0] == texts[1]
    assert str(tmp_path) not in texts[0]


def test_mathematics_that_cannot_be_set_is_refused_in_a_sentence(
    frames: dict[str, pd.DataFrame], tmp_path: Path
) -> None:
    needs("pdflatex", PACKAGES)
    for form in ("pgf", "png"):
        spec = spec_of(kind="line", y="range", where={"case": "b"}, title=r"$\nosuchthing$", formats=form)
        with pytest.raises(FigureError, match=r'^figure "picture": mathematics in one .* cannot be set: .*nosuchthing'):
            write(spec, Frames(**frames), tmp_path)
