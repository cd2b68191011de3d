"""The asymptotic numerical method: a homotopy, a series with one kept K*, and a range. One choice a file."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_homotopy.method import AsymptoticNumericalMethod

__all__ = ["AsymptoticNumericalMethod"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [AsymptoticNumericalMethod]
