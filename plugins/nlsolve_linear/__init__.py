"""Factorisations of sparse matrices: SuperLU, LAPACK, rslab, PARDISO, the choice among them, and GMRES."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_linear.auto import Auto
from nlsolve_linear.ilu_gmres import IluGmres
from nlsolve_linear.lapack import Lapack
from nlsolve_linear.pardiso import Pardiso
from nlsolve_linear.rslab import Rslab
from nlsolve_linear.superlu import SuperLU


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [Auto, SuperLU, Lapack, Rslab, Pardiso, IluGmres]
