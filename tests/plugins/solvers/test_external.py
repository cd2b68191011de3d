"""What SciPy, PETSc and KINSOL are asked for, what they report of it, and whether they do what ours do."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import PLAIN, near, run, spin_flow
from nlsolve_rules import Cubic
from nlsolve_rules.refresh import EveryIteration, EveryM, Never, PoorContraction
from nlsolve_solvers import Anderson, Newton, NewtonKrylov
from nlsolve_solvers.external import Kinsol, PetscSnes, ScipyRoot, kinsol, petsc_snes
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError

import nlsolve
from nlsolve import SolveError, Status
from nlsolve.algebra.formula import FormulaProblem
from nlsolve.algebra.measure import ByScale
from nlsolve.contracts.outcome import Outcome
from nlsolve.plugin import NonlinearSolver, RefreshRule
from nlsolve.results.columns import REPORTED
from nlsolve.solving.driver import solve
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_solver
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

needs_petsc = pytest.mark.skipif(petsc_snes.PETSc is None, reason="petsc4py is not installed: README says how")
needs_kinsol = pytest.mark.skipif(kinsol.kinsol is None, reason="sundials4py is not installed: README says how")

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
STOP = StoppingTest(tolerance=1e-8)
OBSERVED = {
    "reported_residuals": "residual",
    "reported_jacobians": "jacobian",
    "reported_factorizations": "factorization",
    "reported_triangular_solves": "triangular_solve",
}
NEWTON = Newton(globalization=Cubic())
MODIFIED = ModifiedNewton(globalization=Cubic())
SNES = (
    *(PetscSnes(line_search=search) for search in ("bt", "basic", "cp", "nleqerr")),
    PetscSnes(lag=2),
    PetscSnes(lag=2, persists=True),
    PetscSnes(lag=0),
    PetscSnes(linear="gmres"),
    PetscSnes(linear="gmres", lag_preconditioner=0),
    *(PetscSnes(method=method) for method in ("newtontr", "anderson", "ngmres", "qn")),
)
KINSOL = (
    *(Kinsol(strategy=strategy) for strategy in ("newton", "line-search", "picard", "fixed-point")),
    *(Kinsol(strategy=strategy, depth=0) for strategy in ("picard", "fixed-point")),
    Kinsol(setup_interval=1),
    Kinsol(linear="gmres"),
    Kinsol(strategy="line-search", linear="gmres", setup_interval=1),
)
PEERS = [
    *(pytest.param(solver, marks=needs_petsc, id=f"{number}") for number, solver in enumerate(SNES)),
    *(pytest.param(solver, marks=needs_kinsol, id=f"{number + 50}") for number, solver in enumerate(KINSOL)),
]


def reported(outcome: Outcome, name: str) -> float:
    """What all steps say together."""
    return sum(step[name] for step in outcome.rows if name in step)


# Where a library is absent.


@pytest.mark.parametrize(
    ("module", "name", "solver", "sentence"),
    [
        (petsc_snes, "PETSc", PetscSnes(), "needs petsc4py: pip install 'nlsolve[petsc]'"),
        (kinsol, "kinsol", Kinsol(), "needs sundials4py: pip install 'nlsolve[kinsol]'"),
    ],
)
def test_an_absent_library_is_a_row_with_the_way_out(
    module: Any, name: str, solver: NonlinearSolver, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, name, None)
    study = {
        "question": "does the rest run?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "mls"},
        "sweep": [{"grid": {"solver": [solver, {"kind": "newton"}]}}],
    }
    runs = nlsolve.run(study, tmp_path).runs
    assert list(runs["status"]) == ["not applicable", "converged"]
    assert sentence in runs["message"][0]
    assert "or choose another solver" in runs["message"][0]
    again: list[bool] = []
    nlsolve.run(study, tmp_path, listen=lambda event: again.append(event.resumed) if event.run is not None else None)
    assert again == [False, True]  # the library may have been installed since


# What is reported, and what was observed.


@pytest.mark.parametrize("method", ["krylov", "broyden1", "anderson", "df-sane"])
def test_scipy_reports_the_residuals_that_were_observed(method: Any) -> None:
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, ScipyRoot(method=method), PoorContraction(), near(flow, 0.52), stop=STOP)
    assert outcome.status is Status.CONVERGED
    assert len(outcome.rows) == 2
    assert reported(outcome, "reported_residuals") == ledger.counts["residual"] > 0


@pytest.mark.parametrize("precondition", [True, False])
def test_scipy_reports_one_jacobian_too_few(precondition: bool) -> None:
    """The one by which its shape is checked (SciPy issue 24767); SciPys in which that is mended report all."""
    solver = ScipyRoot(method="hybr", jacobian="products", precondition=precondition, tolerance=1e-12)
    outcome, ledger = run(ToyProblem(), solver, Never(), START, DenseLU())
    evaluated = ledger.counts["jacobian"] - ledger.counts["factorization"]
    assert outcome.status is Status.CONVERGED
    assert evaluated - reported(outcome, "reported_jacobians") in (1, 0)
    assert ledger.counts["matrix_product"] == 12 * evaluated
    assert ledger.counts["residual"] == reported(outcome, "reported_residuals")


def test_given_its_matrix_hybr_takes_fewer_residuals() -> None:
    counts = [
        run(ToyProblem(), ScipyRoot(method="hybr", jacobian=how), Never(), START, DenseLU())[1].counts["residual"]
        for how in ("differences", "products")
    ]
    assert counts[0] >= counts[1] + 12


def test_the_reports_of_a_march_are_summed_beside_the_counts() -> None:
    study = {
        "question": "what is reported?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}},
        "time": {"horizon": 3e-4},
        "motion": {"nodes": "lagrangian"},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "mls"},
        "sweep": [{"grid": {"solver": [{"kind": "scipy-root", "method": "anderson"}, {"kind": "newton"}]}}],
    }
    results = nlsolve.run(study)
    scipys, ours = results.runs.iloc[0], results.runs.iloc[1]
    assert scipys["reported_residuals"] == scipys["residuals"] > scipys["increments"] == 3
    assert scipys["reported_residuals"] == results.steps["reported_residuals"].sum()
    assert scipys[["reported_jacobians", "reported_factorizations"]].isna().all()
    assert ours[list(REPORTED)].isna().all()


def test_the_drivers_own_scale_costs_a_method_nothing() -> None:
    ledger = Ledger()
    flow = spin_flow(0.5)
    counted = CountedProblem(flow, ledger)
    start = near(flow, 0.52)
    counted.judged_by(ByScale(flow, flow.scale(start)), start)
    assert counted.scale(start.copy()) == flow.scale(start)
    assert ledger.counts["residual"] == 0
    assert counted.scale(2.0 * start) == flow.scale(2.0 * start)
    assert ledger.counts["residual"] == 1


@pytest.mark.parametrize("solver", PEERS)
def test_a_peer_reports_what_was_observed_with_a_new_tangent_each_time(solver: Any) -> None:
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, solver, EveryIteration(), near(flow, 0.52), stop=STOP)
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert len(outcome.rows) == 2
    said = [name for name in OBSERVED if name in outcome.rows[1]]
    assert "reported_residuals" in said
    for name in said:
        observed = ledger.counts[OBSERVED[name]]
        if name == "reported_jacobians" or (name == "reported_triangular_solves" and "factorization" not in said):
            assert reported(outcome, name) <= observed
        else:
            assert reported(outcome, name) == observed, name


@needs_petsc
def test_an_error_inside_snes_leaves_the_counts_of_later_runs_alone() -> None:
    """PETSc leaves an event open that an error ends, and counts it no more in that stage of its log."""
    singular = FormulaProblem(lambda u: u**2 - 2.0 * u, 1)
    failed, _ = run(singular, PetscSnes(), EveryIteration(), np.array([1.0]), stop=STOP)
    assert failed.status is Status.SINGULAR_TANGENT
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, PetscSnes(), EveryIteration(), near(flow, 0.52), stop=STOP)
    assert reported(outcome, "reported_factorizations") == ledger.counts["factorization"] > 0


@pytest.mark.parametrize("solver", PEERS)
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(), Never()], ids=lambda rule: rule.kind)
def test_every_peer_conforms_with_every_refresh_rule(solver: Any, rule: RefreshRule) -> None:
    check_solver(solver, rule)


@pytest.mark.parametrize("solver", PEERS)
def test_every_peer_finds_newtons_solution_of_the_spin(solver: Any) -> None:
    flow, tight = spin_flow(0.5), StoppingTest(tolerance=1e-11)  # below the tolerance of a run: several are needed
    outcome, _ = run(flow, solver, PoorContraction(), near(flow, 0.52), stop=tight)
    newton, _ = run(flow, Newton(), EveryIteration(), near(flow, 0.52), stop=tight)
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert np.linalg.norm(outcome.state - newton.state) <= 1e-8 * np.linalg.norm(newton.state)


# The same method is the same work.

TWINS = [
    (NEWTON, EveryIteration(), PetscSnes(degree=2), EveryIteration()),
    (NEWTON, EveryIteration(), Kinsol(strategy="line-search", setup_interval=1), EveryIteration()),
    (NEWTON, EveryIteration(), Kinsol(setup_interval=1), EveryIteration()),
    (MODIFIED, PoorContraction(limit=0.1), PetscSnes(degree=2), PoorContraction(limit=0.1)),
    (MODIFIED, PoorContraction(limit=0.1), Kinsol(setup_interval=1), PoorContraction(limit=0.1)),
    (MODIFIED, Never(), PetscSnes(degree=2, lag=0), EveryIteration()),
    (MODIFIED, Never(), Kinsol(setup_interval=1), Never()),
    (MODIFIED, EveryM(m=3), PetscSnes(degree=2, lag=3, persists=True), EveryIteration()),
    (Anderson(depth=3), Never(), PetscSnes(method="anderson", depth=3), Never()),
    (Anderson(depth=3), Never(), Kinsol(strategy="fixed-point", depth=3), Never()),
    (Anderson(depth=3), Never(), Kinsol(strategy="picard", depth=3), Never()),
    (Anderson(depth=0), Never(), Kinsol(strategy="fixed-point", depth=0), Never()),
]


@pytest.mark.parametrize(
    ("ours", "our_rule", "theirs", "their_rule"),
    [
        pytest.param(*twin, marks=needs_petsc if isinstance(twin[2], PetscSnes) else needs_kinsol, id=f"{number}")
        for number, twin in enumerate(TWINS)
    ],
)
def test_an_equal_strategy_takes_equal_steps(
    ours: NonlinearSolver, our_rule: RefreshRule, theirs: NonlinearSolver, their_rule: RefreshRule
) -> None:
    """Over three increments of a kind, with one K*: the same counts and, to rounding, the same states."""
    books, ends = [], []
    for solver, rule in ((ours, our_rule), (theirs, their_rule)):
        ledger, state = Ledger(), near(spin_flow(0.5), 0.52)
        tangent = Tangent(PLAIN, rule, ledger)
        for index in (0.5, 0.49, 0.47):
            outcome = solve(spin_flow(index), solver, tangent, state, STOP, Budget(), ledger)
            assert outcome.status is Status.CONVERGED, outcome.detail
            state = outcome.state
        books.append({kind: ledger.counts[kind] for kind in OBSERVED.values()})
        ends.append(state)
    assert books[0] == books[1]
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-9 * np.linalg.norm(ends[0]))


@pytest.mark.parametrize(
    "theirs",
    [
        pytest.param(PetscSnes(linear="gmres"), marks=needs_petsc, id="petsc"),
        pytest.param(Kinsol(strategy="line-search", linear="gmres", setup_interval=1), marks=needs_kinsol, id="kinsol"),
    ],
)
def test_an_inexact_newton_needs_as_many_iterations_as_ours(theirs: NonlinearSolver) -> None:
    flow = spin_flow(0.5)
    ours, _ = run(flow, NewtonKrylov(products="jacobian"), Never(), near(flow, 0.52), stop=STOP)
    outcome, ledger = run(flow, theirs, Never(), near(flow, 0.52), stop=STOP)
    assert abs(reported(outcome, "reported_iterations") - (len(ours.rows) - 1)) <= 1
    assert ledger.counts["factorization"] == 1
    assert ledger.counts["matrix_product"] >= ledger.counts["triangular_solve"]


# What goes wrong in a callback, or in a library.


class Constant(ToyProblem):
    """A residual that nothing changes."""

    def residual(self, u: Any) -> Any:
        return np.ones(12)


class Failing(ToyProblem):
    """A residual that is known at the start alone."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def residual(self, u: Any) -> Any:
        if np.array_equal(u, START):
            return super().residual(u)
        raise self.error


