"""A nodal value in colours over the material."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from nlsolve.series import Array
from nlsolve.show import plotting
from nlsolve.show.figures.nodes.panels import PanelsFigure, Snapshot, layer_names, panels_of
from nlsolve.show.figures.nodes.sections import POSITIVE, NodalValue, outline, triangulate
from nlsolve.show.figures.style import DASHES, POSITIVE_MAP, SIGNED_MAP, axis_label, legend_outside

LEVELS = 20
NEGATIVE: Any = (0, (4, 3))  # dashes of the lines where a value is negative
FLOOR = 1e-12  # of the largest value: what a logarithmic field shows at least


class FieldFigure(PanelsFigure):
    """Filled contours of a nodal value: diverging colours about 0 for what has a sign, sequential ones for ε̄ and μ."""

    kind: Literal["field"] = "field"
    value: NodalValue = Field(description="column of `fields`")
    log: bool = Field(False, description="logarithmic colours; for `rate` and `viscosity`")
    limit: float | None = Field(
        None, gt=0, description="largest magnitude the colours distinguish; absent: the largest"
    )

    @property
    def columns(self) -> tuple[str, ...]:
        return ("x", "y", self.value)

    def show(self, figure: plotting.Figure, shown: Sequence[Snapshot], among: Sequence[Snapshot]) -> None:
        if self.log and self.value not in POSITIVE:
            signless = " and ".join(POSITIVE)
            raise self.refuse(f"value = {self.value!r} has a sign, so log = true cannot show it; {signless} have none")
        levels, extend = self._levels(np.concatenate([s.rows[self.value].to_numpy(float) for s in among]))
        apart, over = self.layers(shown)
        panels = panels_of(figure, self, apart, among, bar=True)
        outlines: Any = [
            {"color": "black", "linewidth": 0.5, "linestyle": DASHES[k % len(DASHES)]} for k in range(len(over))
        ]
        below = levels[:0] if over or self.log else levels[levels < 0][1 :: LEVELS // 5]
        negative = None
        contours = None
        for axes, snapshot in panels:
            triangles, values = self._shown(snapshot, levels[0])
            colours = POSITIVE_MAP if self.value in POSITIVE else SIGNED_MAP
            contours = axes.tricontourf(triangles, values, levels=levels, cmap=colours, extend=extend)
            contours.set_edgecolor("face")  # hides the seams that PDF viewers draw between bands
            contours.set_linewidth(0.2)
            axes.add_collection(plotting.LineCollection(list(outline(triangles)), colors="0.25", linewidths=0.5))
            low, high = snapshot.rows[self.value].min(), snapshot.rows[self.value].max()
            if ((low < below) & (below < high)).any():  # in grey, negative values are told by dashes
                negative = axes.tricontour(
                    triangles, values, levels=below, colors="0.2", linewidths=0.4, linestyles=[NEGATIVE]
                )
            for layer, line in zip(over, outlines, strict=True):
                every = {"colors": line["color"], "linewidths": line["linewidth"], "linestyles": line["linestyle"]}
                axes.tricontour(*self._shown(layer, levels[0]), levels=levels[:: LEVELS // 5], **every)
        assert contours is not None
        bar = figure.colorbar(contours, ax=figure.axes, fraction=0.05, pad=0.02, aspect=25)
        bar.set_label(axis_label([self.value], "fields"))
        bar.ax.tick_params(direction="out", right=True)
        bar.outline.set_linewidth(0.5)
        if negative is not None:
            bar.add_lines(negative)
            bar.lines[-1].set_linestyle(NEGATIVE)
        ticks = plotting.MaxNLocator(7, integer=self.log, steps=[1, 2, 5, 10]).tick_values(levels[0], levels[-1])
        bar.locator = plotting.FixedLocator([tick for tick in ticks if levels[0] <= tick <= levels[-1]])
        if self.log:
            bar.formatter = plotting.FuncFormatter(lambda power, _: f"$10^{{{power:.0f}}}$")
        bar.update_ticks()
        if over:
            handles = [plotting.Patch(color="0.8"), *(plotting.Line2D([], [], **line) for line in outlines)]
            legend_outside(figure, handles, [apart[0].label, *layer_names(apart[0], over)], "lower")

    def _shown(self, snapshot: Snapshot, lowest: float) -> tuple[plotting.Triangulation, Array]:
        """The triangles of a cloud, and the value at its nodes, `lowest` where there is none."""
        value = snapshot.rows[self.value].to_numpy(float)
        shown = np.where(np.isfinite(value), value, lowest)
        if self.log:
            shown = np.log10(np.maximum(shown, FLOOR * np.nanmax(value)))
        return triangulate(snapshot.rows, value), shown

    def _levels(self, values: Array) -> tuple[Array, Literal["neither", "both", "min", "max"]]:
        largest = float(np.nanmax(np.abs(values)))
        top = self.limit or largest or 1.0
        cut = largest > top * (1 + 1e-12)
        if self.log:
            positive = values[values > 0]
            if not positive.size:
                raise self.refuse(f"value = {self.value!r} is nowhere positive, so log = true shows nothing")
            low = np.floor(np.log10(max(float(positive.min()), FLOOR * largest)))
            high = max(np.ceil(np.log10(top)), low + 1)
            return np.linspace(low, high, int(high - low) * max(1, round(LEVELS / (high - low))) + 1), "neither"
        bottom = 0.0 if self.value in POSITIVE else -top
        ends: Literal["neither", "both", "max"] = "neither" if not cut else "max" if self.value in POSITIVE else "both"
        # an odd number of bands, so that one of them is centred on 0 and a field at rest is white
        return np.linspace(bottom, top, LEVELS + 2), ends
