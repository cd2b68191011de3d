"""R(u) = 0 or u = u − K*⁻¹ R(u) by KINSOL of SUNDIALS (Hindmarsh et al. 2005), through sundials4py."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step
from nlsolve_solvers.external.served import Ending, Served, runs

try:
    from sundials4py import core, kinsol
except ImportError:  # an extra: nlsolve[kinsol]
    core = kinsol = None

WAY_OUT = (
    "the solver 'kinsol' needs sundials4py: pip install 'nlsolve[kinsol]' with Python 3.12 or newer; or choose another "
    "solver, such as modified-newton"
)
SMALLEST = 1e-300  # a norm that KINSOL takes for zero
GAMMA, POWER = 0.9, 2.0  # Eisenstat and Walker's choice 2, as newton-krylov has it
STRATEGIES = {"newton": "KIN_NONE", "line-search": "KIN_LINESEARCH", "picard": "KIN_PICARD", "fixed-point": "KIN_FP"}
MATRIX_COUNTERS = {"reported_factorizations": "NumPrecEvals", "reported_triangular_solves": "NumPrecSolves"}
COUNTERS = {"reported_iterations": "NumNonlinSolvIters", "reported_residuals": "NumFuncEvals"}


class Kinsol(NonlinearSolver):
    """newton, line-search : Newton on R(u), with full steps or with backtracking (Dennis & Schnabel 1983); K* is asked
                             for at the first iteration of a run and then every `setup_interval`.
    picard :                 u ← u − K*⁻¹ R(u), K* asked for at each iteration, Anderson's mixing over `depth`.
    fixed-point :            the same, K* asked for at the beginning of a run only.

    The refresh rule, which is told the contraction per solve with K*, decides whether K* is then factorised anew.
    KINSOL does not take a linear solver of ours, but takes a preconditioner: linear = "direct" is one step of its
    flexible GMRES on K* itself, of which K*⁻¹ is the exact preconditioner; "gmres" works on J(u), to the tolerance of
    Eisenstat & Walker (1996), choice 2. As with any iterative solver, newton and line-search also ask for K* after a
    step with |Δu_i| > 1.5 (1 + |u_i|) for some i, and do not watch how ‖R‖ falls, as with its dense solver. So a
    direct call with that takes other steps for `setup_interval` > 1; for 1 it takes the same.

    One run is one step: until ‖R‖₂ ≤ `tolerance` · scale and a tenth of its first value, or until `iterations` are used
    up. KINSOL tests the largest entry of R alone, so it is handed R = 0 from there on.
    """

    kind: Literal["kinsol"] = "kinsol"
    strategy: Literal["newton", "line-search", "picard", "fixed-point"] = Field("newton", description="as in KINSOL")
    setup_interval: int = Field(10, gt=0, description="iterations K* serves before it is wanted anew (KINSOL's msbset)")
    linear: Literal["direct", "gmres"] = Field("direct", description="how newton and line-search solve with J")
    dimension: int = Field(40, gt=0, description="largest dimension of the Krylov space")
    depth: int = Field(5, ge=0, description="m, iterates mixed by picard and fixed-point")
    tolerance: float = Field(1e-8, gt=0, description="relative residual at which one run ends")
    iterations: int = Field(50, gt=0, description="of KINSOL in one run")
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The start, and the ends of the runs. Raises SolveError (not applicable) if sundials4py is not installed."""
        if kinsol is None:
            raise SolveError(Status.NOT_APPLICABLE, WAY_OUT)
        direct = self.linear == "direct" or self.strategy == "picard"
        goal = self.tolerance * problem.scale(start)
        yield from runs(
            lambda state: Served(problem, tangent, state, goal, direct),
            self._run,
            start,
            set_up_first=self.strategy == "fixed-point",
        )

    def _run(self, served: Served, start: np.ndarray) -> Ending:
        """One call of KINSOL, from `start` (U,)."""
        calls = _Calls(served)
        context = core.SUNContext_Create(core.SUN_COMM_NULL)[1]
        core.SUNContext_ClearErrHandlers(context)  # they print; the flag that KINSOL returns says the same
        view = kinsol.KINCreate(context)
        memory = view.get()
        u, ones = (core.N_VMake_Serial(len(start), values, context) for values in (start.copy(), np.ones(len(start))))
        if self.strategy in ("picard", "fixed-point"):
            kinsol.KINSetMAA(memory, self.depth)
        kinsol.KINInit(memory, calls.image if self.strategy == "fixed-point" else calls.residual, u)
        if self.strategy != "fixed-point":
            largest = self.dimension if self.linear == "gmres" else 1
            gmres = core.SUNLinSol_SPFGMR(u, core.SUN_PREC_RIGHT, largest, context)
            kinsol.KINSetLinearSolver(memory, gmres)
            kinsol.KINSetPreconditioner(memory, calls.set_up, calls.solve)
            kinsol.KINSetJacTimesVecFn(memory, calls.product)
            kinsol.KINSetMaxSetupCalls(memory, self.setup_interval)
            kinsol.KINSetEtaForm(memory, kinsol.KIN_ETACHOICE2)
            kinsol.KINSetEtaParams(memory, GAMMA, POWER)
        kinsol.KINSetFuncNormTol(memory, SMALLEST)
        kinsol.KINSetNumMaxIters(memory, self.iterations)
        flag = kinsol.KINSol(memory, u, getattr(kinsol, STRATEGIES[self.strategy]), ones, ones)
        if served.error is not None:
            raise served.error
        counters = COUNTERS if self.strategy == "fixed-point" else COUNTERS | MATRIX_COUNTERS
        reported = {name: float(getattr(kinsol, f"KINGet{counter}")(memory)[1]) for name, counter in counters.items()}
        gave_up = flag not in (kinsol.KIN_SUCCESS, kinsol.KIN_INITIAL_GUESS_OK, kinsol.KIN_MAXITER_REACHED)
        reason = f"KINSOL, {self.strategy}: {kinsol.KINGetReturnFlagName(flag)}" if gave_up else ""
        return Ending(core.N_VGetNumpyArray(u).copy(), reason, reported)


