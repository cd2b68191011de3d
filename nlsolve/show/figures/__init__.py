"""Figures a study declares, for print: curves, maps, trades, crossovers and solved problems of runs, curves of steps,
clouds, profiles and fields.

`draw` makes a `matplotlib.figure.Figure` of a declared figure and the result frames, without pyplot; `save` writes it
as PNG and PDF, the same bytes every time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
from pydantic import Field

from nlsolve.results.frames import Frames
from nlsolve.show import plotting
from nlsolve.show.figures.base import BaseFigure, FigureError
from nlsolve.show.figures.crossover import CrossoverFigure
from nlsolve.show.figures.line import LineFigure
from nlsolve.show.figures.map import MapFigure
from nlsolve.show.figures.nodes.cloud import CloudFigure
from nlsolve.show.figures.nodes.field import FieldFigure
from nlsolve.show.figures.nodes.profile import ProfileFigure
from nlsolve.show.figures.solved import DataFigure, PerformanceFigure
from nlsolve.show.figures.style import COLUMN, DOTS_PER_INCH, STYLE
from nlsolve.show.figures.trade import TradeFigure

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
    "MapFigure",
    "PerformanceFigure",
    "ProfileFigure",
    "TradeFigure",
    "draw",
    "save",
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


def draw(spec: BaseFigure, runs: pd.DataFrame, steps: pd.DataFrame, fields: pd.DataFrame) -> plotting.Figure:
    """The declared figure of these results. Raises FigureError when there is nothing to draw."""
    spec.on_seconds(runs)
    with plotting.rc_context(STYLE):
        figure = plotting.Figure(figsize=(COLUMN, 0.72 * COLUMN), layout="constrained")
        spec.paint(figure, Frames(runs, steps, fields))
    return figure


def save(figure: plotting.Figure, folder: Path, name: str) -> list[Path]:
    """Write `name`.png and `name`.pdf into the folder, without dates, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.pdf"]
    with plotting.rc_context(STYLE):
        figure.savefig(paths[0], dpi=DOTS_PER_INCH)
        figure.savefig(paths[1], metadata={"CreationDate": None})
    return paths
