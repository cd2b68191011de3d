"""Problem by name: its formula, its start, its sizes, its known roots, and whether they are singular."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve_systems import burkardt
from nlsolve_systems import more_garbow_hillstrom as mgh
from nlsolve_systems.roots import COMPUTED

Vector = Callable[[int], np.ndarray]


@dataclass(frozen=True)
class Listed:
    """A published problem.

    start : n -> (n,).
    known : n -> (K, n) in closed form, for any n or for the published one; `COMPUTED` holds further roots.
    step : the problem can have any size that is a multiple of it; 0: the published size only.
    singular : the Jacobian is singular at a known root.
    nearest : u -> the nearest root, where these are a set that cannot be listed.
    pattern : n -> where the Jacobian is not zero; None: anywhere.
    """

    formula: Callable[[Any], Any]
    size: int
    start: Vector
    known: Vector | None = None
    step: int = 0
    singular: bool = False
    nearest: Callable[[np.ndarray], np.ndarray] | None = None
    pattern: Callable[[int], Any] | None = None

    def roots(self, name: str, n: int) -> np.ndarray | None:
        """All known roots for n unknowns, (K, n); None if none is known."""
        closed = [] if self.known is None else [self.known(n)]
        found = [rows for rows in (*closed, COMPUTED.get(name)) if rows is not None and rows.shape[1] == n]
        return np.concatenate(found) if found else None


def at(*values: float) -> Vector:
    """The same start for every size."""
    return lambda n: np.array(values)


def roots(*rows: tuple[float, ...]) -> Vector:
    """The same roots for every size."""
    return lambda n: np.array(rows, dtype=float)


def ones(n: int) -> np.ndarray:
    """One root, all ones."""
    return np.ones((1, n))


def zeros(n: int) -> np.ndarray:
    """One root, all zeros."""
    return np.zeros((1, n))


def half_wave(n: int) -> np.ndarray:
    """t (t − 1), t = k/(n + 1)."""
    t = np.arange(1.0, n + 1.0) / (n + 1)
    return t * (t - 1.0)


def nearest_modulo_period(u: np.ndarray) -> np.ndarray:
    """The nearest root of a formula of period 2π in each unknown."""
    turned = [root + 2.0 * np.pi * np.round((u - root) / (2.0 * np.pi)) for root in COMPUTED["trigonometric"]]
    return min(turned, key=lambda root: float(np.linalg.norm(u - root)))


def nearest_on_an_axis(u: np.ndarray) -> np.ndarray:
    """The nearest point with x = 0 or y = 0."""
    return np.where(np.abs(u) == np.abs(u).min(), 0.0, u)


def minus_ones(n: int) -> np.ndarray:
    """−1, …, −1."""
    return np.full(n, -1.0)


def identity(n: int) -> np.ndarray:
    """The identity, row by row."""
    return np.eye(round(n**0.5)).ravel()


def square_roots(n: int) -> np.ndarray:
    """± [[0.01, 50], [0, 0.01]] and, if there is a third row, ± 0.01 on its diagonal.

    A root whose third diagonal entry has the other sign is one point of a surface of roots, because the eigenvalue 10⁻⁴
    is then in two Jordan blocks.
    """
    block, found = np.array([[0.01, 50.0], [0.0, 0.01]]), []
    for sign, other in ((1.0, 0.01), (-1.0, -0.01), (1.0, -0.01), (-1.0, 0.01))[: 2 if n == 4 else 4]:
        root = other * np.eye(round(n**0.5))
        root[:2, :2] = sign * block
        found.append(root.ravel())
    return np.array(found)


def three_diagonals(n: int) -> Any:
    """The pattern of a tridiagonal matrix."""
    return mgh.shifted(n, 1.0, 1.0) + sp.eye_array(n)


TEST_NONLIN: dict[str, Listed] = {
    "generalized-rosenbrock": Listed(
        mgh.generalized_rosenbrock, 10, lambda n: np.array([-1.2, *[1.0] * (n - 1)]), ones, step=1
    ),
    "powell-singular": Listed(
        mgh.powell_singular, 4, lambda n: np.tile([3.0, -1.0, 0.0, 1.0], n // 4), zeros, step=4, singular=True
    ),
    "powell-badly-scaled": Listed(mgh.powell_badly_scaled, 2, at(0.0, 1.0)),
    "wood": Listed(mgh.wood, 4, at(-3.0, -1.0, -3.0, -1.0)),
    "helical-valley": Listed(mgh.helical_valley, 3, at(-1.0, 0.0, 0.0), roots((1.0, 0.0, 0.0))),
    "watson": Listed(burkardt.watson_of_burkardt, 2, np.zeros, step=1),
    "chebyquad": Listed(
        mgh.chebyquad,
        2,
        lambda n: (2.0 * np.arange(1.0, n + 1.0) - n) / (n + 1),  # from k/(n + 1) in [0, 1] comes 2 k/(n + 1) − 1
        roots((-np.sqrt(1.0 / 3.0), np.sqrt(1.0 / 3.0)), (np.sqrt(1.0 / 3.0), -np.sqrt(1.0 / 3.0))),
        step=1,
    ),
    "brown-almost-linear": Listed(mgh.brown_almost_linear, 10, lambda n: np.full(n, 0.5), ones, step=1),
    "discrete-boundary-value": Listed(mgh.discrete_boundary_value, 10, half_wave, step=1, pattern=three_diagonals),
    "discrete-integral": Listed(burkardt.discrete_integral_of_burkardt, 10, half_wave, step=1),
    "trigonometric": Listed(
        mgh.trigonometric, 10, lambda n: np.full(n, 1.0 / n), step=1, nearest=nearest_modulo_period
    ),
    "variably-dimensioned": Listed(
        mgh.variably_dimensioned, 10, lambda n: 1.0 - np.arange(1.0, n + 1.0) / n, ones, step=1
    ),
    "broyden-tridiagonal": Listed(mgh.broyden_tridiagonal, 10, minus_ones, step=1, pattern=three_diagonals),
    "broyden-banded": Listed(
        mgh.broyden_banded, 10, minus_ones, step=1, pattern=lambda n: mgh.band(n) + sp.eye_array(n)
    ),
    "hammarling-2-by-2": Listed(burkardt.hammarling, 4, identity, square_roots),
    "hammarling-3-by-3": Listed(burkardt.hammarling, 9, identity, square_roots, singular=True),
    "dennis-schnabel": Listed(burkardt.dennis_schnabel, 2, at(1.0, 5.0), roots((0.0, 3.0), (3.0, 0.0))),
    "sample-18": Listed(burkardt.sample_18, 2, at(2.0, 2.0), singular=True, nearest=nearest_on_an_axis),
    "sample-19": Listed(burkardt.sample_19, 2, at(3.0, 3.0), zeros, singular=True),
    "scalar": Listed(burkardt.scalar, 1, at(1.0), roots((0.0,), (5.0,)), singular=True),
    "freudenstein-roth": Listed(burkardt.freudenstein_roth, 2, at(0.5, -2.0), roots((5.0, 4.0))),
    "boggs": Listed(burkardt.boggs, 2, at(1.0, 0.0), roots((0.0, 1.0), (-1.0, 2.0), (-np.sqrt(0.5), 1.5))),
    "chandrasekhar": Listed(burkardt.chandrasekhar_of_burkardt, 10, np.ones, step=1),
}
"""The 23 of TEST_NONLIN, in its order, with its starts and sizes."""

MORE_GARBOW_HILLSTROM: dict[str, Listed] = {
    "extended-rosenbrock": Listed(mgh.extended_rosenbrock, 10, lambda n: np.tile([-1.2, 1.0], n // 2), ones, step=2),
    "watson-mgh": Listed(mgh.watson, 6, np.zeros, step=1),
    "discrete-integral-mgh": Listed(mgh.discrete_integral, 10, half_wave, step=1),
    "gulf": Listed(mgh.gulf, 3, at(5.0, 2.5, 0.15), roots((50.0, 25.0, 1.5))),
    "box": Listed(mgh.box, 3, at(0.0, 10.0, 20.0), roots((1.0, 10.0, 1.0), (10.0, 1.0, -1.0))),
    "biggs": Listed(mgh.biggs, 6, at(1.0, 2.0, 1.0, 1.0, 1.0, 1.0), roots((1.0, 10.0, 1.0, 5.0, 4.0, 3.0))),
}
"""Problems of Moré, Garbow & Hillstrom (1981) with as many equations as unknowns that TEST_NONLIN lacks or alters."""

PROBLEMS = TEST_NONLIN | MORE_GARBOW_HILLSTROM
