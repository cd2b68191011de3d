"""One SNES of PETSc, whose function, Jacobian and preconditioner are ours."""

from __future__ import annotations

import contextlib
import gc
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from nlsolve_solvers.external.served import Ending, Served

with contextlib.suppress(ImportError):
    from mpi4py import MPI  # noqa: F401  (loads the library that wheels of petsc4py need; others find theirs)
try:
    with warnings.catch_warnings():  # petsc4py 3.18 imports what Python has deprecated since
        warnings.simplefilter("ignore")
        from petsc4py import PETSc
except ImportError:  # an extra
    PETSc = None
else:
    PETSc.Log.begin()

PREFIX = "nlsolve_"  # of our options in PETSc's one table of them
EVENTS = {
    "reported_jacobians": "SNESJacobianEval",
    "reported_factorizations": "PCSetUp",
    "reported_triangular_solves": "PCApply",
}
"""Counters that are read from PETSc's own log; for the others SNES has public functions."""


class Snes:
    """SNES on U unknowns. It is kept from run to run, as in a march, so that lags may persist.

    with_matrix : its function is R(u), its Jacobian J, its preconditioner K*; else its function is K*⁻¹ R(u).
    radius : Δ over ‖u‖ where a run of newtontr begins.
    options : by PETSc's names for them, without a prefix.
    """

    def __init__(self, size: int, with_matrix: bool, radius: float, options: Mapping[str, Any]) -> None:
        self.size, self._with_matrix, self._radius = size, with_matrix, radius
        self._calls = _Calls(with_matrix)
        self._snes = PETSc.SNES().create(PETSc.COMM_SELF)
        self._u = PETSc.Vec().createSeq(size)
        self._snes.setFunction(self._calls.function, self._u.duplicate())
        self._snes.setConvergenceTest(self._calls.converged)
        if with_matrix:
            matrix = PETSc.Mat().createPython([size, size], _Matrix(self._calls), comm=PETSc.COMM_SELF)
            matrix.setUp()
            self._snes.setJacobian(self._calls.jacobian, matrix)
            preconditioner = self._snes.getKSP().getPC()
            preconditioner.setType("python")
            preconditioner.setPythonContext(_Preconditioner(self._calls))
        table = PETSc.Options(PREFIX)
        for name, value in options.items():
            table[name] = value
        self._snes.setOptionsPrefix(PREFIX)
        self._snes.setFromOptions()
        for name in options:
            del table[name]

    def run(self, served: Served, start: np.ndarray) -> Ending:
        """One SNESSolve from `start` (U,). Raises what a callback of ours has raised."""
        self._calls.served = served
        self._u.setArray(start)
        if hasattr(self._snes, "setTRTolerances"):  # Δ is a length there; in PETSc 3.18 it is relative, as here
            self._snes.setTRTolerances(delta_0=self._radius * (float(np.linalg.norm(start)) or 1.0))
        before = _log()
        try:
            with _logged(), _no_collection():
                self._snes.solve(None, self._u)
        except Exception:  # PETSc's own error, or its wrapping of what a callback of ours raised, which is raised below
            if served.error is None:
                raise
        finally:
            self._calls.served = None
        if served.error is not None:
            raise served.error
        state = self._u.getArray(readonly=True).copy()
        reported = {
            "reported_iterations": self._snes.getIterationNumber(),
            "reported_residuals": self._snes.getFunctionEvaluations(),
        }
        if self._with_matrix:
            reported |= {name: count - before[name] for name, count in _log().items()}
        return Ending(state, self._gave_up(), reported)

    def _gave_up(self) -> str:
        reasons = {value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if not name.startswith("_")}
        reason = self._snes.getConvergedReason()
        gave_up = reason < 0 and reason != PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return f"SNES, {self._snes.getType()}: {reasons[reason]}" if gave_up else ""


_stages = [0]  # of PETSc's log, the last one in use


@contextlib.contextmanager
def _logged() -> Iterator[None]:
    """A run whose events are counted. One that an error ends leaves its events open, and PETSc counts no open event
    again in that stage of its log: the next run gets another.
    """
    stage = PETSc.Log.Stage(f"{PREFIX}{_stages[-1]}")
    stage.push()
    try:
        yield
    except BaseException:
        _stages[-1] += 1
        raise
    finally:
        stage.pop()


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """No garbage is collected: an exception of a callback is pending all the way through PETSc, and a collection on
    that way would print it as one that nobody caught.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _log() -> dict[str, float]:
    stage = PETSc.Log.Stage(f"{PREFIX}{_stages[-1]}").id
    return {name: PETSc.Log.Event(event).getPerfInfo(stage)["count"] for name, event in EVENTS.items()}


class _Calls:
    """The callbacks of SNES, apart from `Snes`: Python never collects a reference cycle through PETSc."""

    def __init__(self, with_matrix: bool) -> None:
        self._with_matrix = with_matrix
        self.served: Served | None = None
        self._at = np.zeros(0)

    def do(self, callback: Callable[[Served], None]) -> None:
        served = self.served
        assert served is not None
        if served.guarded(lambda: callback(served)):
            assert served.error is not None
            raise served.error

    def function(self, snes: Any, u: Any, f: Any) -> None:
        x = u.getArray(readonly=True)
        self.do(lambda served: f.setArray(served.residual(x) if self._with_matrix else served.correction(x)))

    def jacobian(self, snes: Any, u: Any, matrix: Any, preconditioner: Any) -> None:
        self._at = u.getArray(readonly=True).copy()
        self.do(lambda served: served.linearize(self._at))
        matrix.assemble()  # which tells the preconditioner that it is out of date

    def set_up(self) -> None:
        self.do(lambda served: served.renew(self._at))

    def converged(self, snes: Any, iteration: int, norms: tuple[float, float, float]) -> int:
        assert self.served is not None
        if not np.isfinite(norms[2]):
            return int(PETSc.SNES.ConvergedReason.DIVERGED_FUNCTION_DOMAIN)
        solved = self.served.solved(snes.getSolution().getArray(readonly=True))
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS) if solved else 0


class _Matrix:
    """J as PETSc's matrix."""

    def __init__(self, calls: _Calls) -> None:
        self._calls = calls

    def mult(self, matrix: Any, x: Any, y: Any) -> None:
        self._calls.do(lambda served: y.setArray(served.product(x.getArray(readonly=True))))

    def multTranspose(self, matrix: Any, x: Any, y: Any) -> None:
        self._calls.do(lambda served: y.setArray(served.transposed_product(x.getArray(readonly=True))))


class _Preconditioner:
    """K*⁻¹ as PETSc's preconditioner."""

    def __init__(self, calls: _Calls) -> None:
        self._calls = calls

    def setUp(self, preconditioner: Any) -> None:
        self._calls.set_up()

    def apply(self, preconditioner: Any, x: Any, y: Any) -> None:
        self._calls.do(lambda served: y.setArray(served.solve(x.getArray(readonly=True))))
