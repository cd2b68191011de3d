"""Shapes and types of what the plugins of a flow give, so that a mistake is told with the plugin's name, at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer, Operators
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.series import Array

NUMBERS = "fiu"
"""NumPy's letters for real numbers."""


def check_array(found: Any, shape: tuple[int, ...], what: str) -> None:
    """Raises TypeError unless `found`, an array or a sparse matrix, has this shape and real numbers."""
    given = getattr(found, "shape", None)
    if given != shape:
        raise TypeError(f"{what} of shape {given}, not {shape}")
    if found.dtype.kind not in NUMBERS:
        raise TypeError(f"{what} of {found.dtype} numbers, which should be real")


def check_operators(discretizer: Discretizer, operators: Operators, cloud: Cloud) -> None:
    """Raises TypeError, which names the discretizer, unless B, S, B_θ, S_θ have the shapes of their contract."""
    name = f"the discretizer {discretizer.called()!r} gave"
    n, free = len(cloud.nodes), len(cloud.interior)
    if not isinstance(operators, Operators):
        raise TypeError(f"{name} a {type(operators).__name__}, not Operators")
    for told, pair, components in (("strain", operators.strain, 3), ("volumetric", operators.volumetric, 1)):
        if pair is None:
            continue
        count = len(pair.points)
        check_array(pair.points, (count, 2), f"{name} {told} points")
        check_array(pair.rate, (components * count, 2 * n), f"{name} a {told} rate B")
        check_array(pair.force, (2 * free, components * count), f"{name} a {told} force S")
        if pair.areas is not None:
            check_array(pair.areas, (count,), f"{name} {told} areas")
    if operators.node_areas is not None:
        check_array(operators.node_areas, (free,), f"{name} node_areas")


def check_law(law: ConstitutiveLaw) -> None:
    """Raises TypeError, which names the law, unless μ(ε̄²) of two rates are two real numbers."""
    found = law.viscosity(np.array([1.0, 2.0]))
    check_array(found, (2,), f"the law {law.called()!r} gave for two rates a viscosity")


def check_velocity(scene: str, velocity: Any, cloud: Cloud) -> Array:
    """V on the boundary, (len(cloud.boundary), 2). Raises TypeError, which names the kind of the scene."""
    check_array(velocity, (len(cloud.boundary), 2), f"the scene {scene!r} gave a boundary velocity")
    return velocity
