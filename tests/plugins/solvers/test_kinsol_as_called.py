"""`kinsol` is what a caller of KINSOL has: the same points, to the rounding of two factorisations, counts and ends."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
import pytest
from cases import Recorded, run
from nlsolve_linear.lapack import Lapack
from nlsolve_rules.refresh import EveryIteration
from nlsolve_solvers.external import Kinsol, kinsol
from nlsolve_solvers.external.served import Ending, Served
from nlsolve_systems import Published
from nlsolve_systems.catalogue import PROBLEMS

from nlsolve.contracts.status import SolveError
from nlsolve.series import Array
from nlsolve.solving.stopping import StoppingTest

pytestmark = pytest.mark.skipif(
    kinsol.kinsol is None, reason="sundials4py is not installed: pip install 'nlsolve[kinsol]'"
)

STOP = StoppingTest(kind="absolute", tolerance=1e-9)
GOAL, MOST = 1e-8, 30
TOGETHER = {"powell-singular": 8, "extended-powell-singular": 8, "variably-dimensioned": 5}
"""Points before the rounding of two factorisations parts the ways: J is singular at the root, or nearly so."""
TINY = 1e-300  # a norm that KINSOL never sees
DIMENSION = 40
SOLVERS = {
    "newton": Kinsol(setup_interval=1, tolerance=GOAL, iterations=MOST),
    "line-search": Kinsol(strategy="line-search", setup_interval=1, tolerance=GOAL, iterations=MOST),
    "kept tangent": Kinsol(tolerance=GOAL, iterations=MOST),
    "kept tangent, line-search": Kinsol(strategy="line-search", tolerance=GOAL, iterations=MOST),
    "gmres": Kinsol(linear="gmres", dimension=DIMENSION, tolerance=GOAL, iterations=MOST),
    "picard": Kinsol(strategy="picard", depth=1, tolerance=GOAL, iterations=MOST),
    "plain picard": Kinsol(strategy="picard", depth=0, tolerance=GOAL, iterations=MOST),
    "fixed-point": Kinsol(strategy="fixed-point", depth=3, tolerance=GOAL, iterations=MOST),
    "plain fixed-point": Kinsol(strategy="fixed-point", depth=0, tolerance=GOAL, iterations=MOST),
}


class Direct(NamedTuple):
    """What one call of KINSOL leaves."""

    state: Array
    flag: str
    iterations: int
    residuals: int


def called(problem: Recorded, start: Array, solver: Kinsol, iterations: int) -> Direct:
    """KINSOL as anyone calls it: its dense matrix and LU; its flexible GMRES where a preconditioner is kept; the
    image of a fixed point; and the default of all else.
    """
    core, library, size = kinsol.core, kinsol.kinsol, len(start)
    context = core.SUNContext_Create(core.SUN_COMM_NULL)[1]
    core.SUNContext_ClearErrHandlers(context)
    view = library.KINCreate(context)
    memory = view.get()
    u, ones = (core.N_VMake_Serial(size, values, context) for values in (start.copy(), np.ones(size)))

    def residual(u: Any, f: Any, _: Any) -> int:
        values = kinsol.array(f)
        values[:] = problem.residual(kinsol.array(u).copy())
        return int(not np.isfinite(values).all())

    def jacobian(u: Any, f: Any, matrix: Any, *_: Any) -> int:
        core.SUNDenseMatrix_Data(matrix)[:] = dense(problem, kinsol.array(u))
        return 0

    def image(u: Any, g: Any, _: Any) -> int:
        at = kinsol.array(u).copy()
        values = kinsol.array(g)
        values[:] = at - factors.solve(problem.residual(at))
        return int(not np.isfinite(values).all())

    def set_up(u: Any, u_scale: Any, f: Any, f_scale: Any, _: Any) -> int:
        at = kinsol.array(u).copy()
        kept.append((dense(problem, at), Lapack().factorize(problem.jacobian(at))))
        return 0

    def precondition(u: Any, u_scale: Any, f: Any, f_scale: Any, v: Any, _: Any) -> int:
        kinsol.array(v)[:] = kept[-1][1].solve(kinsol.array(v).copy())
        return 0

    def product(v: Any, product: Any, u: Any, _: Any) -> tuple[int, int]:
        matrix = kept[-1][0] if solver.linear == "direct" else dense(problem, kinsol.array(u))
        kinsol.array(product)[:] = matrix @ kinsol.array(v)
        return 0, 0

    kept: list[tuple[Array, Any]] = []
    if solver.strategy in ("picard", "fixed-point"):
        library.KINSetMAA(memory, solver.depth)
    if solver.strategy == "fixed-point":
        factors = Lapack().factorize(problem.jacobian(start))
        library.KINInit(memory, image, u)
    elif solver.setup_interval == 1 or solver.strategy == "picard":
        library.KINInit(memory, residual, u)
        matrix = core.SUNDenseMatrix(size, size, context)
        linear = core.SUNLinSol_Dense(u, matrix, context)
        library.KINSetLinearSolver(memory, linear, matrix)
        library.KINSetJacFn(memory, jacobian)
        library.KINSetMaxSetupCalls(memory, 1)
    else:
        library.KINInit(memory, residual, u)
        linear = core.SUNLinSol_SPFGMR(u, core.SUN_PREC_RIGHT, 1 if solver.linear == "direct" else DIMENSION, context)
        library.KINSetLinearSolver(memory, linear)
        library.KINSetPreconditioner(memory, set_up, precondition)
        library.KINSetJacTimesVecFn(memory, product)
        library.KINSetEtaForm(memory, library.KIN_ETACHOICE2)
        library.KINSetEtaParams(memory, kinsol.GAMMA, kinsol.POWER)
    library.KINSetFuncNormTol(memory, TINY)
    library.KINSetNumMaxIters(memory, iterations)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        flag = library.KINSol(memory, u, getattr(library, kinsol.STRATEGIES[solver.strategy]), ones, ones)
    return Direct(
        kinsol.array(u).copy(),
        library.KINGetReturnFlagName(flag),
        library.KINGetNumNonlinSolvIters(memory)[1],
        library.KINGetNumFuncEvals(memory)[1],
    )


def dense(problem: Recorded, u: Array) -> Array:
    values = problem.jacobian(u.copy())
    return values if isinstance(values, np.ndarray) else values.toarray()


@pytest.fixture
def endings(monkeypatch: pytest.MonkeyPatch) -> list[Ending]:
    """How each run of the wrapper ended."""
    found: list[Ending] = []
    run_once = Kinsol._run

    def noted(self: Kinsol, served: Served, start: Array) -> Ending:
        found.append(run_once(self, served, start))
        return found[-1]

    monkeypatch.setattr(Kinsol, "_run", noted)
    return found


@pytest.mark.parametrize("strategy", SOLVERS)
@pytest.mark.parametrize("problem", PROBLEMS)
def test_kinsol_asks_for_the_same_points(problem: str, strategy: str, endings: list[Ending]) -> None:
    """Its first run is the direct call, stopped after as many iterations as the run needed to reach its goal."""
    system, solver = Published(problem=problem), SOLVERS[strategy]
    ours, theirs = Recorded(system), Recorded(system)
    start = system.start()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run(ours, solver, EveryIteration(), start, Lapack(), stop=STOP)
    if not endings:  # an error of ours ended the run, where KINSOL goes on with numbers that are not finite
        try:
            called(theirs, start, solver, MOST)
        except SolveError:  # of the K* of a fixed point
            assert all((point == start).all() for point in ours.points)
            return
        compare(ours, theirs, start, 2)
        return
    ending = endings[0]
    reached = not ending.gave_up and ending.reported["reported_iterations"] < MOST
    found = called(theirs, start, solver, int(ending.reported["reported_iterations"]) if reached else MOST)
    compare(ours, theirs, start, TOGETHER.get(problem, len(theirs.points)) if reached else 2)
    if reached:
        assert found.flag in ("KIN_MAXITER_REACHED", "KIN_SUCCESS")  # which it is where F = 0 to the last digit
        assert found.iterations == ending.reported["reported_iterations"]
        assert found.residuals == ending.reported["reported_residuals"]
        np.testing.assert_allclose(ending.state, found.state, rtol=1e-6, atol=1e-6 * np.abs(theirs.points).max())
    else:
        assert (ending.gave_up or "KIN_MAXITER_REACHED").endswith(found.flag)


def compare(ours: Recorded, theirs: Recorded, start: Array, alike: int) -> None:
    """The driver looks at the start too, uncounted, before KINSOL does."""
    moved = [i for i, point in enumerate(ours.points) if (point != start).any()]
    asked = ours.points[moved[0] - 1 :] if moved else ours.points
    alike = min(alike, len(theirs.points)) if moved else 1
    size = np.abs(theirs.points[:alike]).max()
    np.testing.assert_allclose(asked[:alike], theirs.points[:alike], rtol=1e-6, atol=1e-6 * size)


@pytest.mark.parametrize("strategy", ["newton", "line-search"])
def test_kinsols_denial_of_a_solved_problem_stands_in_its_column(strategy: Any) -> None:
    """Its steps are too short for it before the residual is as small as it was asked for."""
    system = Published(problem="trigonometric")
    problem = Recorded(system)
    solver = Kinsol(strategy=strategy, setup_interval=1, tolerance=1e-200, iterations=MOST)
    outcome, _ = run(problem, solver, EveryIteration(), system.start(), Lapack(), stop=STOP)
    assert outcome.converged
    assert outcome.denied_wrongly
