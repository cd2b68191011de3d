"""Triangles between circles about one centre, with nodes at equal angles on each: Delaunay's but for a few flips."""

from __future__ import annotations

import numpy as np


def between_circles(counts: np.ndarray) -> np.ndarray:
    """Triangles (T, 3), counter-clockwise, of circles with `counts` (R,) nodes at equal angles from 0 on; nodes are
    numbered along each circle, from the innermost circle outwards.

    Each side of a circle is that of a triangle in the gap on either hand. Its third corner is where a walk around the
    gap stands on the other circle when the middle of the side is passed: it has passed the middles of so many sides
    there. Inside the first circle the triangles go to and fro, so that no node has more than two of their inner sides.
    """
    first = np.cumsum(counts) - counts
    circle = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(circle)) - first[circle]
    node, following = first[circle] + number, first[circle] + (number + 1) % counts[circle]
    triangles = [_to_and_fro(int(counts[0]))]
    for gap, sides in ((1, circle < len(counts) - 1), (-1, circle > 0)):
        here, there = counts[circle[sides]], counts[circle[sides] + gap]
        ahead = (2 * number[sides] + 1) * there - here  # middles passed there, less ½, times 2 · here
        passed = -(-ahead // (2 * here)) if gap > 0 else ahead // (2 * here) + 1  # at equal angles the inner one first
        corner = first[circle[sides] + gap] + passed % there
        start, end = node[sides], following[sides]
        triangles.append(np.stack([start, corner, end] if gap > 0 else [corner, start, end], axis=1))
    return np.concatenate(triangles)


def _to_and_fro(count: int) -> np.ndarray:
    """Triangles (count − 2, 3) of a convex polygon with nodes 0, 1, … counter-clockwise: 0, 1, −1, 2, −2, …"""
    order = np.empty(count, dtype=int)
    order[0::2] = np.arange((count + 1) // 2)
    order[1::2] = count - 1 - np.arange(count // 2)
    corners = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
    corners[0::2] = corners[0::2][:, [0, 2, 1]]
    return corners
