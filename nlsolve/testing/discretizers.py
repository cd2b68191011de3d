"""B, S, B_θ, S_θ : the check of discretizers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators
from nlsolve.contracts.continuum.law import CONTRACTION
from nlsolve.flow.momentum import node_major
from nlsolve.series import Array
from nlsolve.testing.promises import require, same, shaped


def check_discretizer(discretizer: Discretizer, cloud: Cloud, tolerance: float = 1e-10) -> None:
    """Shapes, and what a consistent scheme reproduces, to `tolerance` of the sizes summed: no strain of rigid motions,
    constant strain rate of linear velocities, no force of constant stress or pressure, values and gradients of linear
    fields. Besides, of a strong form the divergence of linear stress; of a conservative one that it is adjoint.
    """
    n, free, extent = len(cloud.nodes), cloud.interior, float(np.ptp(cloud.nodes, axis=0).max())
    plain, full = discretizer.operators(cloud, False), discretizer.operators(cloud, True)
    require(plain.dilatation is None and plain.pressure_force is None, "volumetric operators nobody asked for")
    require(full.dilatation is not None and full.volume_points is not None, "no volumetric operators")
    assert full.volume_points is not None
    m, count, f = len(full.strain_points), len(full.volume_points), len(free)
    shapes: dict[str, tuple[int, ...]] = {"strain": (3 * m, 2 * n), "force": (2 * f, 3 * m), "strain_points": (m, 2)}
    volumetric: dict[str, tuple[int, ...]] = {
        "dilatation": (count, 2 * n),
        "pressure_force": (2 * f, count),
        "volume_points": (count, 2),
    }
    conservative = full.node_areas is not None
    if conservative:
        shapes |= {"node_areas": (f,), "strain_areas": (m,)}
        volumetric |= {"volume_areas": (count,)}
    for operators, expected in ((plain, shapes), (full, shapes | volumetric)):
        for name, shape in expected.items():
            shaped(getattr(operators, name), shape, name)

    def holds(what: str, matrix: Any, field: Array, expected: Any) -> None:
        size = float(abs(matrix).sum(axis=1).max() * np.abs(field).max())
        same(matrix @ field.ravel(), expected, size, what, tolerance)

    x, points = cloud.nodes - cloud.nodes.mean(axis=0), full.strain_points - cloud.nodes.mean(axis=0)
    for name, gradient in {
        "translation": np.zeros((2, 2)),
        "rotation": np.array([[0.0, -1.0], [1.0, 0.0]]),
        "linear velocity": np.array([[0.7, -0.3], [1.1, 0.4]]),
    }.items():
        velocity = x @ gradient.T + [1.0, -2.0]
        rate = [gradient[0, 0], gradient[1, 1], 0.5 * (gradient[0, 1] + gradient[1, 0])]
        holds(f"strain rate of a {name}", full.strain, velocity, np.repeat(rate, m))
        holds(f"dilatation of a {name}", full.dilatation, velocity, np.trace(gradient))
    holds("force of a constant stress", full.force, np.repeat([1.0, -2.0, 0.5], m), 0.0)
    holds("force of a constant pressure", full.pressure_force, np.ones(count), 0.0)
    if conservative:
        _check_adjoint(full, node_major(free))
    else:
        slopes = np.array([[0.3, -1.0], [0.8, 0.2], [-0.6, 0.9]])  # of xx, yy, xy along x and y
        divergence = np.tile([slopes[0, 0] + slopes[2, 1], slopes[2, 0] + slopes[1, 1]], f)
        holds("force of a linear stress", full.force, slopes @ points.T, divergence)
    for axis, derivative in zip("xy", discretizer.gradient(cloud), strict=True):
        shaped(derivative, (n, n), f"∂/∂{axis}")
        holds(f"∂/∂{axis} of a linear field", derivative, x @ [2.0, -3.0], {"x": 2.0, "y": -3.0}[axis])
    values = discretizer.values(full.strain_points, cloud.nodes[free])
    shaped(values, (f, m), "values")
    holds("values of a linear field", values, extent + points @ [2.0, -3.0], extent + x[free] @ [2.0, -3.0])


def _check_adjoint(operators: Operators, free: Array) -> None:
    """S + Bᵀ A = 0 and S_θ + B_θᵀ A_θ = 0 on the unknowns; no area is negative, and nodes have some."""
    assert operators.strain_areas is not None
    assert operators.volume_areas is not None
    assert operators.node_areas is not None
    weighed = np.outer(CONTRACTION, operators.strain_areas).ravel()
    for name, force, rate, areas in (
        ("S = −Bᵀ A", operators.force, operators.strain, weighed),
        ("S_θ = −B_θᵀ A_θ", operators.pressure_force, operators.dilatation, operators.volume_areas),
    ):
        expected = -(rate[:, free].T @ sp.diags_array(areas))
        same(abs(force - expected).max(), 0.0, float(abs(expected).max()), name, 1e-13)
        require(np.min(areas) >= 0.0, f"{name}: an area is negative")
    require(np.min(operators.node_areas, initial=1.0) > 0.0, "the material around an interior node has no area")
