"""F(u) = 0 from Python: one solve, or the same problem under several strategies, without a study file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from nlsolve.algebra.formula import NUMBERS, FormulaProblem, real
from nlsolve.algebra.simulation import judged
from nlsolve.contracts.component import Component
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import InputError, SolveError
from nlsolve.contracts.system import System
from nlsolve.registry.problems import Problem, Source, problems_in
from nlsolve.registry.registry import load_registry
from nlsolve.results.columns import RUNS
from nlsolve.series import Array
from nlsolve.solving import driver
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.summary import crashed, row_of
from nlsolve.solving.tangent import Tangent
from nlsolve.study.case import claims_missing

Given = str | Mapping[str, Any] | Component
"""A component by its kind, as a table with its kind and parameters, or as an instance, installed or not."""

Formula = Callable[[Any], Any]

OUTSIDE = 1e-6
"""Part of J w that a pattern may miss: rounding."""


def solve(
    problem: Formula | System | NonlinearProblem,
    start: ArrayLike | None = None,
    solver: Given = "robust",
    *,
    linear: Given = "superlu",
    refresh: Given | None = None,
    stop: Mapping[str, Any] | StoppingTest | None = None,
    budget: Mapping[str, Any] | Budget | None = None,
    pattern: Any | None = None,
    jacobian: Formula | None = None,
) -> Outcome:
    """u with F(u) = 0, from `start` on.

    problem : F, a function of arrays (U,) -> (U,), whose Jacobian comes from the formula itself; or a `System`, or a
        `NonlinearProblem`.
    start : u_0, (U,); a system has its own.
    solver, linear, refresh : by kind ("newton"), with parameters ({"kind": "anm", "order": 15}), or as instances;
        without `refresh` the solver's own rule for renewing its tangent.
    stop, budget : such as {"tolerance": 1e-10} and {"iterations": 50}.
    pattern : of a function: where its Jacobian may differ from zero, sparse (U, U), so that it costs a few columns.
    jacobian : of a function: u -> J(u), dense or sparse (U, U), for one that is not analytic.

    However the solve ends, the `Outcome` says so. Raises InputError for what cannot be asked for.
    """
    posed = _posed("nlsolve.solve", problem, start, pattern, jacobian)
    return _run(posed, _strategy("nlsolve.solve", solver, linear, refresh, stop, budget))[0]


def compare(
    problem: Formula | System | NonlinearProblem,
    start: ArrayLike | None = None,
    solvers: Iterable[Given] | Mapping[str, Given] = (),
    *,
    linear: Given = "superlu",
    refresh: Given | None = None,
    stop: Mapping[str, Any] | StoppingTest | None = None,
    budget: Mapping[str, Any] | Budget | None = None,
    pattern: Any | None = None,
    jacobian: Formula | None = None,
) -> pd.DataFrame:
    """The same problem from the same start under each of `solvers`: a row each, with the columns of `runs` that apply.

    `solvers` is a list, or a dictionary that names them: {"full steps": {"kind": "newton", "globalization": …}}. The
    first column, `solver`, holds the names. All else is as in `solve`. A method that fails, or crashes, is a row that
    says so. Raises InputError for what cannot be asked for.
    """
    caller = "nlsolve.compare"
    posed = _posed(caller, problem, start, pattern, jacobian)
    if isinstance(solvers, str | Component) or not solvers or (isinstance(solvers, Mapping) and "kind" in solvers):
        raise _wrong(caller, "solvers", solvers, 'should be a list or a dictionary of them, such as ["newton", "anm"]')
    named = solvers if isinstance(solvers, Mapping) else None
    chosen = [
        _strategy(caller, solver, linear, refresh, stop, budget)
        for solver in (solvers if named is None else named.values())
    ]
    names = [_label(strategy.solver) for strategy in chosen] if named is None else list(named)
    rows = [{"solver": name, **_row(posed, strategy)} for name, strategy in zip(names, chosen, strict=True)]
    frame = pd.DataFrame(rows, columns=["solver", *RUNS])
    return frame.drop(columns=[name for name in RUNS if frame[name].isna().all()])


@dataclass(frozen=True)
class _Posed:
    """A problem and where its solution is sought; the system it came from, if any."""

    problem: NonlinearProblem
    start: Array
    system: System | None = None


@dataclass(frozen=True)
class _Strategy:
    """What solves it, and when that stops."""

    solver: NonlinearSolver
    linear: LinearSolver
    refresh: RefreshRule
    stop: StoppingTest
    budget: Budget


def _run(posed: _Posed, strategy: _Strategy) -> tuple[Outcome, dict[str, Any]]:
    """One solve with books of its own, and its row of `runs`."""
    ledger = Ledger()
    tangent = Tangent(strategy.linear, strategy.refresh, ledger)
    outcome = driver.solve(posed.problem, strategy.solver, tangent, posed.start, strategy.stop, strategy.budget, ledger)
    judgement: dict[str, Any] = {}
    if posed.system is not None:
        with np.errstate(all="ignore"):
            outcome, judgement = judged(posed.system, posed.problem, outcome, strategy.linear)
    return outcome, row_of(outcome, ledger, tangent) | judgement


def _row(posed: _Posed, strategy: _Strategy) -> dict[str, Any]:
    """The row of one strategy; whatever it raises becomes a row too, but for the caller's mistakes."""
    try:
        return _run(posed, strategy)[1]
    except InputError:
        raise
    except Exception as error:  # as in a study: a method of one's own may raise anything
        return crashed(error)


