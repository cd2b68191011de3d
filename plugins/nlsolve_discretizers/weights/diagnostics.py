"""How good the supports of a cloud and their weights are: balance, reproduction of polynomials, amplification."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve_discretizers.weights.least_squares import monomials, weight_function
from nlsolve_discretizers.weights.supports import Supports


def diagnosis(
    sources: np.ndarray, targets: np.ndarray, supports: Supports, weights: np.ndarray, degree: int
) -> dict[str, Any]:
    """Sizes of supports, and the worst balance, reproduction error and weight of the gradient's `weights` (2, T, k);
    see `nlsolve.results.columns.DIAGNOSTICS`.
    """
    scale = supports.radius[:, None, None]
    offsets = (sources[supports.index] - targets[:, None]) / scale
    member = np.arange(offsets.shape[1]) < supports.count[:, None]
    x, y = offsets[..., 0], offsets[..., 1]
    gradient = weights * supports.radius[:, None]  # of the scaled coordinates
    reproduction = 0.0
    columns = []
    for i, j in monomials(degree):
        p = x**i * y**j
        columns.append(p)
        exact = np.array([(i, j) == (1, 0), (i, j) == (0, 1)], dtype=float)[:, None]
        found = np.einsum("dtk,tk->dt", gradient, p)
        size = np.einsum("dtk,tk->dt", np.abs(gradient), np.abs(p)) + 1.0
        reproduction = max(reproduction, float((np.abs(found - exact) / size).max()))
    root = np.sqrt(np.where(member, weight_function("gaussian", np.hypot(x, y), 3.0), 0.0))
    local = root[..., None] * np.stack(columns, axis=-1)
    local /= np.maximum(np.linalg.norm(local, axis=1, keepdims=True), np.finfo(float).tiny)
    singular = np.linalg.svd(local, compute_uv=False)
    return {
        "targets": len(targets),
        "smallest_support": int(supports.count.min()),
        "largest_support": int(supports.count.max()),
        "balance": float((singular[:, -1] / singular[:, 0]).min()),
        "reproduction_error": reproduction,
        "largest_weight": float(np.abs(gradient).sum(axis=2).max()),
    }
