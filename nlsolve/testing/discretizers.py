"""B, S, B_θ, S_θ : the check of discretizers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud, Indices, node_major
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators
from nlsolve.series import Array
from nlsolve.testing.promises import require, same, shaped


def check_discretizer(discretizer: Discretizer, cloud: Cloud, tolerance: float = 1e-10) -> None:
    """Check the shapes of the operators, and what they reproduce to `tolerance` of the sizes summed.

    Rigid motions have no strain, linear velocities a constant strain rate; constant stress and constant pressure exert
    no force; values and gradients of linear fields are exact. In a strong form the divergence of a linear stress is
    exact; a conservative form is adjoint, S = −Bᵀ A and S_θ = −B_θᵀ A_θ. Raises AssertionError.
    """
    n, free, extent = len(cloud.nodes), cloud.interior, float(np.ptp(cloud.nodes, axis=0).max())
    plain, full = discretizer.operators(cloud, False), discretizer.operators(cloud, True)
    require(plain.volumetric is None, "volumetric operators nobody asked for")
    require(full.volumetric is not None, "no volumetric operators")
    assert full.volumetric is not None
    strain, volumetric = full.strain, full.volumetric
    m, count, f = len(strain.points), len(volumetric.points), len(free)
    for name, pair, components in (
        ("strain", plain.strain, 3),
        ("strain, with a volumetric term,", strain, 3),
        ("volumetric", volumetric, 1),
    ):
        rows = components * len(pair.points)
        shaped(pair.points, (len(pair.points), 2), f"{name} points")
        shaped(pair.rate, (rows, 2 * n), f"{name} rate")
        shaped(pair.force, (2 * f, rows), f"{name} force")
        if full.is_conservative:
            shaped(pair.areas, (len(pair.points),), f"{name} areas")
    same(len(plain.strain.points), m, 1.0, "strain points with and without a volumetric term", 0.0)
    for operators in (plain, full):
        if full.is_conservative:
            shaped(operators.node_areas, (f,), "node_areas")

    def holds(what: str, matrix: Any, field: Array, expected: Any) -> None:
        size = float(abs(matrix).sum(axis=1).max() * np.abs(field).max())
        same(matrix @ field.ravel(), expected, size, what, tolerance)

    x, points = cloud.nodes - cloud.nodes.mean(axis=0), strain.points - cloud.nodes.mean(axis=0)
    for name, gradient in {
        "translation": np.zeros((2, 2)),
        "rotation": np.array([[0.0, -1.0], [1.0, 0.0]]),
        "linear velocity": np.array([[0.7, -0.3], [1.1, 0.4]]),
    }.items():
        velocity = x @ gradient.T + [1.0, -2.0]
        rate = [gradient[0, 0], gradient[1, 1], 0.5 * (gradient[0, 1] + gradient[1, 0])]
        holds(f"strain rate of a {name}", strain.rate, velocity, np.repeat(rate, m))
        holds(f"dilatation of a {name}", volumetric.rate, velocity, np.trace(gradient))
    holds("force of a constant stress", strain.force, np.repeat([1.0, -2.0, 0.5], m), 0.0)
    holds("force of a constant pressure", volumetric.force, np.ones(count), 0.0)
    if full.is_conservative:
        _check_adjoint(full, node_major(free))
    else:
        slopes = np.array([[0.3, -1.0], [0.8, 0.2], [-0.6, 0.9]])  # of xx, yy, xy along x and y
        divergence = np.tile([slopes[0, 0] + slopes[2, 1], slopes[2, 0] + slopes[1, 1]], f)
        holds("force of a linear stress", strain.force, slopes @ points.T, divergence)
    for axis, derivative in zip("xy", discretizer.gradient(cloud), strict=True):
        shaped(derivative, (n, n), f"∂/∂{axis}")
        holds(f"∂/∂{axis} of a linear field", derivative, x @ [2.0, -3.0], {"x": 2.0, "y": -3.0}[axis])
    values = discretizer.values(strain.points, cloud.nodes[free])
    shaped(values, (f, m), "values")
    holds("values of a linear field", values, extent + points @ [2.0, -3.0], extent + x[free] @ [2.0, -3.0])


def _check_adjoint(operators: Operators, free: Indices) -> None:
    """S + Bᵀ A = 0 and S_θ + B_θᵀ A_θ = 0 on the unknowns; areas are ≥ 0, and > 0 at interior nodes."""
    assert operators.volumetric is not None
    assert operators.node_areas is not None
    for name, pair in (("S = −Bᵀ A", operators.strain), ("S_θ = −B_θᵀ A_θ", operators.volumetric)):
        assert pair.areas is not None
        expected = -(pair.rate[:, free].T @ sp.diags_array(pair.weights()))
        same(abs(pair.force - expected).max(), 0.0, float(abs(expected).max()), name, 1e-13)
        require(np.min(pair.areas) >= 0.0, f"{name}: an area is negative")
    require(np.min(operators.node_areas, initial=1.0) > 0.0, "the material around an interior node has no area")