LIBRARIES = [
    pytest.param(PetscSnes(), "SNES, newtonls: DIVERGED_LINE_SEARCH", marks=needs_petsc, id="petsc"),
    pytest.param(
        Kinsol(strategy="line-search"), "KINSOL, line-search: KIN_LINESEARCH_NONCONV", marks=needs_kinsol, id="kinsol"
    ),
]


@pytest.mark.parametrize(("solver", "sentence"), LIBRARIES)
def test_a_failure_inside_a_library_is_a_status_with_its_word(solver: Any, sentence: str) -> None:
    outcome, _ = run(Constant(), solver, EveryIteration(), START, DenseLU())
    assert outcome.status is Status.STAGNATED
    assert outcome.detail == sentence


@pytest.mark.parametrize(("solver", "sentence"), LIBRARIES)
def test_a_status_found_in_a_callback_comes_through_the_library(solver: Any, sentence: str) -> None:
    failing = Failing(SolveError(Status.NON_FINITE, "no such state"))
    outcome, _ = run(failing, solver, EveryIteration(), START, DenseLU())
    assert (outcome.status, outcome.detail) == (Status.NON_FINITE, "no such state")


@pytest.mark.parametrize(("solver", "sentence"), LIBRARIES)
@pytest.mark.parametrize("error", [ValueError("a mistake of the program"), KeyboardInterrupt()], ids=["error", "stop"])
def test_so_does_any_other_exception(solver: Any, sentence: str, error: BaseException) -> None:
    with pytest.raises(type(error)):
        run(Failing(error), solver, EveryIteration(), START, DenseLU())


