"""`nlsolve.solve` and `nlsolve.compare`: problems and components in every form they may have, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
import scipy.sparse as sp
from nlsolve_laws import PowerLaw
from nlsolve_linear import Lapack
from nlsolve_rules import EveryM
from nlsolve_solvers import Newton
from nlsolve_systems import Bratu, Published

import nlsolve
from nlsolve.algebra.formula import FormulaProblem
from nlsolve.plugin import NonlinearProblem, NonlinearSolver, Step, System
from nlsolve.results.columns import RUNS
from nlsolve.solving.stopping import Budget, StoppingTest

START = [3, -1, 0, 1]
POWELL = Published(problem="powell-singular")


def powell(u: Any) -> Any:
    a, b, c, d = u
    return np.array([a + 10 * b, 5**0.5 * (c - d), (b - 2 * c) ** 2, 10**0.5 * (a - d) ** 2])


def laplacian(size: int) -> Any:
    return sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(size, size)).tocsr()


def chain(u: Any) -> Any:
    return laplacian(len_of(u)) @ u + np.sinh(u) - np.ones(len_of(u))


def len_of(u: Any) -> int:
    return int(u.shape[0])


class Half(NonlinearSolver):
    """Newton's direction at a fixed length; a class of this file that nobody has installed."""

    kind: Literal["half"] = "half"
    length: float = 0.5

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start
        for step in Newton().steps(problem, tangent, start):
            yield Step(state + self.length * (step.state - state))
            state = step.state


class Broken(Half):
    """It divides by zero."""

    kind: Literal["broken"] = "broken"  # type: ignore[assignment]

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        yield Step(start)
        raise ZeroDivisionError("by a method")


class Plain(NonlinearProblem):
    """u² = 2, with all that the contract asks for."""

    def __init__(self) -> None:
        self._formula = FormulaProblem(lambda u: u**2 - 2.0, 1)

    def residual(self, u: Any) -> Any:
        return self._formula.residual(u)

    def jacobian(self, u: Any) -> Any:
        return self._formula.jacobian(u)

    def expand(self, u: Any) -> Any:
        return self._formula.expand(u)


# What may be asked for.


def test_powells_singular_function():
    outcome = nlsolve.solve(powell, START)
    assert outcome.status is nlsolve.Status.CONVERGED
    assert outcome.residual_norm <= 1e-8
    assert np.linalg.norm(powell(outcome.state)) == pytest.approx(outcome.residual_absolute)
    assert outcome.newton_correction <= 1e-6
    assert np.abs(outcome.state).max() < 1e-3
    same = nlsolve.solve(POWELL)
    np.testing.assert_allclose(outcome.state, same.state, rtol=1e-6)
    assert dict(outcome.counts) == dict(same.counts)


def test_an_outcome_knows_its_work():
    outcome = nlsolve.solve(powell, START, "newton", linear="lapack")
    k = outcome.iterations
    assert outcome.counts["factorizations"] == outcome.counts["tangents"] == outcome.counts["jacobians"] == k
    assert outcome.counts["triangular_solves"] == k
    assert outcome.counts["residuals"] == k + 1
    assert outcome.seconds["jacobian"] > 0.0
    assert min(outcome.seconds.values()) >= 0.0
    assert sum(outcome.seconds.values()) == pytest.approx(outcome.steps["seconds"].iloc[-1], rel=0.5)
    assert outcome.steps["residual_norm"].iloc[-1] == outcome.residual_norm


@pytest.mark.parametrize("problem", [Plain(), lambda u: u**2 - 2.0, lambda u: [u[0] ** 2 - 2]])
@pytest.mark.parametrize("solver", ["newton", "anm", "newton-krylov", {"kind": "anm", "order": 6}, Half(), "robust"])
def test_problems_and_methods_of_every_form(problem, solver):
    outcome = nlsolve.solve(problem, [1], solver, stop={"tolerance": 1e-10})
    assert outcome.status is nlsolve.Status.CONVERGED, outcome
    np.testing.assert_allclose(outcome.state, [np.sqrt(2.0)], rtol=1e-9)


