"""`scipy-root` is what a caller of scipy.optimize.root has: the same points, values and claims, problem by problem."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from cases import Recorded, run
from nlsolve_solvers.external import ScipyRoot
from nlsolve_systems import Published
from nlsolve_systems.catalogue import PROBLEMS

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.status import Status
from nlsolve.series import Array
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

STOP = StoppingTest(kind="absolute", tolerance=1e-9)
GOAL = 1e-8
ITERATIVE: dict[str, dict[str, Any]] = {
    "krylov": {"fatol": GOAL, "tol_norm": np.linalg.norm, "maxiter": 50},
    "broyden1": {"fatol": GOAL, "tol_norm": np.linalg.norm, "maxiter": 50},
    "anderson": {"fatol": GOAL, "tol_norm": np.linalg.norm, "maxiter": 50},
    "df-sane": {"fatol": GOAL, "ftol": 0.0, "fnorm": np.linalg.norm, "maxfev": 50},
}
OPTIONS = {"hybr": {"xtol": 1e-8, "maxfev": 0}, **ITERATIVE}


def called(problem: Recorded, start: Array, method: str) -> Any:
    """scipy.optimize.root as anyone calls it; None where it raises."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return scipy.optimize.root(problem.residual, start, method=method, options=OPTIONS[method])
        except ValueError:
            return None


def assert_the_same(system: Published, method: Any) -> None:
    ours, theirs = Recorded(system), Recorded(system)
    start = system.start()
    found = called(theirs, start, method)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome, ledger = run(ours, ScipyRoot(method=method, precondition=False), None, start, stop=STOP)
    if outcome.iterations == 0:  # solved at the start, or refused by SciPy
        assert found is None or np.array_equal(found.x, start)
        return
    assert found is not None
    # The driver looks at the start and at the state that SciPy ends at, uncounted; the rest is what SciPy asks for.
    asked = ours.points[1 : 1 + ledger.counts["residual"]]
    assert len(theirs.points) == ledger.counts["residual"]
    np.testing.assert_array_equal(np.array(asked), np.array(theirs.points))
    np.testing.assert_array_equal(outcome.state, found.x)
    last = outcome.rows[1]
    for name, counter in (("reported_residuals", "nfev"), ("reported_iterations", "nit")):
        if counter in found:
            assert last[name] == found[counter]
    solved = outcome.residual_absolute <= STOP.tolerance
    assert outcome.converged == solved
    assert outcome.claimed_wrongly == (bool(found.success) and not solved)
    assert outcome.denied_wrongly == (not found.success and solved)
    if not solved and np.isfinite(outcome.residual_norm):
        assert outcome.status is Status.STAGNATED
        assert outcome.detail.startswith(f"scipy.optimize.root, {method}, ")
        assert ("reports success" in outcome.detail) == bool(found.success)


@pytest.mark.parametrize("factor", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_hybr_asks_for_the_same_points_and_claims_the_same(problem: str, factor: float) -> None:
    assert_the_same(Published(problem=problem, factor=factor), "hybr")


@pytest.mark.parametrize("method", ITERATIVE)
@pytest.mark.parametrize(
    "problem", ["extended-rosenbrock", "powell-singular", "helical-valley", "trigonometric", "wood"]
)
def test_so_do_the_iterative_methods(problem: str, method: str) -> None:
    assert_the_same(Published(problem=problem), method)


@pytest.mark.parametrize(("size", "unit"), [(1.0, 1.0), (1e3, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1.0, 1e9)])
def test_in_any_unit_scipy_ends_where_its_caller_ends(size: float, unit: float) -> None:
    problem = FormulaProblem(lambda u: size * ((u / unit) ** 2 - 2.0), 1)
    start = np.array([unit])
    found = scipy.optimize.root(problem.residual, start, method="hybr", options=OPTIONS["hybr"])
    outcome, _ = run(
        problem, ScipyRoot(method="hybr", precondition=False), None, start, stop=StoppingTest(tolerance=1e-8)
    )
    assert (outcome.status, outcome.state[0]) == (Status.CONVERGED, found.x[0])
    assert outcome.rows[1]["reported_residuals"] == found.nfev


def test_scipys_false_claim_stands_in_its_column() -> None:
    """x² − 2x from 1, where F′ = 0: hybr ends there, in its own words."""
    problem = FormulaProblem(lambda u: u**2 - 2.0 * u, 1)
    start = np.array([1.0])
    found = scipy.optimize.root(problem.residual, start, method="hybr", options=OPTIONS["hybr"])
    outcome, _ = run(problem, ScipyRoot(method="hybr", precondition=False), None, start, stop=STOP)
    np.testing.assert_array_equal(outcome.state, found.x)
    assert outcome.claimed_wrongly == (bool(found.success) and not outcome.converged)
    assert outcome.converged or outcome.detail.startswith("scipy.optimize.root, hybr, ")


@pytest.mark.parametrize("method", ["krylov", "broyden1", "anderson"])
def test_with_a_matrix_scipy_has_the_preconditioned_residual_of_its_caller(method: Any) -> None:
    """The first run is root(y ↦ R(u + K*⁻¹ y), 0) with the options that the wrapper documents."""
    problem, start = ToyProblem(), ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
    jacobian = problem.jacobian(start)
    matrix = jacobian if isinstance(jacobian, np.ndarray) else jacobian.toarray()
    factors = DenseLU().factorize(jacobian)
    options = {"fatol": GOAL, "tol_norm": np.linalg.norm, "maxiter": 50}
    if method != "krylov":
        options["jac_options"] = {"alpha": -1.0}
    assert matrix.shape == (12, 12)
    found = scipy.optimize.root(
        lambda y: problem.residual(start + (factors.solve(y) if y.any() else y)),
        np.zeros(12),
        method=method,
        options=options,
    )
    outcome, _ = run(problem, ScipyRoot(method=method), None, start, DenseLU(), stop=StoppingTest(tolerance=1e-6))
    np.testing.assert_array_equal(outcome.rows[1]["reported_iterations"], found.nit)
    np.testing.assert_allclose(outcome.state, start + factors.solve(found.x), rtol=1e-14)
