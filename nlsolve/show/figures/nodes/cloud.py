"""Nodes, or the markers of the material, at one time, coloured by the half of the disc they started in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
import scipy
from pydantic import Field

from nlsolve.results.states.triangles import boundaries
from nlsolve.series import Array
from nlsolve.show import plotting
from nlsolve.show.figures.nodes.panels import PanelsFigure, Snapshot, layer_names, panels_of
from nlsolve.show.figures.style import ACCENT, COLOURS, legend_outside

HALVES = (("$y_0 > 0$", COLOURS[0]), (r"$y_0 \leq 0$", COLOURS[4]))
OVER: Any = {"linestyle": "none", "marker": "o", "fillstyle": "none", "color": "black", "markeredgewidth": 0.3}
RING: Any = {"markerfacecolor": "none", "markeredgecolor": ACCENT, "markeredgewidth": 1.2}


class CloudFigure(PanelsFigure):
    """The nodes at a time, coloured by the half-disc (sign of y at t = 0) they started in: material mixing.

    Where a case has markers they are drawn in place of its nodes, less those that have left the cloud.
    """

    kind: Literal["cloud"] = "cloud"
    probe: tuple[float, float] | None = Field(None, description="place at t = 0 whose nearest node is marked [mm]")

    @property
    def columns(self) -> tuple[str, ...]:
        return ("x", "y", "x0", "y0")

    def drawn(self, rows: pd.DataFrame) -> pd.DataFrame:
        return _material(rows)

    def show(self, figure: plotting.Figure, shown: Sequence[Snapshot], among: Sequence[Snapshot]) -> None:
        apart, over = self.layers(shown)
        for axes, snapshot in panels_of(figure, self, apart, among, bar=False):
            self._nodes(axes, snapshot.rows)
            for layer in over:
                places = _material(layer.rows)[["x", "y"]].to_numpy(float)
                axes.plot(*places.T, markersize=2.0 * _marker_size(axes, places), **OVER)
        dot: Any = {"linestyle": "none", "marker": "o"}
        handles = [
            plotting.Line2D([], [], color=colour, markeredgewidth=0, label=label, **dot) for label, colour in HALVES
        ]
        handles.append(plotting.Line2D([], [], color="white", markeredgecolor="black", label="boundary", **dot))
        handles += [plotting.Line2D([], [], label=name, **OVER) for name in layer_names(apart[0], over)]
        if self.probe is not None:
            handles.append(plotting.Line2D([], [], markersize=6, label="probe", **dot, **RING))
        off_the_title = "lower" if figure.get_suptitle() else "upper"
        legend_outside(figure, handles, [str(handle.get_label()) for handle in handles], off_the_title)

    def _nodes(self, axes: plotting.Axes, rows: pd.DataFrame) -> None:
        nodes, rows = rows[["x", "y"]].to_numpy(float), _material(rows)
        places, start = rows[["x", "y"]].to_numpy(float), rows[["x0", "y0"]].to_numpy(float)
        wall, upper = boundaries(rows) != "", start[:, 1] > 0
        size = _marker_size(axes, nodes)
        edge: Any = {"markersize": 1.2 * size, "markeredgecolor": "black", "markeredgewidth": min(0.5, 0.25 * size)}
        for half, (_, colour) in zip((upper, ~upper), HALVES, strict=True):
            axes.plot(*places[half & ~wall].T, "o", color=colour, markersize=size, markeredgewidth=0)
            axes.plot(*places[half & wall].T, "o", color=colour, clip_on=self.window is not None, **edge)
        if self.probe is not None:
            marked = int(np.hypot(*(start - self.probe).T).argmin())
            axes.plot(*places[marked], "o", markersize=max(2.5 * size, 5), **RING)


def _material(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with the places x, y of their markers where there are any."""
    marked = rows.reindex(columns=["marker_x", "marker_y"]).notna().all(axis=1)
    if not marked.any():
        return rows
    return rows[marked].assign(x=rows["marker_x"], y=rows["marker_y"])


def _marker_size(axes: plotting.Axes, places: Array) -> float:
    """Diameter in points: half the typical distance between neighbours as it will be printed."""
    spacing = float(np.median(scipy.spatial.cKDTree(places).query(places, 2)[0][:, 1]))
    left, right = axes.get_xlim()
    figure = axes.get_figure()
    assert isinstance(figure, plotting.Figure)
    columns = axes.get_gridspec().ncols  # type: ignore[union-attr]
    printed = 0.8 * figure.get_figwidth() / columns * 72 / (right - left) * spacing
    return float(np.clip(0.55 * printed, 0.5, 4))
