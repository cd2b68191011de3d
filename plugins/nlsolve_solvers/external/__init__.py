"""Solvers of other packages under the same ledger: residuals and solves they call for are counted like ours."""

from nlsolve_solvers.external.kinsol import Kinsol
from nlsolve_solvers.external.petsc_snes import PetscSnes
from nlsolve_solvers.external.scipy_root import ScipyRoot

__all__ = ["Kinsol", "PetscSnes", "ScipyRoot"]
