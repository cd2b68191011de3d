"""Figures a study declares, for print: curves, maps, trades, crossovers and solved problems of runs, curves of steps,
clouds, profiles and fields.

`draw` makes a `matplotlib.figure.Figure` of a declared figure and the result frames, without pyplot; `write` writes it
as its look says, as PNG, PDF, SVG or PGF with its data beside it, the same bytes every time.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated

import pandas as pd
from pydantic import Field

from nlsolve.results.frames import Frames
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, FigureError, listing
from nlsolve.show.figures.crossover import CrossoverFigure
from nlsolve.show.figures.line import LineFigure
from nlsolve.show.figures.map import MapFigure
from nlsolve.show.figures.nodes.animation import animate
from nlsolve.show.figures.nodes.cloud import CloudFigure
from nlsolve.show.figures.nodes.field import FieldFigure
from nlsolve.show.figures.nodes.panels import ANIMATIONS, PanelsFigure
from nlsolve.show.figures.nodes.profile import ProfileFigure
from nlsolve.show.figures.paper.files import as_png, missing, save
from nlsolve.show.figures.paper.look import COLUMN, Look
from nlsolve.show.figures.solved import DataFigure, PerformanceFigure
from nlsolve.show.figures.style import FONTS, style_of
from nlsolve.show.figures.trade import TradeFigure
from nlsolve.show.provenance import Provenance, digest_of

__all__ = [
    "BaseFigure",
    "CloudFigure",
    "CrossoverFigure",
    "DataFigure",
    "FieldFigure",
    "FigureError",
    "FigureSpec",
    "Frames",
    "LineFigure",
    "Look",
    "MapFigure",
    "PerformanceFigure",
    "ProfileFigure",
    "TradeFigure",
    "Written",
    "content_of",
    "draw",
    "drawn",
    "save",
    "write",
]

FigureSpec = Annotated[
    LineFigure
    | MapFigure
    | TradeFigure
    | CrossoverFigure
    | PerformanceFigure
    | DataFigure
    | CloudFigure
    | ProfileFigure
    | FieldFigure,
    Field(discriminator="kind"),
]
"""What a study's `[[figure]]` may be."""


@dataclass(frozen=True)
class Written:
    """The files of a figure, and a sentence for each that was asked for and cannot be written on this machine.

    figure : what was drawn, as the look says.
    """

    paths: tuple[Path, ...]
    notes: tuple[str, ...]
    figure: plotting.Figure
    look: Look

    @property
    def png(self) -> bytes:
        """The picture for a screen, whether or not PNG is one of its formats."""
        path = next((path for path in self.paths if path.suffix == ".png"), None)
        return path.read_bytes() if path and self.look.resolution is None else as_png(self.figure, self.look)

    @property
    def inches(self) -> float:
        """Its width on paper."""
        return self.figure.get_figwidth()

    @property
    def moving(self) -> tuple[bytes, str] | None:
        """The animation and its format; None without one."""
        form = next((path for path in self.paths if path.suffix[1:] in ANIMATIONS), None)
        return None if form is None else (form.read_bytes(), form.suffix[1:])


def draw(spec: BaseFigure, runs: pd.DataFrame, steps: pd.DataFrame, fields: pd.DataFrame) -> plotting.Figure:
    """The declared figure of these results. Raises FigureError when there is nothing to draw."""
    return drawn(spec, Frames(runs, steps, fields))[0]


def drawn(spec: BaseFigure, frames: Frames) -> tuple[plotting.Figure, pd.DataFrame]:
    """The declared figure of these results, and what it shows. Raises FigureError when there is nothing to draw."""
    spec.on_seconds(frames.runs)
    if spec.font not in (None, *FONTS) and spec.font not in plotting.fontManager.get_font_names():
        near = get_close_matches(str(spec.font), plotting.fontManager.get_font_names())
        raise spec.refuse(f"font {spec.font!r} is not installed; there are {listing([*FONTS, *near])}")
    with plotting.rc_context(style_of(spec)):
        width = spec.wide(COLUMN)
        figure = plotting.Picture(partial(as_png, look=spec), figsize=(width, 0.72 * width), layout="constrained")
        told = spec.paint(figure, frames)
    return figure, told


def content_of(spec: BaseFigure, told: pd.DataFrame) -> str:
    """A digest of what a figure shows, as `drawn` tells it, and of its declaration without look and caption."""
    shown = spec.model_dump(mode="json", exclude={*Look.model_fields, "caption", "lanes"}, exclude_defaults=True)
    return digest_of(json.dumps([spec.kind_name(), shown, told.to_csv(index=False)]))


def write(spec: BaseFigure, frames: Frames, folder: Path, provenance: Provenance | None = None) -> Written:
    """Write the pictures of a declared figure, the data beside them, and its animation, into a folder.

    provenance : where it comes from, which the pictures say.
    Raises FigureError when there is nothing to draw.
    """
    figure, told = drawn(spec, frames)
    try:
        mark = None if provenance is None else provenance.of("figure", spec.name, content_of(spec, told))
        paths = save(figure, folder, spec.name, spec, mark)
    except (ValueError, plotting.LatexError) as error:  # what matplotlib and TeX raise
        raise spec.refuse(f"mathematics in one of its texts cannot be set: {' '.join(str(error).split())}") from error
    if spec.data is not False:
        paths.append(folder / f"{spec.name}.csv")
        told.to_csv(paths[-1], index=False)
    asked: list[str] = list(spec.formats or ())
    if isinstance(spec, PanelsFigure) and spec.animation is not None:
        asked.append(spec.animation)
        if not missing(spec.animation):
            paths.append(folder / f"{spec.name}.{spec.animation}")
            animate(spec, frames, paths[-1])
    notes = tuple(str(spec.refuse(missing(form))) for form in asked if missing(form))
    return Written(tuple(paths), notes, figure, spec)
