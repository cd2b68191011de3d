"""Rectangles of material and the nodes in them: on grid lines or scattered, closer to each other near the walls."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import Cloud, ConstitutiveLaw, FlowScene, Spacing
from nlsolve_scenes.nodes.grading import lines, relative_spacing
from nlsolve_scenes.nodes.scatter import jittered, scatter

FIRST_ON_DIAGONAL = 0.75  # distance in x and in y of the first interior node from a corner, in spacings of the walls


class Rectangle(FlowScene):
    """A flow in x₀ ≤ x ≤ x₀ + width, y₀ ≤ y ≤ y₀ + height, on fixed nodes."""

    spacing: float = Field(0.05, gt=0, description="mean distance of nodes [mm]")
    grading: float = Field(
        1.0,
        gt=0,
        le=1,
        description="distance of nodes at the walls over that in the middle; on a grid 0.6 or more",
    )
    nodes: Literal["grid", "scattered"] = Field("grid", description="on grid lines, or scattered by repulsion")
    jitter: float = Field(
        0.0, ge=0, lt=0.5, description="random shift of interior nodes, as a fraction of the distance to the nearest"
    )
    seed: int = Field(0, ge=0, description="seed of scattered nodes and of the random shifts")

    keeps_nodes: ClassVar[str | None] = "boundary nodes would leave the rectangle"

    @property
    @abstractmethod
    def corners(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(x₀, y₀) and (x₀ + width, y₀ + height) [mm]."""

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        """Nodes with the boundary groups "bottom" and "top" (with the corners), "left" and "right" (without)."""
        filled = self._grid if self.nodes == "grid" else self._scattered
        return jittered(filled(), self.jitter, self.seed)

    def boundary_position(self, cloud: Cloud, time: float) -> np.ndarray:
        """The walls stay where they are, at any time."""
        return cloud.nodes[cloud.boundary]

    def _grid(self) -> Cloud:
        low, high = np.array(self.corners)
        x, y = (
            start + side * lines(max(2, round(side / self.spacing)), self.grading)
            for start, side in zip(low, high - low, strict=True)
        )
        return grid(x, y)

    def _scattered(self) -> Cloud:
        low, high = np.array(self.corners)
        at_wall = self.spacing * float(relative_spacing(np.zeros(1), self.grading)[0])
        x, y = (
            np.linspace(start, end, max(2, round((end - start) / at_wall)) + 1)
            for start, end in zip(low, high, strict=True)
        )
        frame = grid(x, y)
        walls = {name: frame.nodes[group] for name, group in frame.boundaries.items()}
        # A triangle of three wall nodes in a corner would have a dilatation that no unknown can change.
        first = FIRST_ON_DIAGONAL * np.array([[x[1] - x[0], y[1] - y[0]]])
        held = np.concatenate([np.where(side, low + first, high - first) for side in np.ndindex(2, 2)])

        def inside(points: np.ndarray) -> np.ndarray:
            return ((points > low) & (points < high)).all(axis=1)

        def spacing(points: np.ndarray) -> np.ndarray:
            depth = np.minimum(points - low, high - points) / (high - low)
            return self.spacing * relative_spacing(np.maximum(depth.min(axis=1), 0.0), self.grading)

        cloud = scatter(walls | {"held": held}, inside, spacing, self.seed)
        return replace(cloud, boundaries={name: cloud.boundaries[name] for name in walls})


def grid(x: np.ndarray, y: np.ndarray) -> Cloud:
    """Nodes at the crossings of the lines x (C,) and y (R,), row by row from the bottom."""
    nodes = np.stack([coordinate.ravel() for coordinate in np.meshgrid(x, y)], axis=1)
    number = np.arange(len(nodes)).reshape(len(y), len(x))
    return Cloud(nodes, {"bottom": number[0], "top": number[-1], "left": number[1:-1, 0], "right": number[1:-1, -1]})


def sides(low: tuple[float, float], high: tuple[float, float], spacing: Spacing) -> dict[str, np.ndarray]:
    """Nodes at equal steps of ∫ ds/h on the sides of the rectangle between two corners: "bottom" and "top" with the
    corners, "left" and "right" without.
    """
    (x, y), (x_end, y_end) = low, high
    return {
        "bottom": _between((x, y), (x_end, y), spacing),
        "top": _between((x, y_end), (x_end, y_end), spacing),
        "left": _between((x, y), (x, y_end), spacing)[1:-1],
        "right": _between((x_end, y), (x_end, y_end), spacing)[1:-1],
    }


def _between(start: tuple[float, float], end: tuple[float, float], spacing: Spacing) -> np.ndarray:
    """Nodes from one point to another, both among them."""
    part = np.linspace(0.0, 1.0, 2001)[:, None]
    line = (1.0 - part) * np.array(start) + part * np.array(end)
    slowness = 1.0 / spacing(line)
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (slowness[1:] + slowness[:-1]))])
    steps *= float(np.hypot(*np.subtract(end, start))) / (len(line) - 1)
    count = max(2, round(steps[-1]))
    at = np.interp(np.arange(count + 1) / count * steps[-1], steps, part[:, 0])[:, None]
    return (1.0 - at) * np.array(start) + at * np.array(end)
