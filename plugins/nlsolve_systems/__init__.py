"""Systems of equations F(u) = 0: published test sets, and discretised equations of several sizes."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_systems.bratu import Bratu
from nlsolve_systems.chandrasekhar import Chandrasekhar
from nlsolve_systems.p_laplacian import PLaplacian
from nlsolve_systems.published import Published

__all__ = ["Bratu", "Chandrasekhar", "PLaplacian", "Published"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Published, Bratu, Chandrasekhar, PLaplacian]
