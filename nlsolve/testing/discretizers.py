"""B, S, B_θ, S_θ : the check of discretizers."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.continuum.cloud import Cloud, node_major
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators
from nlsolve.contracts.status import SolveError
from nlsolve.flow.claims.shapes import check_operators
from nlsolve.series import Array, Indices
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import require, same, shaped


def check_discretizer(discretizer: Discretizer, cloud: Cloud, tolerance: float = 1e-10) -> None:
    """Check the shapes of the operators, and what they reproduce to `tolerance` of the sizes summed.

    Rigid motions have no strain, linear velocities a constant strain rate; constant stress and constant pressure exert
    no force; values and gradients of linear fields are exact. In a strong form the divergence of a linear stress is
    exact; a conservative form is adjoint, S = −Bᵀ A and S_θ = −B_θᵀ A_θ. Raises AssertionError.
    """
    scene_nodes = cloud.nodes
    with promise("completed", "the nodes of the scene come first, and stay what they are"):
        cloud = discretizer.completed(cloud)
        require(np.array_equal(cloud.nodes[: len(scene_nodes)], scene_nodes), "`completed` changes nodes of the scene")
    n, free, extent = len(cloud.nodes), cloud.interior, float(np.ptp(cloud.nodes, axis=0).max())
    with promise("operators", "B and S are given, and B_θ and S_θ if and only if they are asked for"):
        plain, full = discretizer.operators(cloud, False), discretizer.operators(cloud, True)
        require(plain.volumetric is None, "volumetric operators nobody asked for")
        require(full.volumetric is not None, "no volumetric operators")
    with promise("shapes", "operators, points and areas have the shapes of the contract, and real numbers"):
        try:
            for operators in (plain, full):
                check_operators(discretizer, operators, cloud)
        except TypeError as error:
            raise AssertionError(str(error)) from error
        assert full.volumetric is not None
        strain, volumetric = full.strain, full.volumetric
        m, count, f = len(strain.points), len(volumetric.points), len(free)
        for name, pair in (("strain", strain), ("volumetric", volumetric)):
            if full.is_conservative:
                shaped(pair.areas, (len(pair.points),), f"{name} areas")
        same(len(plain.strain.points), m, 1.0, "strain points with and without a volumetric term", 0.0)
        for operators in (plain, full):
            if full.is_conservative:
                shaped(operators.node_areas, (f,), "node_areas")

    def holds(what: str, matrix: Any, field: Array, expected: Any) -> None:
        size = float(abs(matrix).sum(axis=1).max() * np.abs(field).max())
        same(matrix @ field.ravel(), expected, size, what, tolerance)

    x = cloud.nodes - cloud.nodes.mean(axis=0)
    with promise("rates", "rigid motions have no strain rate, linear velocities a constant one"):
        points = strain.points - cloud.nodes.mean(axis=0)
        for name, gradient in {
            "translation": np.zeros((2, 2)),
            "rotation": np.array([[0.0, -1.0], [1.0, 0.0]]),
            "linear velocity": np.array([[0.7, -0.3], [1.1, 0.4]]),
        }.items():
            velocity = x @ gradient.T + [1.0, -2.0]
            rate = [gradient[0, 0], gradient[1, 1], 0.5 * (gradient[0, 1] + gradient[1, 0])]
            holds(f"strain rate of a {name}", strain.rate, velocity, np.repeat(rate, m))
            holds(f"dilatation of a {name}", volumetric.rate, velocity, np.trace(gradient))
    with promise("forces", "constant stresses and pressures exert no force; in a strong form linear ones a constant"):
        holds("force of a constant stress", strain.force, np.repeat([1.0, -2.0, 0.5], m), 0.0)
        holds("force of a constant pressure", volumetric.force, np.ones(count), 0.0)
        if not full.is_conservative:
            slopes = np.array([[0.3, -1.0], [0.8, 0.2], [-0.6, 0.9]])  # of xx, yy, xy along x and y
            divergence = np.tile([slopes[0, 0] + slopes[2, 1], slopes[2, 0] + slopes[1, 1]], f)
            holds("force of a linear stress", strain.force, slopes @ points.T, divergence)
    with promise("adjoint", "a conservative form is S = −Bᵀ A, with areas ≥ 0"):
        if full.is_conservative:
            _check_adjoint(full, node_major(free))
    with promise("gradients", "∂/∂x and ∂/∂y of linear fields at the nodes are exact"):
        for axis, derivative in zip("xy", discretizer.gradient(cloud), strict=True):
            shaped(derivative, (n, n), f"∂/∂{axis}")
            holds(f"∂/∂{axis} of a linear field", derivative, x @ [2.0, -3.0], {"x": 2.0, "y": -3.0}[axis])
    with promise("values", "values of linear fields between the nodes are exact"):
        values = discretizer.values(strain.points, cloud.nodes[free])
        shaped(values, (f, m), "values")
        holds("values of a linear field", values, extent + points @ [2.0, -3.0], extent + x[free] @ [2.0, -3.0])
    with promise("determinism", "the same cloud gives the same operators"):
        off = abs(discretizer.operators(cloud, False).strain.rate - plain.strain.rate).max()
        require(off == 0.0, f"B of the same cloud is another when it is asked for again, by {off:.1e}")
    with promise("too few nodes", "a cloud too poor to discretise, nodes on one line, ends in SolveError"):
        _check_poor(discretizer)


def _check_poor(discretizer: Discretizer) -> None:
    line = np.stack([np.arange(4.0), np.zeros(4)], axis=1)
    try:
        discretizer.operators(discretizer.completed(Cloud(line, {"ends": np.array([0, 3])})), False)
    except SolveError:
        return
    except Exception as error:  # a stranger's discretizer may raise anything
        raise AssertionError(
            f"four nodes on a line raised {type(error).__name__}: {error}: raise SolveError(Status.BAD_CLOUD, place)"
        ) from error
    raise AssertionError("four nodes on a line were discretised without a word: raise SolveError(Status.BAD_CLOUD)")


def _check_adjoint(operators: Operators, free: Indices) -> None:
    """S + Bᵀ A = 0 and S_θ + B_θᵀ A_θ = 0 on the unknowns; areas are ≥ 0."""
    assert operators.volumetric is not None
    assert operators.node_areas is not None
    for name, pair in (("S = −Bᵀ A", operators.strain), ("S_θ = −B_θᵀ A_θ", operators.volumetric)):
        assert pair.areas is not None
        expected = -(pair.rate[:, free].T @ sp.diags_array(pair.weights()))
        same(abs(pair.force - expected).max(), 0.0, float(abs(expected).max()), name, 1e-13)
        require(np.min(pair.areas) >= 0.0, f"{name}: an area is negative")
    require(
        np.min(operators.node_areas, initial=1.0) >= 0.0, "the material around an interior node has a negative area"
    )
    require(np.max(operators.node_areas, initial=0.0) > 0.0 or not len(free), "no material around any interior node")
