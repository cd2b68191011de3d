"""∫ 2/(√3 h²) dA : as many nodes as a triangular lattice of spacing h(x), h varying from place to place.

A node is placed wherever the integral along a space-filling curve has grown by one, so that every region has its share
from the start. Then nodes repel each other until they are evenly spaced (Persson & Strang 2004: bars of length 1.2 h
that only push), each sweep one array operation over all nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import scipy
from numpy.random import Generator

from nlsolve.plugin import Cloud, SolveError, Status

Function = Callable[[np.ndarray], np.ndarray]

FIRST_LEVELS = 6  # halvings of the domain's square before h decides: a feature of h wider than 1/64 of it is seen
CELL = 0.5  # largest side of a cell, in h there
NEIGHBOURS = 8
BAR = 1.2  # length at which two nodes stop pushing each other, in h: the cloud stays under slight pressure throughout
STEP = 0.25  # of the sum of the pushes
SWEEPS = 40
FROM_WALL = 0.75  # least distance of an interior node from the wall nodes, in h: 0.56 h from a wall with nodes every h


def scatter(walls: Mapping[str, np.ndarray], inside: Function, spacing: Function, seed: int) -> Cloud:
    """Nodes at distances of about h(x) inside given walls; the walls' nodes come first, group by group.

    walls : nodes (B, 2) of each boundary group, already placed at distances of about h.
    inside : mask (P,) of points (P, 2) within the walls.
    spacing : h (P,) [mm] at points (P, 2).
    """
    wall = np.concatenate(list(walls.values()))
    wall_tree = scipy.spatial.cKDTree(wall)

    def allowed(points: np.ndarray) -> np.ndarray:
        return inside(points) & (wall_tree.query(points)[0] > FROM_WALL * spacing(points))

    nodes = _placed(wall, inside, allowed, spacing, np.random.default_rng(seed))
    for _ in range(SWEEPS):
        moved = nodes + STEP * _pushes(nodes, wall, spacing)
        nodes = np.where(allowed(moved)[:, None], moved, nodes)
    ends = np.cumsum([len(group) for group in walls.values()])
    groups = {name: np.arange(end - len(walls[name]), end) for name, end in zip(walls, ends, strict=True)}
    return Cloud(np.concatenate([wall, nodes]), groups)


def jittered(cloud: Cloud, jitter: float, seed: int) -> Cloud:
    """x + jitter · d · uniform(−1, 1)² for interior nodes, d the distance to the nearest node; 0 ≤ jitter < 0.5."""
    if jitter == 0.0:
        return cloud
    inner, nodes = cloud.interior, cloud.nodes.copy()
    shifts = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(inner), 2))
    nodes[inner] += jitter * cloud.nearest_distance[inner, None] * shifts
    return replace(cloud, nodes=nodes)


def _placed(wall: np.ndarray, inside: Function, allowed: Function, spacing: Function, random: Generator) -> np.ndarray:
    """Interior nodes at equal steps of ∫ 2/(√3 h²) dA over the cells of a quadtree, in the order of its curve."""
    low, high = wall.min(axis=0), wall.max(axis=0)
    centres, sides = 0.5 * (low + high)[None], np.array([(high - low).max()])
    quarters = 0.25 * np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    level = 0
    while (split := (sides > CELL * spacing(centres)) | (level < FIRST_LEVELS)).any():
        level += 1
        parts = np.where(split, 4, 1)
        quarter = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        centres, sides, split = (np.repeat(values, parts, axis=0) for values in (centres, sides, split))
        centres = centres + np.where(split, sides, 0.0)[:, None] * quarters[quarter]
        sides = np.where(split, 0.5 * sides, sides)
    share = 2.0 / np.sqrt(3.0) * (sides / spacing(centres)) ** 2
    count = max(1, round(float(share[inside(centres)].sum()) - 0.5 * len(wall)))  # half a wall node's share is inside
    free = allowed(centres)
    if not free.any():
        raise SolveError(Status.BAD_CLOUD, "the walls leave no room for nodes between them: make the spacing smaller")
    centres, sides, grown = centres[free], sides[free], np.cumsum(share[free])
    cell = np.searchsorted(grown, (np.arange(count) + 0.5) / count * grown[-1])
    nodes = centres[cell] + sides[cell, None] * random.uniform(-0.5, 0.5, (count, 2))
    return np.where(allowed(nodes)[:, None], nodes, centres[cell])


def _pushes(nodes: np.ndarray, wall: np.ndarray, spacing: Function) -> np.ndarray:
    """Σ_j max(0, 1.2 h − |x_i − x_j|) (x_i − x_j)/|x_i − x_j| over all neighbours, the walls' too, (F, 2) [mm]."""
    everyone = np.concatenate([nodes, wall])
    distance, index = scipy.spatial.cKDTree(everyone).query(nodes, 1 + min(NEIGHBOURS, len(everyone) - 1))
    h = spacing(everyone)
    bar = BAR * 0.5 * (h[: len(nodes), None] + h[index[:, 1:]])
    away = (nodes[:, None] - everyone[index[:, 1:]]) / distance[:, 1:, None]
    return (np.maximum(0.0, bar - distance[:, 1:])[:, :, None] * away).sum(axis=1)
