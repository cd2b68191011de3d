"""x ≈ A⁻¹ r on a cloud with a node in the middle of every edge, by the factors of A_c on the cloud without them.

Sweeps x ← x + ω D⁻¹ (r − A x), D the blocks (2, 2) of the nodes, take away what changes from node to node; the
rest is corrected by x ← x + P A_c⁻¹ Pᵀ (r − A x), P the linear interpolation (Hackbusch 1985, chapter 2).
Where A_c is that of linear triangles it is Pᵀ A P but for curved walls, also for an A of triangles of degree 2: the
number of cycles does not grow with the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.linear_solver import Factors
from nlsolve.series import Array

LARGEST = 3.0
"""No eigenvalue of D⁻¹ A is larger where A is a sum over triangles: each joins three nodes, and
|a + b + c|² ≤ 3 (|a|² + |b|² + |c|²). Of degree 2 it is 2.8 at most in all cases that were looked at.
"""

SMOOTHED = 4.0
"""The sweeps take away what belongs to eigenvalues between the largest over this and the largest."""

SWEEPS = 2
"""Sweeps before and after each correction."""

ANGLES = np.pi * (np.arange(SWEEPS) + 0.5) / SWEEPS
ZEROS = 0.5 * LARGEST * (1.0 + 1.0 / SMOOTHED + (1.0 - 1.0 / SMOOTHED) * np.cos(ANGLES))
"""1/ω: the zeros of Chebyshev's polynomial between those eigenvalues."""


@dataclass(frozen=True)
class Coarser:
    """The tangent of a flow on a coarser cloud, F_c nodes inside of it.

    factors : of A_c (2 F_c, 2 F_c).
    interpolation : P, (2F, 2 F_c), from its unknowns to those of the finer cloud.
    """

    factors: Factors
    interpolation: Any


class TwoGrids(Factors):
    """One cycle: a symmetric approximation of A⁻¹ where A is symmetric.

    matrix : A, (2F, 2F), unknowns of each node side by side.
    """

    lends = False

    def __init__(self, matrix: Any, coarser: Coarser) -> None:
        self._matrix, self._coarser = matrix, coarser
        self._inverses = _inverse_blocks(matrix)

    def solve(self, rhs: Array) -> Array:
        """x (2F,) near A⁻¹ rhs."""
        x = self._swept(rhs)
        slow = self._coarser.interpolation.T @ (rhs - self._matrix @ x)
        x = x + self._coarser.interpolation @ self._coarser.factors.solve(slow)
        return x + self._swept(rhs - self._matrix @ x)

    def _swept(self, rhs: Array) -> Array:
        """The sweeps from x = 0."""
        first, *others = ZEROS
        x: Array = self._inverses @ rhs / first
        for zero in others:
            x = x + self._inverses @ (rhs - self._matrix @ x) / zero
        return x


def _inverse_blocks(matrix: Any) -> Any:
    """D⁻¹; not finite where a block has none."""
    first, second = matrix.diagonal()[0::2], matrix.diagonal()[1::2]
    upper, lower = matrix.diagonal(1)[0::2], matrix.diagonal(-1)[0::2]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverses = np.array([[second, -upper], [-lower, first]]) / (first * second - upper * lower)
    nodes = len(first)
    return sp.bsr_array((np.moveaxis(inverses, 2, 0), np.arange(nodes), np.arange(nodes + 1)))