def test_components_of_every_form():
    given = {"linear": Lapack(), "refresh": EveryM(m=2), "stop": StoppingTest(tolerance=1e-5), "budget": Budget()}
    tables = {
        "linear": "lapack",
        "refresh": {"kind": "every-m", "m": 2},
        "stop": {"tolerance": 1e-5},
        "budget": {"iterations": 200},
    }
    instances, named = (nlsolve.solve(powell, START, "newton", **parts) for parts in (given, tables))
    np.testing.assert_array_equal(instances.state, named.state)
    assert dict(instances.counts) == dict(named.counts)
    assert instances.counts["factorizations"] < instances.iterations
    short = nlsolve.solve(powell, START, "newton", budget={"iterations": 2})
    assert (short.status, short.iterations) == (nlsolve.Status.BUDGET_SPENT, 2)


def test_a_solver_without_a_rule_gets_its_own():
    kept = nlsolve.solve(powell, START, "modified-newton", linear="lapack")
    assert kept.counts["factorizations"] < kept.iterations


def test_a_pattern_and_a_jacobian():
    start = np.zeros(40)
    plain = nlsolve.solve(chain, start)
    coloured = nlsolve.solve(chain, start, pattern=laplacian(40))
    given = nlsolve.solve(chain, start, jacobian=lambda u: laplacian(40) + sp.diags_array(np.cosh(u)))
    for outcome in (coloured, given):
        np.testing.assert_allclose(outcome.state, plain.state, rtol=1e-12)
        assert dict(outcome.counts) == dict(plain.counts)


def test_a_system_is_held_against_its_known_roots():
    outcome = nlsolve.solve(Published(problem="freudenstein-roth"), [5, 4.5], "newton")
    assert outcome.status is nlsolve.Status.CONVERGED
    lower = nlsolve.solve(Bratu(nodes=8))
    assert lower.status is nlsolve.Status.CONVERGED

    class OneKnown(Bratu):
        def roots(self) -> Any:
            return 1.0 + super().roots()

    assert nlsolve.solve(OneKnown(nodes=8)).status is nlsolve.Status.OTHER_ROOT


def test_a_start_is_left_alone():
    start = np.array([3.0, -1.0, 0.0, 1.0])
    nlsolve.solve(powell, start)
    np.testing.assert_array_equal(start, START)


# What turns out during solving.


@pytest.mark.parametrize("solver", ["robust", "newton", "anm"])
def test_no_jacobian_where_one_is_needed_is_an_outcome(solver):
    outcome = nlsolve.solve(lambda u: np.abs(u) - 1.0, [2.0, 3.0], solver)
    assert outcome.status is nlsolve.Status.NOT_APPLICABLE
    assert "power series, and F does not run on one" in outcome.message
    assert "are not analytic" in outcome.message


def test_a_jacobian_by_hand_is_enough_but_for_a_series():
    parts = {"start": [2.0, 3.0], "jacobian": lambda u: np.diag(np.sign(u))}
    assert nlsolve.solve(lambda u: np.abs(u) - 1.0, **parts).status is nlsolve.Status.CONVERGED
    series = nlsolve.solve(lambda u: np.abs(u) - 1.0, solver="anm", **parts)
    assert series.status is nlsolve.Status.NOT_APPLICABLE
    assert "choose a method that asks for residuals and Jacobians only, such as newton" in series.message


def test_the_way_out_that_is_told_is_one():
    outcome = nlsolve.solve(lambda u: np.abs(u) - 1.0, [2.0, 3.0], {"kind": "scipy-root", "precondition": False})
    assert outcome.status is nlsolve.Status.CONVERGED
    assert outcome.counts["jacobians"] == 0


# What cannot be asked for.


