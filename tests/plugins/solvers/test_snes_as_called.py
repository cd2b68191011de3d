"""`petsc-snes` is what a caller of SNES has: the same points, to the rounding of two factorisations, and counts."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from cases import Recorded, run
from nlsolve_linear.lapack import Lapack
from nlsolve_solvers.external import PetscSnes, petsc_snes
from nlsolve_solvers.external.petsc import PETSc
from nlsolve_solvers.external.served import Served
from nlsolve_systems import Published
from nlsolve_systems.catalogue import PROBLEMS

from nlsolve.series import Array
from nlsolve.solving.stopping import StoppingTest

pytestmark = pytest.mark.skipif(PETSc is None, reason="petsc4py is not installed: pip install 'nlsolve[petsc]'")

STOP = StoppingTest(kind="absolute", tolerance=1e-9)
GOAL, MOST = 1e-8, 30
TOGETHER = {"powell-singular": 8, "extended-powell-singular": 8}
"""Points before the rounding of two factorisations parts the ways: J is singular at the root."""
PETSC_ERRORS: Any = () if PETSc is None else PETSc.Error
SEARCHES: dict[str, dict[str, Any]] = {
    "basic": {"snes_linesearch_type": "basic"},
    "bt": {"snes_linesearch_type": "bt", "snes_linesearch_order": 3},
}


def called(problem: Recorded, start: Array, search: str, goal: float) -> Any:
    """SNES as anyone calls it: a dense Jacobian, its LU, and SNES's own stopping test at ‖F‖₂ ≤ `goal`."""
    size = len(start)
    snes, u = PETSc.SNES().create(PETSc.COMM_SELF), PETSc.Vec().createSeq(size)
    matrix = PETSc.Mat().createDense([size, size], comm=PETSc.COMM_SELF)
    matrix.setUp()

    def function(snes: Any, u: Any, f: Any) -> None:
        f.setArray(problem.residual(u.getArray(readonly=True)))

    def jacobian(snes: Any, u: Any, matrix: Any, preconditioner: Any) -> None:
        values = problem.jacobian(u.getArray(readonly=True).copy())
        dense = values if isinstance(values, np.ndarray) else values.toarray()
        preconditioner.setValues(range(size), range(size), dense)
        preconditioner.assemble()

    options = PETSc.Options("direct_")
    settings = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "lu", **SEARCHES[search]}
    for name, value in settings.items():
        options[name] = value
    snes.setFunction(function, u.duplicate())
    snes.setJacobian(jacobian, matrix)
    snes.setOptionsPrefix("direct_")
    snes.setTolerances(rtol=0.0, atol=goal, stol=0.0, max_it=MOST)
    snes.setFromOptions()
    for name in settings:
        del options[name]
    u.setArray(start)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        snes.solve(None, u)
    return snes, u.getArray(readonly=True).copy()


@pytest.fixture
def goals(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """‖F‖₂ at which the runs of the wrapper may end, as they begin."""
    found: list[float] = []

    class Noted(Served):
        def residual(self, u: Array) -> Array:
            values = super().residual(u)
            found.append(self.goal)
            return values

    monkeypatch.setattr(petsc_snes, "Served", Noted)
    return found


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("problem", PROBLEMS)
def test_snes_asks_for_the_same_points(problem: str, search: Any, goals: list[float]) -> None:
    """Its first run is the direct call; where that reports success, the run ends at the same state."""
    system = Published(problem=problem)
    ours, theirs = Recorded(system), Recorded(system)
    start = system.start()
    solver = PetscSnes(line_search=search, tolerance=GOAL, iterations=MOST)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome, _ = run(ours, solver, None, start, Lapack(), stop=STOP)
    try:
        snes, state = called(theirs, start, search, goals[0])
    except PETSC_ERRORS:  # of an LU of PETSc's own with a zero pivot
        assert outcome.rows[-1]["step"] <= 1
        return
    # The driver looks at the start too, uncounted, before SNES does.
    looked = next(i for i, point in enumerate(ours.points) if (point != start).any()) - 1
    asked = ours.points[looked : looked + len(theirs.points)]
    if snes.getConvergedReason() > 0:
        alike = TOGETHER.get(problem, len(asked))
        size = np.abs(theirs.points).max()
        np.testing.assert_allclose(asked[:alike], theirs.points[:alike], rtol=1e-6, atol=1e-6 * size)
        assert outcome.rows[1]["reported_iterations"] == snes.getIterationNumber()
        assert outcome.rows[1]["reported_residuals"] == snes.getFunctionEvaluations()
        assert np.abs(np.array(asked) - state).max(axis=1).min() <= 1e-6 * np.abs(state).max()
    else:  # a way that ends nowhere parts by rounding; it begins alike
        np.testing.assert_allclose(asked[:2], theirs.points[:2], rtol=1e-6, atol=1e-9)
