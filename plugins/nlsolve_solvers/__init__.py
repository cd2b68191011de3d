"""Methods for R(u) = 0, one in each file; homotopy, Newton-Krylov and solvers of other libraries are packages."""

from __future__ import annotations

from collections.abc import Iterable

from nlsolve.plugin import Component, hookimpl
from nlsolve_solvers.anderson import Anderson
from nlsolve_solvers.broyden import Broyden
from nlsolve_solvers.external import Kinsol, PetscSnes, ScipyRoot
from nlsolve_solvers.homotopy import FORMS, RANGE_RULES, AsymptoticNumericalMethod
from nlsolve_solvers.krylov import NewtonKrylov
from nlsolve_solvers.levenberg_marquardt import LevenbergMarquardt
from nlsolve_solvers.modified_newton import ModifiedNewton
from nlsolve_solvers.newton import Newton
from nlsolve_solvers.picard import Picard
from nlsolve_solvers.pseudo_transient import PseudoTransient
from nlsolve_solvers.robust import Robust
from nlsolve_solvers.trust_region import TrustRegion

METHODS = (
    Newton,
    ModifiedNewton,
    PseudoTransient,
    LevenbergMarquardt,
    Robust,
    Anderson,
    Picard,
    Broyden,
    NewtonKrylov,
    TrustRegion,
    AsymptoticNumericalMethod,
    ScipyRoot,
    PetscSnes,
    Kinsol,
)


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    """The methods of this package, and the range rules and homotopy forms of one of them."""
    return (*METHODS, *RANGE_RULES, *FORMS)
