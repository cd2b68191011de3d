"""Numbers of Python that overflow or are divided by zero in F: a status with a sentence, as with those of NumPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from nlsolve_solvers.external.scipy_root import ScipyRoot
from nlsolve_systems import Bratu

import nlsolve
from nlsolve import Status
from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.status import SolveError


def steep(u: Any) -> Any:
    """e^(x²) − 2 by the function of Python, which overflows beyond x = 27."""
    return np.array([math.exp(float(x) ** 2) - 2.0 for x in u])


def slope(u: Any) -> Any:
    return np.diag([2.0 * float(x) * math.exp(float(x) ** 2) for x in u])


def test_a_formula_that_overflows_has_no_value_there_and_says_why():
    problem = FormulaProblem(steep, 1, jacobian=slope)
    assert np.isnan(problem.residual(np.array([100.0]))).all()
    assert problem.undefined(np.array([100.0])).startswith(
        "F has no value here: OverflowError: math range error; choose"
    )
    assert problem.undefined(np.array([1.0])) == ""
    with pytest.raises(SolveError, match=r"jacobian\(u\) has no value here: OverflowError") as ending:
        problem.jacobian(np.array([100.0]))
    assert ending.value.status is Status.NON_FINITE


def test_a_series_that_overflows_is_refused_with_the_reason():
    problem = FormulaProblem(lambda u: u if isinstance(u, np.ndarray) else math.exp(1e3) * u, 2)
    assert np.isfinite(problem.residual(np.ones(2))).all()
    with pytest.raises(SolveError, match="F has no derivative here: OverflowError: math range error"):
        problem.jacobian(np.ones(2))
    with pytest.raises(SolveError, match="F has no series here: OverflowError: math range error"):
        problem.expand(np.ones(2))


def test_a_step_too_far_is_cut_short_where_the_method_can_and_a_status_where_it_cannot():
    """From x = 0.1 the first Newton step goes to x = 5.0, from 0.01 to 50, where e^(x²) is no number of Python."""
    cut = nlsolve.solve(steep, [0.01], jacobian=slope, solver={"kind": "newton"})
    assert cut.status is Status.CONVERGED
    assert cut.state == pytest.approx([math.sqrt(math.log(2.0))])
    full = nlsolve.solve(steep, [0.01], jacobian=slope, solver={"kind": "newton", "globalization": {"kind": "none"}})
    assert full.status is Status.OUT_OF_DOMAIN
    assert "math range error" in full.message


def test_a_start_where_a_formula_overflows_is_a_status():
    ended = nlsolve.solve(steep, [100.0], jacobian=slope, solver="newton")
    assert ended.status is Status.OUT_OF_DOMAIN
    assert "math range error" in ended.message


@pytest.mark.parametrize(
    "error", [OverflowError(34, "Numerical result out of range"), ZeroDivisionError("division by zero")]
)
def test_numbers_of_scipy_that_overflow_are_a_status(error: ArithmeticError, monkeypatch: pytest.MonkeyPatch):
    def fails(*arguments: Any, **options: Any) -> Any:
        raise error

    monkeypatch.setattr(scipy.optimize, "root", fails)
    system = Bratu(nodes=5)
    ended = nlsolve.solve(system, system.standard_start(), solver=ScipyRoot(method="broyden1"))
    assert ended.status is Status.NON_FINITE
    assert "scipy.optimize.root, broyden1: a number overflows or is divided by zero in its line search" in ended.message


@pytest.mark.parametrize("strength", [4.0, 5.0, 8.0])
def test_broyden_of_scipy_where_there_is_no_root_ends_in_a_status(strength: float):
    system = Bratu(nodes=63, strength=strength)
    ended = nlsolve.solve(system, system.standard_start(), solver=ScipyRoot(method="broyden1"))
    assert ended.status in (Status.STAGNATED, Status.NON_FINITE, Status.BUDGET_SPENT, Status.DIVERGED)
