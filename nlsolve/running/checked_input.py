"""What `nlsolve.solve` and `nlsolve.compare` are asked for, checked: a problem with its start, and a strategy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from nlsolve.algebra.formula import NUMBERS, FormulaProblem, real
from nlsolve.algebra.system import System
from nlsolve.contracts.component import Component
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import InputError, SolveError
from nlsolve.registry.problems import Problem, Source, problems_in
from nlsolve.registry.registry import load_registry
from nlsolve.series import Array
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.study.case import claims_missing

Given = str | Mapping[str, Any] | Component
"""A component by its kind, as a table with its kind and parameters, or as an instance, installed or not."""

Formula = Callable[[Any], Any]

OUTSIDE = 1e-6
"""Part of J w that a pattern may miss: rounding."""


@dataclass(frozen=True)
class Posed:
    """A problem and where its solution is sought; the system it came from, if any."""

    problem: NonlinearProblem
    start: Array
    system: System | None = None


@dataclass(frozen=True)
class Strategy:
    """What solves it, and when that stops."""

    solver: NonlinearSolver
    linear: LinearSolver
    refresh: RefreshRule
    stop: StoppingTest
    budget: Budget


def mistake(caller: str, place: str, value: object, expected: str) -> InputError:
    """The error that names the caller, the place, the value there, and what is expected instead."""
    return InputError(Problem((place,), value, expected).sentence(Source(caller)))


def posed_problem(caller: str, problem: Any, start: Any, pattern: Any, jacobian: Any) -> Posed:
    """The problem and its start. Raises InputError where one of them is none, or where they do not belong together."""
    if isinstance(problem, type):
        raise mistake(caller, "problem", problem, f"is a class: give an instance of it, such as {problem.__name__}(…)")
    if not isinstance(problem, System | NonlinearProblem):
        if not callable(problem):
            raise mistake(caller, "problem", problem, "should be a function F(u), a System or a NonlinearProblem")
        return _of_formula(caller, problem, _start(caller, start), pattern, jacobian)
    for name, given in (("pattern", pattern), ("jacobian", jacobian)):
        if given is not None:
            raise mistake(caller, name, given, f"is for a function F(u); a {type(problem).__name__} has its own")
    if isinstance(problem, System):
        own = problem.start()
        begun = own if start is None else _start(caller, start)
        if begun.shape != own.shape:
            raise mistake(caller, "start", start, f"has {len(begun)} numbers: this system has {len(own)} unknowns")
        posed = Posed(problem.equations(), begun, problem)
    else:
        posed = Posed(problem, _start(caller, start))
    _check_residual(caller, posed.problem.residual, posed.start)
    return posed


def _start(caller: str, start: Any) -> Array:
    """u_0, (U,)."""
    if start is None:
        raise mistake(caller, "start", start, "should be real numbers, one for each unknown")
    try:
        array = np.asarray(start)
    except ValueError as error:  # lists of several lengths
        raise mistake(caller, "start", start, "should be real numbers, one for each unknown") from error
    if array.dtype.kind not in NUMBERS:
        raise mistake(caller, "start", start, "should be real numbers, one for each unknown")
    if array.ndim != 1 or not array.size:
        way_out = "flatten it, and let F take it apart again" if array.size > 1 else "write [u] for one unknown"
        raise mistake(caller, "start", start, f"has shape {array.shape}: should have shape (U,); {way_out}")
    if not np.isfinite(array).all():
        place = int(np.flatnonzero(~np.isfinite(array))[0])
        raise mistake(caller, f"start[{place}]", float(array[place]), "should be a finite number")
    return array.astype(float)


def _check_residual(caller: str, residual: Formula, start: Array) -> None:
    """F at the start is a (U,) array of numbers; whether these are finite is for the driver to tell."""
    try:
        with np.errstate(all="ignore"):
            real(residual(start.copy()), start.shape, "F(start)")
    except InputError as error:
        raise InputError(f"{caller}: problem: {error}") from error


def _of_formula(caller: str, formula: Formula, start: Array, pattern: Any, jacobian: Any) -> Posed:
    _check_residual(caller, formula, start)
    if jacobian is not None and not callable(jacobian):
        raise mistake(caller, "jacobian", jacobian, "should be a function of u that returns the (U, U) matrix J(u)")
    size = len(start)
    if pattern is not None and np.shape(pattern) != (size, size):
        expected = f"has shape {np.shape(pattern)}: should be a matrix of shape {(size, size)}"
        raise mistake(caller, "pattern", pattern, expected)
    problem = FormulaProblem(formula, size, pattern, jacobian)
    if pattern is not None and jacobian is None:
        _check_pattern(caller, problem, FormulaProblem(formula, size), start)
    return Posed(problem, start)


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


def strategy_of(caller: str, solver: Any, linear: Any, refresh: Any, stop: Any, budget: Any) -> Strategy:
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
        strategy = Strategy(made.solver, made.linear, made.refresh, made.stop, made.budget)
        problems = claims_missing(strategy.solver, strategy.stop)
        if not problems:
            return strategy
    raise InputError("\n".join(problem.sentence(Source(caller)) for problem in problems))
