"""C and |S| : the matrices that a tangent and a scale are made of, beside those of the operators."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.contracts.continuum.law import ConstitutiveLaw, rate_squared
from nlsolve.series import Array


def secant_moduli(law: ConstitutiveLaw, strain_rate: Array) -> Array:
    """C = 2 μ I [MPa s], shape (3, 3, M), so that s = C ε̇, for strain rates (3, M) ordered xx, yy, xy."""
    return isotropic(law.viscosity(rate_squared(strain_rate)))


def isotropic(viscosity: Array) -> Array:
    """C = 2 μ I [MPa s], shape (3, 3, M), of viscosities μ (M,)."""
    return 2.0 * np.eye(3)[:, :, None] * viscosity


def pointwise(moduli: Array) -> Any:
    """C (3, 3, M) as a sparse matrix (3M, 3M) with three entries a row: row a M + m holds columns m, M + m, 2 M + m."""
    points = moduli.shape[2]
    columns = np.arange(points, dtype=np.int32)[None, :, None] + points * np.arange(3, dtype=np.int32)[None, None, :]
    return sp.csr_array(
        (
            np.ascontiguousarray(moduli.transpose(0, 2, 1)).ravel(),
            np.broadcast_to(columns, (3, points, 3)).ravel(),
            np.arange(0, 9 * points + 1, 3, dtype=np.int32),
        ),
        shape=(3 * points, 3 * points),
    )


def magnitude(matrix: Any) -> Any:
    """|A|, with the same places as A."""
    if not sp.issparse(matrix):
        return abs(matrix)
    return sp.csr_array((np.abs(matrix.data), matrix.indices, matrix.indptr), shape=matrix.shape)
