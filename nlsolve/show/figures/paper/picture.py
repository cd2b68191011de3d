"""A figure that a notebook shows by itself. This module loads matplotlib: `plotting.Picture` does so when needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure


class Picture(Figure):
    """A figure, and what makes a PNG of it."""

    def __init__(self, png: Callable[[Figure], bytes], **keywords: Any) -> None:
        super().__init__(**keywords)
        self._png = png

    def _repr_png_(self) -> bytes:
        return self._png(self)
