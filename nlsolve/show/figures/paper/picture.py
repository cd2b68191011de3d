"""A figure that a notebook shows by itself. This module loads matplotlib: `plotting.Picture` does so when needed."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from nlsolve.show.figures.paper.files import as_png
from nlsolve.show.figures.paper.look import Look


class Picture(Figure):
    """A figure and its look, by which it is drawn."""

    def __init__(self, look: Look, **keywords: Any) -> None:
        super().__init__(**keywords)
        self.look = look

    def _repr_png_(self) -> bytes:
        return as_png(self, self.look)
