"""Solvers of other packages under the same ledger: residuals and solves they call for are counted like ours."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve import Component, hookimpl
from nlsolve_peers.kinsol import Kinsol
from nlsolve_peers.petsc_snes import PetscSnes
from nlsolve_peers.scipy_root import ScipyRoot

__all__ = ["Kinsol", "PetscSnes", "ScipyRoot"]


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [ScipyRoot, PetscSnes, Kinsol]
