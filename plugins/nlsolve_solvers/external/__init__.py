"""Solvers of other libraries under the same ledger: the residuals and solves they ask for are counted like ours."""

from nlsolve_solvers.external.kinsol import Kinsol
from nlsolve_solvers.external.petsc_snes import PetscSnes
from nlsolve_solvers.external.scipy_root import ScipyRoot

__all__ = ["Kinsol", "PetscSnes", "ScipyRoot"]
