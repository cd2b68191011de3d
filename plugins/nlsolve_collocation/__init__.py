"""Moving least squares collocation, with stresses taken between the nodes or at them."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_collocation.collocation import MovingLeastSquares


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [MovingLeastSquares]
