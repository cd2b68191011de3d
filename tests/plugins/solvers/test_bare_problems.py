"""Every installed method on a problem that gives no series, or less; and what a method that needs more says of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from cases import run
from nlsolve_rules.refresh import AverageCost, EveryIteration, PoorContraction
from nlsolve_solvers import METHODS, Newton, NewtonKrylov, Picard
from nlsolve_solvers.external import Kinsol, PetscSnes, ScipyRoot, kinsol, petsc_snes
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod

from nlsolve import Status
from nlsolve.plugin import Expansion, NonlinearProblem, NonlinearSolver, RefreshRule, Series
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
ABSENT = {PetscSnes: petsc_snes.PETSc is None, Kinsol: kinsol.kinsol is None}
WITHOUT_SERIES = [
    pytest.param(
        method(), marks=pytest.mark.skipif(ABSENT.get(method, False), reason="not installed"), id=method().kind
    )
    for method in METHODS
    if method is not AsymptoticNumericalMethod
]


class NoExpansion(ToyProblem):
    """The toy problem as a stranger writes it who knows of no series."""

    expand = NonlinearProblem.expand  # type: ignore[assignment]


class ResidualOnly(NonlinearProblem):
    """The toy problem as one function."""

    def residual(self, u: Any) -> Any:
        return ToyProblem().residual(u)


class Bent(NonlinearProblem):
    """4 u + |u| = 1 with its Jacobian, in a formula that is not analytic."""

    def residual(self, u: Any) -> Any:
        return 4.0 * u + np.abs(u) - 1.0

    def jacobian(self, u: Any) -> Any:
        return sp.diags_array(4.0 + np.sign(u), format="csr")

    def expand(self, u: Any) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))


@pytest.mark.parametrize("solver", WITHOUT_SERIES)
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(), AverageCost()], ids=lambda rule: rule.kind)
def test_a_method_that_needs_no_series_solves_a_problem_without_one(solver: NonlinearSolver, rule: RefreshRule) -> None:
    outcome, ledger = run(NoExpansion(), solver, rule, START, DenseLU())
    assert outcome.status is Status.CONVERGED, outcome.detail
    np.testing.assert_allclose(outcome.state, ToyProblem.solution, atol=1e-9)
    assert ledger.counts["series_order"] == 0
    assert all(np.isfinite(row["contraction"]) for row in outcome.rows[1:])


@pytest.mark.parametrize("solver", [AsymptoticNumericalMethod(), NewtonKrylov(products="series")], ids=lambda s: s.kind)
def test_a_method_that_needs_a_series_says_so(solver: NonlinearSolver) -> None:
    outcome, _ = run(NoExpansion(), solver, EveryIteration(), START, DenseLU())
    assert outcome.status is Status.NOT_APPLICABLE
    assert outcome.detail == (
        "NoExpansion has no Taylor series of its residual: write the residual as one formula and run it on a Series in "
        "a method `expand`, or choose a method that needs no series, such as newton or anderson"
    )


@pytest.mark.parametrize("solver", [AsymptoticNumericalMethod(), NewtonKrylov(products="series")], ids=lambda s: s.kind)
def test_a_method_that_needs_a_series_says_that_the_formula_has_none(solver: NonlinearSolver) -> None:
    outcome, _ = run(Bent(), solver, EveryIteration(), np.array([2.0, -1.0]), DenseLU())
    assert outcome.status is Status.NOT_APPLICABLE
    assert outcome.detail.startswith("the formula of Bent has no Taylor series: absolute value")
    found, _ = run(Bent(), Newton(), EveryIteration(), np.array([2.0, -1.0]), DenseLU())
    np.testing.assert_allclose(found.state, 0.2, atol=1e-12)


def test_products_are_by_series_where_there_is_one_and_by_jacobian_elsewhere() -> None:
    for chosen, problem in (("series", ToyProblem()), ("jacobian", NoExpansion())):
        auto, counted = run(problem, NewtonKrylov(), PoorContraction(), START, DenseLU())
        named, expected = run(problem, NewtonKrylov(products=chosen), PoorContraction(), START, DenseLU())
        assert counted.counts == expected.counts
        np.testing.assert_array_equal(auto.state, named.state)


@pytest.mark.parametrize("solver", [Newton(), NewtonKrylov(), ScipyRoot()], ids=lambda solver: solver.kind)
def test_a_method_that_needs_a_jacobian_says_so(solver: NonlinearSolver) -> None:
    outcome, _ = run(ResidualOnly(), solver, EveryIteration(), START, DenseLU())
    assert outcome.status is Status.NOT_APPLICABLE
    assert outcome.detail.startswith("ResidualOnly has no Jacobian: define its method `jacobian`")


def test_picard_says_that_it_needs_a_secant_matrix() -> None:
    outcome, _ = run(ResidualOnly(), Picard(), EveryIteration(), START, DenseLU())
    assert outcome.status is Status.NOT_APPLICABLE
    assert "has no secant matrix" in outcome.detail


@pytest.mark.parametrize("method", ["krylov", "broyden1", "anderson", "df-sane", "hybr"])
def test_a_residual_is_all_that_scipy_needs_without_a_preconditioner(method: Any) -> None:
    solver = ScipyRoot(method=method, precondition=False, tolerance=1e-12, iterations=500)  # it is called once
    outcome, ledger = run(ResidualOnly(), solver, EveryIteration(), START, DenseLU())
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert ledger.counts["factorization"] == ledger.counts["jacobian"] == 0