def one_sentence(match: str, *arguments: Any, **parts: Any) -> None:
    with pytest.raises(nlsolve.InputError, match=re.escape(match)) as refused:
        nlsolve.solve(*arguments, **parts)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("nlsolve.solve: ")


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ({"solver": "newtn"}, "solver.kind = 'newtn': no such solver; did you mean 'newton'?"),
        ({"solver": PowerLaw(index=0.5)}, "solver: PowerLaw is a law, where a solver belongs; installed: anderson"),
        ({"solver": Newton}, "Newton is a class: give an instance of it, such as Newton()"),
        ({"solver": 3}, 'solver = 3: should be a table with a kind, like { kind = "…" }, or an instance'),
        ({"solver": {"kind": "anm", "ordr": 3}}, "solver.ordr = 3: no such field; did you mean 'order'?"),
        ({"solver": {"order": 3}}, "solver.kind: required, and missing; installed: anderson"),
        ({"linear": "superl"}, "linear.kind = 'superl': no such linear; did you mean 'superlu'?"),
        ({"refresh": Newton()}, "Newton is a solver, where a refresh belongs; installed: average-cost"),
        ({"stop": {"tolerance": -1}}, "stop.tolerance = -1: should be greater than 0"),
        ({"stop": {"kind": "claim"}}, "stop.kind = 'claim': the solver 'robust' never claims a solution"),
        ({"budget": {"iteration": 3}}, "budget.iteration = 3: no such field; did you mean 'iterations'?"),
    ],
)
def test_components_that_are_none(parts, sentence):
    one_sentence(sentence, powell, START, **parts)


@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        ([1.0, np.nan, 0.0, 1.0], "start[1] = nan: should be a finite number"),
        ([START], "start = [[3, -1, 0, 1]]: has shape (1, 4): should have shape (U,); flatten it"),
        (3.0, "start = 3.0: has shape (): should have shape (U,); write [u] for one unknown"),
        ([], "start = []: has shape (0,): should have shape (U,)"),
        (["a", "b"], "start = ['a', 'b']: should be real numbers, one for each unknown"),
        ([1, 2j], "start = [1, 2j]: should be real numbers, one for each unknown"),
        ([[1], [1, 2]], "start = [[1], [1, 2]]: should be real numbers, one for each unknown"),
        (None, "start = None: should be real numbers, one for each unknown"),
    ],
)
def test_starts_that_are_none(start, sentence):
    one_sentence(sentence, powell, start)


@pytest.mark.parametrize(
    ("problem", "sentence"),
    [
        (lambda u: u[:1], "problem: F(start) = array([3.]): should be real numbers of shape (4,), and has shape (1,)"),
        (lambda u: None, "problem: F(start) = None: should be real numbers of shape (4,); does the function return"),
        (lambda u: 1j * u, "should be real numbers of shape (4,); make real and imaginary parts unknowns of their own"),
        (lambda u: "abcd", "problem: F(start) = 'abcd': should be real numbers of shape (4,), not str"),
        (Bratu, "is a class: give an instance of it, such as Bratu(…)"),
        (np.eye(4), "problem: should be a function F(u), a System or a NonlinearProblem"),
        (Bratu(nodes=8), "start = [3, -1, 0, 1]: has 4 numbers: this system has 8 unknowns"),
        (Plain, "is a class: give an instance of it, such as Plain(…)"),
    ],
)
def test_problems_that_are_none(problem, sentence):
    one_sentence(sentence, problem, START)


def test_a_shape_that_changes_on_the_way_is_refused_too():
    calls = 0

    def formula(u: Any) -> Any:
        nonlocal calls
        calls += 1
        return u if calls == 1 else u[:1]

    with pytest.raises(nlsolve.InputError, match=r"F\(u\) = array\(\[3\.\]\): should be real numbers of shape \(4,\)"):
        nlsolve.solve(formula, START)


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ({"pattern": np.eye(3)}, "pattern: has shape (3, 3): should be a matrix of shape (4, 4)"),
        ({"pattern": 3}, "pattern = 3: has shape (): should be a matrix of shape (4, 4)"),
        ({"pattern": np.eye(4)}, "pattern: row 0 of the Jacobian differs from zero outside of it: add the missing"),
        ({"pattern": np.zeros((4, 4))}, "of the Jacobian differs from zero outside of it: add the missing entries"),
        ({"jacobian": np.eye(4)}, "jacobian: should be a function of u that returns the (U, U) matrix J(u)"),
    ],
)
def test_patterns_and_jacobians_that_are_none(parts, sentence):
    one_sentence(sentence, powell, START, **parts)


def test_a_problem_with_a_jacobian_of_its_own_takes_no_other():
    one_sentence("pattern: is for a function F(u); a Bratu has its own", Bratu(nodes=8), pattern=np.eye(8))
    one_sentence("is for a function F(u); a Plain has its own", Plain(), [1.0], jacobian=np.diag)