class _Calls:
    """The callbacks of KINSOL. Each fills a vector and returns 0, or −1 after an exception; `residual` returns 1 where
    R is not finite, and KINSOL then tries a shorter step. It does not test for that itself and would search for ever.
    """

    def __init__(self, served: Served) -> None:
        self._served = served

    def residual(self, u: Any, f: Any, _: Any) -> int:
        def fill() -> None:
            at = array(u)
            residual = self._served.residual(at)
            array(f)[:] = 0.0 if self._served.solved(at) else residual

        return self._served.guarded(fill) or int(not np.isfinite(array(f)).all())

    def image(self, u: Any, g: Any, _: Any) -> int:
        """u − K*⁻¹ R(u)."""

        def fill() -> None:
            array(g)[:] = array(u) - self._served.correction(array(u))

        return self._served.guarded(fill)

    def set_up(self, u: Any, u_scale: Any, f: Any, f_scale: Any, _: Any) -> int:
        return self._served.guarded(lambda: self._served.renew(array(u)))

    def solve(self, u: Any, u_scale: Any, f: Any, f_scale: Any, v: Any, _: Any) -> int:
        def overwrite() -> None:
            array(v)[:] = self._served.solve(array(v))

        return self._served.guarded(overwrite)

    def product(self, v: Any, product: Any, u: Any, _: Any) -> tuple[int, int]:
        def fill() -> None:
            self._served.linearize(array(u))
            array(product)[:] = self._served.product(array(v))

        return self._served.guarded(fill), 0  # 0: the product is for this u


def array(vector: Any) -> np.ndarray:
    """The entries of a vector of SUNDIALS, in place."""
    return np.asarray(core.N_VGetNumpyArray(vector))