def _label(component: Component) -> str:
    """The kind, and the parameters that were chosen: anm, order = 15."""
    words = [component.kind_name()]
    for name, field in type(component).model_fields.items():
        value = getattr(component, name)
        if name != "kind" and name in component.model_fields_set and value != field.default:
            words.append(f"{name} = {_label(value) if isinstance(value, Component) else value}")
    return ", ".join(words)


# What is asked for, checked.


def _wrong(caller: str, place: str, value: object, expected: str) -> InputError:
    return InputError(Problem((place,), value, expected).sentence(Source(caller)))


def _posed(caller: str, problem: Any, start: Any, pattern: Any, jacobian: Any) -> _Posed:
    """The problem and its start. Raises InputError where one of them is none, or where they do not belong together."""
    if isinstance(problem, type):
        raise _wrong(caller, "problem", problem, f"is a class: give an instance of it, such as {problem.__name__}(…)")
    if not isinstance(problem, System | NonlinearProblem):
        if not callable(problem):
            raise _wrong(caller, "problem", problem, "should be a function F(u), a System or a NonlinearProblem")
        return _of_formula(caller, problem, _start(caller, start), pattern, jacobian)
    for name, given in (("pattern", pattern), ("jacobian", jacobian)):
        if given is not None:
            raise _wrong(caller, name, given, f"is for a function F(u); a {type(problem).__name__} has its own")
    if isinstance(problem, System):
        own = problem.start()
        begun = own if start is None else _start(caller, start)
        if begun.shape != own.shape:
            raise _wrong(caller, "start", start, f"has {len(begun)} numbers: this system has {len(own)} unknowns")
        posed = _Posed(FormulaProblem.of(problem), begun, problem)
    else:
        posed = _Posed(problem, _start(caller, start))
    _check_residual(caller, posed.problem.residual, posed.start)
    return posed


def _start(caller: str, start: Any) -> Array:
    """u_0, (U,)."""
    if start is None:
        raise _wrong(caller, "start", start, "should be real numbers, one for each unknown")
    try:
        array = np.asarray(start)
    except ValueError as error:  # lists of several lengths
        raise _wrong(caller, "start", start, "should be real numbers, one for each unknown") from error
    if array.dtype.kind not in NUMBERS:
        raise _wrong(caller, "start", start, "should be real numbers, one for each unknown")
    if array.ndim != 1 or not array.size:
        way_out = "flatten it, and let F take it apart again" if array.size > 1 else "write [u] for one unknown"
        raise _wrong(caller, "start", start, f"has shape {array.shape}: should have shape (U,); {way_out}")
    if not np.isfinite(array).all():
        place = int(np.flatnonzero(~np.isfinite(array))[0])
        raise _wrong(caller, f"start[{place}]", float(array[place]), "should be a finite number")
    return array.astype(float)


