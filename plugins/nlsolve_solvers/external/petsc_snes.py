"""R(u) = 0 or K*⁻¹ R(u) = 0 by SNES, the nonlinear solvers of PETSc (Brune, Knepley, Smith & Tu 2015)."""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from typing import Any, ClassVar, Literal
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step
from nlsolve_solvers.external.petsc import PETSc, Snes
from nlsolve_solvers.external.served import Served, runs

WAY_OUT = (
    "the solver 'petsc-snes' needs petsc4py: pip install 'nlsolve[petsc]' with Python 3.12 or newer on Linux, or "
    "Debian's package python3-petsc4py; or choose another solver, such as modified-newton"
)
NEVER_AGAIN = -2  # as a lag
FIRST_FORCING, GAMMA, LARGEST, POWER, REMEMBERED = 0.1, 0.9, 0.9, 2.0, 0.1  # choice 2, as newton-krylov has it


class PetscSnes(NonlinearSolver):
    """newtonls, newtontr : Newton on R(u) with a line search or a trust region. Its Jacobian is K*, which SNES asks
                            for every `lag` iterations, counted on from run to run if it `persists`; the refresh rule
                            decides whether K* is then factorised anew. With linear = "gmres" its Jacobian is J(u),
                            K* the preconditioner, and flexible GMRES ends by choice 2 of Eisenstat & Walker (1996).
    anderson, ngmres, qn :  on K*⁻¹ R(u); the refresh rule is asked at the beginning of each run.

    SNES does not hand over its iterates as they come, so one run of it is one step: until ‖R‖₂ ≤ `tolerance` · scale
    and a tenth of its first value, or until `iterations` are used up. The refresh rule is told the contraction per
    solve with K*.
    """

    kind: Literal["petsc-snes"] = "petsc-snes"
    method: Literal["newtonls", "newtontr", "anderson", "ngmres", "qn"] = Field("newtonls", description="as in SNES")
    line_search: Literal["bt", "basic", "cp", "nleqerr"] = Field("bt", description="as in SNES; of newtonls")
    degree: int = Field(3, ge=1, le=3, description="of the polynomial by which bt finds the next length")
    lag: int = Field(1, ge=0, description="iterations a Jacobian serves; 0: the first one serves to the end")
    lag_preconditioner: int = Field(1, ge=0, description="Jacobians for which K* serves; 0: for all of them")
    persists: bool = Field(False, description="count both lags on from one run to the next")
    linear: Literal["preonly", "gmres"] = Field("preonly", description="how newtonls and newtontr solve with J")
    dimension: int = Field(40, gt=0, description="largest dimension of the Krylov space")
    radius: float = Field(0.2, gt=0, description="Δ over ‖u‖ where a run of newtontr begins")
    depth: int = Field(5, gt=0, description="m, iterates remembered by anderson, ngmres and qn")
    tolerance: float = Field(1e-8, gt=0, description="relative residual at which one run ends")
    iterations: int = Field(50, gt=0, description="of SNES in one run")
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The start, and the ends of the runs. Raises SolveError (not applicable) if petsc4py is not installed."""
        if PETSc is None:
            raise SolveError(Status.NOT_APPLICABLE, WAY_OUT)
        direct = self.method == "newtonls" and self.linear == "preonly"
        goal = self.tolerance * problem.scale(start)
        yield from runs(
            lambda state: Served(problem, tangent, state, goal, direct),
            self._snes_beside(tangent, len(start)).run,
            start,
            set_up_first=not self._with_matrix,
        )

    @property
    def _with_matrix(self) -> bool:
        return self.method in ("newtonls", "newtontr")

    def _snes_beside(self, tangent: KeptTangent, size: int) -> Snes:
        """The SNES that is kept as long as this tangent, which is for one march."""
        key = self.model_dump_json()
        kept = _kept.get(tangent)
        if kept is None or kept[0] != key or kept[1].size != size:
            kept = _kept[tangent] = (key, Snes(size, self._with_matrix, self.radius, self._options()))
        return kept[1]

    def _options(self) -> dict[str, Any]:
        options: dict[str, Any] = {
            "snes_type": self.method,
            "snes_max_it": self.iterations,
            "snes_stol": 0.0,
            "snes_tr_delta0": self.radius,
        }
        if not self._with_matrix:
            options[f"snes_{self.method}_m"] = self.depth
            return options | ({"snes_qn_type": "broyden", "snes_qn_scale_type": "none"} if self.method == "qn" else {})
        for name, lag in (("lag_jacobian", self.lag), ("lag_preconditioner", self.lag_preconditioner)):
            options |= {f"snes_{name}": lag or NEVER_AGAIN, f"snes_{name}_persists": self.persists}
        if self.method == "newtonls":
            options["snes_linesearch_type"] = self.line_search
            if self.line_search == "bt":
                options["snes_linesearch_order"] = self.degree
        if self.linear == "preonly":
            return options | {"ksp_type": "preonly"}
        forcing = {
            "version": 2,
            "rtol0": FIRST_FORCING,
            "rtolmax": LARGEST,
            "gamma": GAMMA,
            "alpha": POWER,
            "alpha2": POWER,
            "threshold": REMEMBERED,
        }
        return options | {
            "ksp_type": "fgmres",
            "ksp_gmres_restart": self.dimension,
            "ksp_max_it": self.dimension,
            "snes_ksp_ew": True,
            **{f"snes_ksp_ew_{name}": value for name, value in forcing.items()},
        }


# A SNES must outlive its runs: lags that persist are counted on from one solve of a march to the next. A component is a
# frozen value and cannot hold one, so it is found by the tangent that is kept throughout the march, and goes with it.
_kept: WeakKeyDictionary[KeptTangent, tuple[str, Snes]] = WeakKeyDictionary()
atexit.register(_kept.clear)  # PETSc must not end before its objects do