def test_a_jacobian_of_the_wrong_shape_is_refused_where_it_is_asked_for():
    with pytest.raises(nlsolve.InputError, match=r"jacobian\(u\): should be real numbers of shape \(4, 4\), and has"):
        nlsolve.solve(powell, START, jacobian=lambda u: np.eye(3))


def test_what_a_function_raises_is_its_own():
    def formula(u: Any) -> Any:
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        nlsolve.solve(formula, START)
    with pytest.raises(ZeroDivisionError, match="by a method"):
        nlsolve.solve(powell, START, Broken())


def test_a_division_by_zero_in_a_function_is_a_status():
    outcome = nlsolve.solve(lambda u: [1.0 / float(u[0] - START[0]), *u[1:]], START, "broyden")
    assert not outcome.converged
    assert "division by zero" in outcome.message


# Several methods.


def test_a_row_a_strategy():
    solvers = ["newton", {"kind": "anm", "order": 15}, Half(length=1.0), {"kind": "newton", "globalization": NONE}]
    frame = nlsolve.compare(powell, START, solvers)
    assert frame["solver"].tolist() == [
        "newton",
        "anm, order = 15",
        "half, length = 1.0",
        "newton, globalization = none",
    ]
    assert frame["status"].tolist() == ["converged"] * 4
    assert list(frame.columns) == ["solver", *(name for name in RUNS if name in frame)]
    newton = nlsolve.solve(powell, START, "newton")
    for name in ("factorizations", "triangular_solves", "jacobians", "residuals", "matrix_products"):
        assert frame[name].iloc[0] == newton.counts[name]
    assert frame["iterations"].iloc[0] == newton.iterations
    assert frame["residual_norm"].iloc[0] == newton.residual_norm
    assert not {"root_error", "nodes", "time", "seconds_operators"} & set(frame.columns)


NONE = {"kind": "none"}


def test_strategies_have_the_names_that_are_given():
    full = {"newton, full steps": {"kind": "newton", "globalization": NONE}, "mine": Half()}
    frame = nlsolve.compare(powell, START, full, stop={"tolerance": 1e-4})
    assert frame["solver"].tolist() == ["newton, full steps", "mine"]


def test_a_method_that_fails_or_crashes_is_a_row():
    frame = nlsolve.compare(lambda u: np.abs(u) - 1.0, [2.0, 3.0], ["newton", Broken(), "scipy-root"])
    assert frame["status"].tolist() == ["not applicable", "crashed", "not applicable"]
    assert "are not analytic" in frame["message"].iloc[0]
    assert frame["message"].iloc[1].startswith("ZeroDivisionError: by a method (")
    assert "test_interactive.py:" in frame["message"].iloc[1]


def test_the_rows_of_a_system_tell_how_near_its_root_is():
    frame = nlsolve.compare(POWELL, solvers=["newton", "broyden"])
    assert (frame["root_error"] < 1e-2).all()
    assert frame["root_singular"].all()


@pytest.mark.parametrize(
    ("solvers", "sentence"),
    [
        ("newton", "solvers = 'newton': should be a list or a dictionary of them"),
        ([], "solvers = []: should be a list or a dictionary of them"),
        ({"kind": "newton"}, "solvers = {'kind': 'newton'}: should be a list or a dictionary of them"),
        (Newton(), "should be a list or a dictionary of them"),
        (["newton", "newtn"], "solver.kind = 'newtn': no such solver; did you mean 'newton'?"),
    ],
)
def test_strategies_that_are_none(solvers, sentence):
    with pytest.raises(nlsolve.InputError, match=re.escape(sentence)):
        nlsolve.compare(powell, START, solvers)


def test_a_mistake_of_the_caller_is_no_row():
    with pytest.raises(nlsolve.InputError, match=r"jacobian\(u\)"):
        nlsolve.compare(powell, START, ["newton"], jacobian=lambda u: np.eye(3))


def test_a_system_of_this_file_is_solved_like_any_other():
    class Square(System):
        kind: Literal["square"] = "square"

        def formula(self, u: Any) -> Any:
            return u**2 - 2.0

        def standard_start(self) -> Any:
            return np.ones(1)

    assert nlsolve.solve(Square()).state[0] == pytest.approx(np.sqrt(2.0))
