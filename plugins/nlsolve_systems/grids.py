"""N × N inner points of the unit square (or N of the unit interval), spacing h = 1/(N + 1), zero on the boundary."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp


def places(count: int) -> np.ndarray:
    """x of the inner points, (N,)."""
    return np.arange(1.0, count + 1.0) / (count + 1)


def on_points(profile: np.ndarray, dimension: int) -> np.ndarray:
    """p(x), or p(x) p(y), at the inner points, (N,) or (N²,)."""
    return profile if dimension == 1 else np.outer(profile, profile).ravel()


@cache
def minus_laplacian(count: int, dimension: int) -> Any:
    """−Δ by second differences: 3 or 5 points."""
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(count, count)) * (count + 1.0) ** 2
    if dimension == 1:
        return line.tocsr()
    eye = sp.eye_array(count)
    return (sp.kron(line, eye) + sp.kron(eye, line)).tocsr()


@cache
def slopes(count: int, dimension: int) -> tuple[Any, ...]:
    """∂/∂x (and ∂/∂y) of linear elements: on the N + 1 intervals, or on both triangles of the (N + 1)² cells."""
    inner = sp.diags_array([1.0], offsets=[-1], shape=(count + 2, count))  # the boundary points are zero
    step = sp.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count + 1, count + 2)) * (count + 1.0)
    left, right = (sp.diags_array([1.0], offsets=[k], shape=(count + 1, count + 2)) for k in (0, 1))
    if dimension == 1:
        return ((step @ inner).tocsr(),)
    along = [sp.kron(side @ inner, step @ inner) for side in (left, right)]  # at the lower, the upper edge of a cell
    across = [sp.kron(step @ inner, side @ inner) for side in (left, right)]
    return sp.vstack(along).tocsr(), sp.vstack(across).tocsr()
