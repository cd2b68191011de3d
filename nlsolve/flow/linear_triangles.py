"""Linear triangles, the cheapest discretizer of any nodes: first states are sought and errors estimated with them."""

from __future__ import annotations

from pydantic import TypeAdapter

from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.registry.nested import AnyDiscretizer

BY_KIND: TypeAdapter[Discretizer] = TypeAdapter(AnyDiscretizer)
"""Looks them up when they are asked for: plugins may still be being imported now."""


def linear_triangles() -> Discretizer:
    """The discretizer `delaunay`."""
    return BY_KIND.validate_python({"kind": "delaunay"})