def _check_residual(caller: str, residual: Formula, start: Array) -> None:
    """F at the start is a (U,) array of numbers; whether these are finite is for the driver to tell."""
    try:
        with np.errstate(all="ignore"):
            real(residual(start.copy()), start.shape, "F(start)")
    except InputError as error:
        raise InputError(f"{caller}: problem: {error}") from error


def _of_formula(caller: str, formula: Formula, start: Array, pattern: Any, jacobian: Any) -> _Posed:
    _check_residual(caller, formula, start)
    if jacobian is not None and not callable(jacobian):
        raise _wrong(caller, "jacobian", jacobian, "should be a function of u that returns the (U, U) matrix J(u)")
    size = len(start)
    if pattern is not None and np.shape(pattern) != (size, size):
        expected = f"has shape {np.shape(pattern)}: should be a matrix of shape {(size, size)}"
        raise _wrong(caller, "pattern", pattern, expected)
    problem = FormulaProblem(formula, size, pattern, jacobian)
    if pattern is not None and jacobian is None:
        _check_pattern(caller, problem, FormulaProblem(formula, size), start)
    return _Posed(problem, start)


def _check_pattern(caller: str, compressed: FormulaProblem, full: FormulaProblem, start: Array) -> None:
    """J w by groups of columns is J w: no entry of the Jacobian at the start is outside the pattern."""
    direction = np.random.default_rng(0).standard_normal((len(start), 1))
    with np.errstate(all="ignore"):
        try:
            product, by_groups = full.derivative(start, direction), compressed.jacobian(start) @ direction
        except SolveError:  # no series runs through the formula: told where a method asks for one
            return
    missed = np.abs(product - by_groups)
    if (missed > OUTSIDE * np.abs(product).max()).any():
        row = int(np.nanargmax(missed))
        raise InputError(
            f"{caller}: pattern: row {row} of the Jacobian differs from zero outside of it: "
            "add the missing entries, or leave the pattern out"
        )


@cache
def _model() -> type[BaseModel]:
    """The parts of a strategy, as a study would have them."""
    registry = load_registry()
    parts: dict[str, Any] = {noun: (registry.union(noun), ...) for noun in ("solver", "linear", "refresh")}
    parts |= {"stop": (StoppingTest, StoppingTest()), "budget": (Budget, Budget())}
    return create_model("Strategy", __config__=ConfigDict(extra="forbid", frozen=True), **parts)


def _strategy(caller: str, solver: Any, linear: Any, refresh: Any, stop: Any, budget: Any) -> _Strategy:
    """The components asked for. Raises InputError with a sentence for each that is wrong."""
    by_kind = {"solver": solver, "linear": linear, "refresh": refresh}
    document = {name: {"kind": value} if isinstance(value, str) else value for name, value in by_kind.items()}
    if refresh is None:
        named = load_registry().class_of("solver", document["solver"])
        document["refresh"] = getattr(named, "default_refresh", NonlinearSolver.default_refresh)
    document |= {name: value for name, value in (("stop", stop), ("budget", budget)) if value is not None}
    try:
        made: Any = _model().model_validate(document)
    except ValidationError as error:
        problems = problems_in(error, _model(), document)
    else:
        strategy = _Strategy(made.solver, made.linear, made.refresh, made.stop, made.budget)
        problems = claims_missing(strategy.solver, strategy.stop)
        if not problems:
            return strategy
    raise InputError("\n".join(problem.sentence(Source(caller)) for problem in problems))
