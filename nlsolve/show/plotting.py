"""What figures use of matplotlib, which is loaded when the first is drawn: a study is read and resumed without it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib import colormaps, rc_context
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Polygon, Rectangle
    from matplotlib.ticker import (
        FixedLocator,
        FuncFormatter,
        LogFormatter,
        LogLocator,
        MaxNLocator,
        NullLocator,
    )
    from matplotlib.tri import Triangulation

_HOME = {
    "colormaps": "matplotlib",
    "rc_context": "matplotlib",
    "Axes": "matplotlib.axes",
    "ScalarMappable": "matplotlib.cm",
    "LineCollection": "matplotlib.collections",
    "LogNorm": "matplotlib.colors",
    "Figure": "matplotlib.figure",
    "Line2D": "matplotlib.lines",
    "Patch": "matplotlib.patches",
    "Polygon": "matplotlib.patches",
    "Rectangle": "matplotlib.patches",
    "FixedLocator": "matplotlib.ticker",
    "FuncFormatter": "matplotlib.ticker",
    "LogFormatter": "matplotlib.ticker",
    "LogLocator": "matplotlib.ticker",
    "MaxNLocator": "matplotlib.ticker",
    "NullLocator": "matplotlib.ticker",
    "Triangulation": "matplotlib.tri",
}

__all__ = [
    "Axes",
    "Figure",
    "FixedLocator",
    "FuncFormatter",
    "Line2D",
    "LineCollection",
    "LogFormatter",
    "LogLocator",
    "LogNorm",
    "MaxNLocator",
    "NullLocator",
    "Patch",
    "Polygon",
    "Rectangle",
    "ScalarMappable",
    "Triangulation",
    "colormaps",
    "rc_context",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value