@pytest.mark.parametrize(("solver", "sentence"), LIBRARIES)
def test_a_residual_that_is_not_finite_is_a_status(solver: Any, sentence: str) -> None:
    class Broken(ToyProblem):
        def residual(self, u: Any) -> Any:
            return super().residual(u) if np.array_equal(u, START) else np.full(12, np.nan)

    outcome, ledger = run(Broken(), solver, EveryIteration(), START, DenseLU())
    assert outcome.status in (Status.NON_FINITE, Status.STAGNATED)
    assert outcome.detail
    assert ledger.counts["residual"] < 200


@needs_petsc
def test_a_snes_lives_as_long_as_its_tangent() -> None:
    ledger, problem = Ledger(), ToyProblem()
    tangent = Tangent(DenseLU(), EveryIteration(), ledger)
    for _ in range(2):
        solve(problem, PetscSnes(), tangent, START, STOP, Budget(), ledger)
        assert tangent in petsc_snes._kept
    kept = len(petsc_snes._kept)
    del tangent
    gc.collect()
    assert len(petsc_snes._kept) < kept


@pytest.mark.parametrize(
    ("component", "fields"),
    [
        (PetscSnes, {"method": "newton"}),
        (PetscSnes, {"lag": -1}),
        (PetscSnes, {"degree": 4}),
        (Kinsol, {"strategy": "newtonls"}),
        (Kinsol, {"setup_interval": 0}),
        (ScipyRoot, {"jacobian": "exact"}),
    ],
)
def test_nonsense_is_refused(component: type[Any], fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        component(**fields)
