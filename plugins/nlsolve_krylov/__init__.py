"""Methods that multiply with J(u) and leave its factors to K*: Newton-Krylov and a trust region."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_krylov.newton_krylov import NewtonKrylov
from nlsolve_krylov.trust_region import TrustRegion

__all__ = ["NewtonKrylov", "TrustRegion"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [NewtonKrylov, TrustRegion]
