"""B and S by moving least squares: strain rates at stress points from nodes, divergence of stress back at nodes."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
import scipy.sparse as sp
from pydantic import Field, model_validator

from nlsolve import Cloud, Discretizer, Operators
from nlsolve_collocation.least_squares import Supports, monomials, weights
from nlsolve_collocation.triangles import Triangles

GRADIENT = ((1, 0), (0, 1))


class MovingLeastSquares(Discretizer):
    """Collocation with moving least squares derivatives of first order only, once each way.

    between : strain rates and stresses live at the midpoints of the cloud's Delaunay edges; no second derivative and no
              odd-even mode. The default.
    nodes :   strain rates and stresses live at the nodes (the composed form of the 2015 paper); kept to be compared
              with: it decouples neighbouring nodes and fails for n → 0.

    The volumetric term has points of its own, about one a node, so that the penalty does not lock: patches of two
    Delaunay triangles ("pairs"), or the nodes with moving least squares both ways ("nodes").
    """

    kind: Literal["mls"] = "mls"
    points: Literal["between", "nodes"] = Field("between", description="where strain rates and stresses are taken")
    volume_points: Literal["pairs", "nodes"] = Field("pairs", description="where the dilatation is taken")
    degree: int = Field(2, ge=1, le=4, description="degree of the polynomials")
    support: int = Field(10, ge=3, description="nodes around a strain point")
    force_support: int = Field(12, ge=3, description="stress points around a node")
    volume_support: int = Field(20, ge=3, description="nodes around a volume point at a node")
    radius: float | None = Field(None, gt=0, description="influence radius in place of the counts [mm]")
    weight: Literal["gaussian", "quartic", "spline"] = Field("gaussian", description="weight function of the distance")
    shape: float = Field(3.0, gt=0, description="of the gaussian: exp(−(shape · distance/radius)²)")

    @model_validator(mode="after")
    def _enough_neighbours(self) -> Self:
        least = len(monomials(self.degree))
        for name in ("support", "force_support", "volume_support"):
            if self.radius is None and getattr(self, name) < least:
                raise ValueError(
                    f"{name} = {getattr(self, name)}: polynomials of degree {self.degree} need at least {least} points"
                )
        return self

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        """B, S and, when asked for, B_θ, S_θ."""
        nodes, interior = cloud.nodes, cloud.interior
        triangles = Triangles.of(cloud)
        points = triangles.midpoints() if self.points == "between" else nodes
        m, n, f = len(points), len(nodes), len(interior)

        near, (dx, dy) = self._gradient(nodes, points, self.support)
        u, v = 2 * near, 2 * near + 1
        strain = _sparse_rows([[(u, dx)], [(v, dy)], [(u, 0.5 * dy), (v, 0.5 * dx)]], (3 * m, 2 * n))

        near, (dx, dy) = self._gradient(points, nodes[interior], self.force_support)
        xx, yy, xy = near, near + m, near + 2 * m
        force = _node_major(_sparse_rows([[(xx, dx), (xy, dy)], [(xy, dx), (yy, dy)]], (2 * f, 3 * m)))

        if not volumetric:
            return Operators(strain, force, points)
        if self.volume_points == "pairs":
            return Operators(strain, force, points, *triangles.volumetric())
        near, (dx, dy) = self._gradient(nodes, nodes, self.volume_support)
        dilatation = _sparse_rows([[(2 * near, dx), (2 * near + 1, dy)]], (n, 2 * n))
        near, dx, dy = near[interior], dx[interior], dy[interior]
        pressure_force = _node_major(_sparse_rows([[(near, dx)], [(near, dy)]], (2 * f, n)))
        return Operators(strain, force, points, dilatation, pressure_force, nodes)

    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        """∂/∂x and ∂/∂y at the nodes."""
        near, derivatives = self._gradient(cloud.nodes, cloud.nodes, self.volume_support)
        shape = (len(cloud.nodes), len(cloud.nodes))
        dx, dy = (_sparse_rows([[(near, derivative)]], shape) for derivative in derivatives)
        return dx, dy

    def values(self, sources: np.ndarray, targets: np.ndarray) -> Any:
        """Sparse (T, N) matrix of moving least squares values."""
        supports = self._supports(sources, targets, self.support)
        (value,) = weights(sources, targets, supports, self.degree, ((0, 0),), self.weight, self.shape)
        return _sparse_rows([[(supports.index, value)]], (len(targets), len(sources)))

    def _supports(self, sources: np.ndarray, targets: np.ndarray, count: int) -> Supports:
        if self.radius is None:
            return Supports.nearest(sources, targets, count)
        return Supports.within(sources, targets, self.radius)

    def _gradient(self, sources: np.ndarray, targets: np.ndarray, count: int) -> tuple[np.ndarray, list[np.ndarray]]:
        """Neighbours (T, k) and the weights (T, k) of ∂/∂x and ∂/∂y."""
        supports = self._supports(sources, targets, count)
        return supports.index, weights(sources, targets, supports, self.degree, GRADIENT, self.weight, self.shape)


def _sparse_rows(blocks: list[list[tuple[np.ndarray, np.ndarray]]], shape: tuple[int, int]) -> Any:
    """CSR matrix of stacked blocks of rows; a block joins (columns, values) pairs, (T, k) each, side by side."""
    columns = [np.concatenate([pair[0] for pair in block], axis=1) for block in blocks]
    values = [np.concatenate([pair[1] for pair in block], axis=1) for block in blocks]
    lengths = np.concatenate([np.full(len(block), block.shape[1]) for block in columns])
    starts = np.concatenate([[0], np.cumsum(lengths)])
    return sp.csr_array(
        (np.concatenate([v.ravel() for v in values]), np.concatenate([c.ravel() for c in columns]), starts), shape=shape
    )


def _node_major(matrix: Any) -> Any:
    """Rows x_0 … x_F, y_0 … y_F brought into the order x_0, y_0, x_1, …"""
    return matrix[np.arange(matrix.shape[0]).reshape(2, -1).T.ravel()]
