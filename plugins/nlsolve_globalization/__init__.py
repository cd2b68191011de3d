"""u + t w : full steps, decrease of the residual (halved, interpolated, non-monotone), decrease of a potential."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_globalization.energy import Energy
from nlsolve_globalization.full_steps import FullSteps
from nlsolve_globalization.residual import Backtracking, Cubic, NonMonotone

__all__ = ["Backtracking", "Cubic", "Energy", "FullSteps", "NonMonotone"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [FullSteps, Backtracking, Cubic, NonMonotone, Energy]
