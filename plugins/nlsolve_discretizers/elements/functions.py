"""v = Σ_i φ_i v_i on a triangle with six nodes: quadratics of its coordinates L.

    φ_i = L_i (2 L_i − 1) at the corners,   φ_ij = 4 L_i L_j in the middles of the edges ij

The nodes are the corners 1, 2, 3 and the middles of the edges 12, 23, 31. Each φ is 1 at its own node and 0 at the
others (Zienkiewicz & Taylor 2000).
"""

from __future__ import annotations

import numpy as np

EDGES = ((0, 1), (1, 2), (2, 0))
"""The corners at the ends of each edge."""

NODES = np.concatenate([np.eye(3), [0.5 * (np.eye(3)[i] + np.eye(3)[j]) for i, j in EDGES]])
"""L at the six nodes, (6, 3)."""

POINTS = np.array([np.roll([2.0, 0.5, 0.5], k) for k in range(3)]) / 3.0
"""Three points (3, 3) of equal weights, whose rule is exact for quadratics."""


def values(at: np.ndarray) -> np.ndarray:
    """φ at the points L (P, 3), (P, 6)."""
    return np.column_stack([at * (2.0 * at - 1.0), *(4.0 * at[:, i] * at[:, j] for i, j in EDGES)])


def slopes(at: np.ndarray) -> np.ndarray:
    """∂φ/∂(L_2, L_3) at the points L (P, 3), with L_1 = 1 − L_2 − L_3: (P, 6, 2)."""
    unit = np.eye(3)
    corners = [unit[k] * (4.0 * at[:, [k]] - 1.0) for k in range(3)]  # ∂/∂(L_1, L_2, L_3)
    edges = [4.0 * (unit[j] * at[:, [i]] + unit[i] * at[:, [j]]) for i, j in EDGES]
    each = np.stack([*corners, *edges], axis=1)
    return each[..., 1:] - each[..., :1]
