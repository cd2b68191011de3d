"""u ← g(u) = u − K*⁻¹ R(u), mixed, and Broyden's method: what can be made of one kept matrix and past iterates."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_fixed_point.anderson import Anderson
from nlsolve_fixed_point.broyden import Broyden
from nlsolve_fixed_point.picard import Picard

__all__ = ["Anderson", "Broyden", "Picard"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Anderson, Picard, Broyden]
