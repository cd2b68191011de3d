"""What figures use of matplotlib, which is loaded when the first is drawn: a study is read and resumed without it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib import colormaps, rc_context, rcParams
    from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_pgf import LatexError
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.font_manager import fontManager
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Polygon, Rectangle
    from matplotlib.text import Text
    from matplotlib.ticker import (
        FixedLocator,
        Formatter,
        FuncFormatter,
        LogFormatter,
        LogLocator,
        MaxNLocator,
        NullLocator,
    )
    from matplotlib.tri import Triangulation

    from nlsolve.show.figures.paper.picture import Picture

_HOME = {
    "colormaps": "matplotlib",
    "rc_context": "matplotlib",
    "rcParams": "matplotlib",
    "AbstractMovieWriter": "matplotlib.animation",
    "FFMpegWriter": "matplotlib.animation",
    "PillowWriter": "matplotlib.animation",
    "LatexError": "matplotlib.backends.backend_pgf",
    "Axes": "matplotlib.axes",
    "ScalarMappable": "matplotlib.cm",
    "LineCollection": "matplotlib.collections",
    "LogNorm": "matplotlib.colors",
    "Figure": "matplotlib.figure",
    "fontManager": "matplotlib.font_manager",
    "Line2D": "matplotlib.lines",
    "Patch": "matplotlib.patches",
    "Polygon": "matplotlib.patches",
    "Rectangle": "matplotlib.patches",
    "Text": "matplotlib.text",
    "FixedLocator": "matplotlib.ticker",
    "Formatter": "matplotlib.ticker",
    "FuncFormatter": "matplotlib.ticker",
    "LogFormatter": "matplotlib.ticker",
    "LogLocator": "matplotlib.ticker",
    "MaxNLocator": "matplotlib.ticker",
    "NullLocator": "matplotlib.ticker",
    "Triangulation": "matplotlib.tri",
    "Picture": "nlsolve.show.figures.paper.picture",
}

__all__ = [
    "AbstractMovieWriter",
    "Axes",
    "FFMpegWriter",
    "Figure",
    "FixedLocator",
    "Formatter",
    "FuncFormatter",
    "LatexError",
    "Line2D",
    "LineCollection",
    "LogFormatter",
    "LogLocator",
    "LogNorm",
    "MaxNLocator",
    "NullLocator",
    "Patch",
    "Picture",
    "PillowWriter",
    "Polygon",
    "Rectangle",
    "ScalarMappable",
    "Text",
    "Triangulation",
    "colormaps",
    "fontManager",
    "rcParams",
    "rc_context",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value
