"""Colours: those of curves and of the material differ for everybody, and pictures can be read without colours."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from matplotlib.tri import TriContourSet
from pictures import picture, snapshot

from nlsolve.show.figures.nodes.cloud import HALVES
from nlsolve.show.figures.style import COLOURS, DASHES, ERROR_MAP, MARKERS, POSITIVE_MAP, SIGNED_MAP, curve_style

# linear RGB -> XYZ (sRGB, D65), and the colours that a dichromat sees by Machado, Oliveira, Fernandes (2009), table 1
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
SEEN = {
    "everybody": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}


def lab(colours: Any, seen: str = "everybody") -> np.ndarray:
    """L*a*b* of colours, shape (…, 3), as they are seen."""
    given = np.asarray(colours, dtype=float)
    linear = np.where(given <= 0.04045, given / 12.92, ((given + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ SEEN[seen].T, 0, 1)
    ratio = linear @ XYZ.T / (XYZ @ np.ones(3))
    f = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def test_lightness_is_that_of_the_definition() -> None:
    np.testing.assert_allclose(lab([[0, 0, 0], [1, 1, 1]])[:, 0], [0, 100], atol=1e-3)
    np.testing.assert_allclose(lab([1, 0, 0]), [53.24, 80.09, 67.20], atol=0.05)
    red, green = lab([to_rgb("#D02010"), to_rgb("#408000")], "deuteranopia")
    assert np.hypot(*(red - green)[1:]) < np.hypot(*np.subtract(*lab([to_rgb("#D02010"), to_rgb("#408000")]))[1:]) / 5


@pytest.mark.parametrize("seen", SEEN)
def test_colours_of_curves_differ_for_everybody(seen: str) -> None:
    """Two colours that differ by ΔE = 10 are told apart in a thin line; 2.3 is the least that is seen side by side."""
    distances = [
        np.linalg.norm(np.subtract(*lab([to_rgb(one), to_rgb(other)], seen))) for one, other in combinations(COLOURS, 2)
    ]
    assert min(distances) > 10


def test_curves_differ_without_colours() -> None:
    """By their lines up to seven, by lines and markers together up to seven times seven."""
    assert len(DASHES) == len(MARKERS) == len(COLOURS) == 7
    lines = [str(curve_style(number, 100, False)["linestyle"]) for number in range(7)]
    assert len(set(lines)) == 7
    marked = [curve_style(number, 10, True) for number in range(49)]
    assert len({(str(style["linestyle"]), style["marker"]) for style in marked}) == 49
    coloured = [curve_style(number, 10, False) for number in range(49)]
    assert len({(str(style["linestyle"]), style["color"]) for style in coloured}) == 49


def test_every_line_of_a_figure_has_its_own_pattern(frames: dict[str, pd.DataFrame]) -> None:
    """Two columns of three cases without markers: six lines."""
    figure = picture(frames, kind="line", y=["probe_u", "probe_v"], where={"solver.kind": "anm"}, markers=False)
    patterns = {str(line._unscaled_dash_pattern) for line in figure.axes[0].lines}  # type: ignore[attr-defined]
    assert len(patterns) == len(figure.axes[0].lines) == 6


@pytest.mark.parametrize("seen", SEEN)
def test_the_halves_of_the_material_differ_in_lightness(seen: str) -> None:
    upper, lower = (lab(to_rgb(colour), seen) for _, colour in HALVES)
    assert abs(upper[0] - lower[0]) > 15


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("name", [ERROR_MAP, POSITIVE_MAP])
def test_sequential_colours_are_monotone_in_lightness(name: str, seen: str) -> None:
    steps = np.diff(lab(colormaps[name](np.linspace(0, 1, 64))[:, :3], seen)[:, 0])
    assert (steps > 0).all() or (steps < 0).all()
    assert abs(steps.sum()) > 50


@pytest.mark.parametrize("seen", SEEN)
def test_colours_of_a_sign_darken_from_zero_on_and_differ_in_hue(seen: str) -> None:
    colours = lab(colormaps[SIGNED_MAP](np.linspace(0, 1, 65))[:, :3], seen)
    assert (np.diff(colours[:33, 0]) > -0.5).all()
    assert (np.diff(colours[32:, 0]) < 0.5).all()
    assert colours[32, 0] > 90
    for place in (8, 16, 24):
        assert np.hypot(*(colours[place] - colours[64 - place])[1:]) > 20


def test_where_a_field_is_negative_it_has_dashed_lines(frames: dict[str, pd.DataFrame]) -> None:
    """In grey, −v looks like v: lines of negative levels alone tell them apart, in the field and in its bar."""
    figure = picture(frames, kind="field", value="v", where={"case": "b"})
    axes, bar = figure.axes
    filled, lines = [drawn for drawn in axes.collections if isinstance(drawn, TriContourSet)]
    assert filled.filled
    assert not lines.filled
    assert (np.asarray(lines.levels) < 0).all()
    reached = [level for level, path in zip(lines.levels, lines.get_paths(), strict=True) if len(path)]
    assert min(reached) > snapshot("b", 0.6)["v"].min()
    assert {str(line) for line in lines.get_linestyle()} != {"(0, None)"}
    assert len(bar.collections) >= 2
    for spec in ({"value": "rate"}, {"value": "rate", "log": True}, {"value": "exx"}):  # exx is 0 everywhere
        figure = picture(frames, kind="field", where={"case": "b"}, **spec)
        assert len([drawn for drawn in figure.axes[0].collections if isinstance(drawn, TriContourSet)]) == 1
