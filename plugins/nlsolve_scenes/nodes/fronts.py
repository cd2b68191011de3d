"""Nodes of an annulus by a spacing h(x, y): fronts around the tool, one h from the next, then scattered nodes.

    r_{j+1}(θ) = r_j(θ) + h(r_j(θ), θ),   r_0 = r_t

In the layer at the tool the velocity changes across the fronts, and linear interpolation from front to front is better
than between nodes in no order: with as many nodes the steady orbit is two to four times as accurate there.
"""

from __future__ import annotations

import numpy as np

from nlsolve.plugin import Cloud, Spacing
from nlsolve_scenes.nodes.scatter import scatter

FRONTS = 20  # around the tool
WIDEST = 0.45  # part of the gap that the fronts may fill
ANGLES = np.linspace(0.0, 2.0 * np.pi, 8001)  # at which a front is known
FEWEST = 12  # nodes on a front


def annulus(inner: float, outer: float, spacing: Spacing, seed: int) -> Cloud:
    """Nodes at distances of about h(x) between circles about the origin; boundary groups "tool" and "plate"."""
    radius = np.full_like(ANGLES, inner)
    fronts = [_nodes_on(radius, spacing)]
    while len(fronts) <= FRONTS:
        ahead = radius + spacing(_places(radius))
        if ahead.max() - inner > WIDEST * (outer - inner):
            break
        radius = ahead
        fronts.append(_nodes_on(radius, spacing))
    last, plate = fronts[-1], _nodes_on(np.full_like(ANGLES, outer), spacing)

    def inside(points: np.ndarray) -> np.ndarray:
        angle = np.mod(np.arctan2(points[:, 1], points[:, 0]), 2.0 * np.pi)
        distance = np.hypot(points[:, 0], points[:, 1])
        return (distance > np.interp(angle, ANGLES, radius)) & (distance < outer)

    filled = scatter({"front": last, "plate": plate}, inside, spacing, seed)
    nodes = np.concatenate([*fronts[:-1], filled.nodes])
    before = len(nodes) - len(filled.nodes)
    tool = filled.boundaries["front"] + before if len(fronts) == 1 else np.arange(len(fronts[0]))
    return Cloud(nodes, {"tool": tool, "plate": filled.boundaries["plate"] + before})


def _places(radius: np.ndarray) -> np.ndarray:
    return radius[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)


def _nodes_on(radius: np.ndarray, spacing: Spacing) -> np.ndarray:
    """Nodes at equal steps of ∫ ds/h along the closed curve r(θ), (B, 2)."""
    curve = _places(radius)
    slowness = 1.0 / spacing(curve)
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (slowness[1:] + slowness[:-1]) * length)])
    count = max(FEWEST, round(steps[-1]))
    angle = np.interp(np.arange(count) / count * steps[-1], steps, ANGLES)
    return np.interp(angle, ANGLES, radius)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
