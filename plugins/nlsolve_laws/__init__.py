"""First-party constitutive laws."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_laws.power_law import PowerLaw


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [PowerLaw]
