"""The arguments of `nlsolve.solve` and `nlsolve.compare`, checked: a problem with its start, and a strategy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from nlsolve.algebra.formula import NUMBERS, OVERFLOWS, FormulaProblem, real
from nlsolve.algebra.system import System
from nlsolve.contracts.component import Component
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import InputError, SolveError
from nlsolve.registry.plugin_files import Plugin, with_plugins
from nlsolve.registry.problems import Problem, Source, problems_in
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.series import Array
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.study.case import claims_missing

Given = str | Mapping[str, Any] | Component
"""A component: its kind, a table of its kind and parameters, or an instance, installed or not."""

Formula = Callable[[Any], Any]

OUTSIDE = 1e-6
"""Largest part of J w that may lie outside a pattern; below it the difference is rounding."""


@dataclass(frozen=True)
class Posed:
    """A problem and its start u_0, (U,); `system` is the System that the problem was given as, if any."""

    problem: NonlinearProblem
    start: Array
    system: System | None = None


@dataclass(frozen=True)
class Strategy:
    """The components that solve a problem, with the stopping test and the budget."""

    solver: NonlinearSolver
    linear: LinearSolver
    refresh: RefreshRule
    operator: IterationOperator
    stop: StoppingTest
    budget: Budget


def mistake(caller: str, place: str, value: object, expected: str) -> InputError:
    """The error that names the caller, the place, the value there, and what is expected instead."""
    return InputError(Problem((place,), value, expected).sentence(Source(caller)))


def posed_problem(
    caller: str, problem: Any, start: Any, pattern: Any, jacobian: Any, typical_sizes: Any = None
) -> Posed:
    """The checked problem and start. Raises InputError if one of them cannot be used or they do not fit together."""
    if isinstance(problem, type):
        raise mistake(caller, "problem", problem, f"is a class: give an instance of it, such as {problem.__name__}(…)")
    if not isinstance(problem, System | NonlinearProblem):
        if not callable(problem):
            raise mistake(caller, "problem", problem, "should be a function F(u), a System or a NonlinearProblem")
        return _of_formula(caller, problem, _start(caller, start), pattern, jacobian, typical_sizes)
    for name, given in (("pattern", pattern), ("jacobian", jacobian), ("typical_sizes", typical_sizes)):
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
    """u_0, (U,). Raises InputError unless `start` is a vector of finite real numbers."""
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
    """Raises InputError unless F(start) is a (U,) array of numbers. The driver tells whether they are finite, and
    whether a number of Python overflows in F.
    """
    try:
        with suppress(*OVERFLOWS), np.errstate(all="ignore"):
            real(residual(start.copy()), start.shape, "F(start)")
    except InputError as error:
        raise InputError(f"{caller}: problem: {error}") from error


def _sizes(caller: str, given: Any, start: Array) -> Array | None:
    """The typical sizes, (U,). Raises InputError unless they are finite numbers, none of them negative."""
    if given is None:
        return None
    try:
        sizes = real(given if np.ndim(given) else np.full(len(start), given), start.shape, "typical_sizes")
    except InputError as error:
        raise InputError(f"{caller}: {error}") from error
    if not (np.isfinite(sizes) & (sizes >= 0.0)).all():
        raise mistake(caller, "typical_sizes", given, "should be finite numbers, none of them negative")
    return sizes


def _of_formula(caller: str, formula: Formula, start: Array, pattern: Any, jacobian: Any, typical: Any) -> Posed:
    sizes = _sizes(caller, typical, start)
    _check_residual(caller, formula, start)
    if jacobian is not None and not callable(jacobian):
        raise mistake(caller, "jacobian", jacobian, "should be a function of u that returns the (U, U) matrix J(u)")
    size = len(start)
    if pattern is not None and np.shape(pattern) != (size, size):
        expected = f"has shape {np.shape(pattern)}: should be a matrix of shape {(size, size)}"
        raise mistake(caller, "pattern", pattern, expected)
    problem = FormulaProblem(formula, size, pattern, jacobian, typical_sizes=sizes)
    if pattern is not None and jacobian is None:
        _check_pattern(caller, problem, FormulaProblem(formula, size), start)
    return Posed(problem, start)


def _check_pattern(caller: str, compressed: FormulaProblem, full: FormulaProblem, start: Array) -> None:
    """J w by groups of columns is J w. Raises InputError if J at the start has an entry outside the pattern."""
    direction = np.random.default_rng(0).standard_normal((len(start), 1))
    with np.errstate(all="ignore"):
        try:
            product, by_groups = full.derivative(start, direction), compressed.jacobian(start) @ direction
        except SolveError:  # not analytic: reported when a method asks for a derivative
            return
    missed = np.abs(product - by_groups)
    if (missed > OUTSIDE * np.abs(product).max()).any():
        row = int(np.nanargmax(missed))
        raise InputError(
            f"{caller}: pattern: row {row} of the Jacobian differs from zero outside of it: "
            "add the missing entries, or leave the pattern out"
        )


def _model(registry: Registry) -> type[BaseModel]:
    """The pydantic model of a strategy: the sections that a study has for it."""
    parts: dict[str, Any] = {noun: (registry.union(noun), ...) for noun in ("solver", "linear", "refresh", "operator")}
    parts |= {"stop": (StoppingTest, StoppingTest()), "budget": (Budget, Budget())}
    return create_model("Strategy", __config__=ConfigDict(extra="forbid", frozen=True), **parts)


@cache
def _model_of_installed() -> type[BaseModel]:
    return _model(load_registry())


def strategy_of(
    caller: str,
    solver: Any,
    linear: Any,
    refresh: Any,
    operator: Any,
    stop: Any,
    budget: Any,
    plugins: Iterable[Plugin] = (),
) -> Strategy:
    """The strategy that the arguments describe. Raises InputError with a sentence for each wrong argument.

    plugins : classes and files whose kinds the arguments may name besides the installed ones.
    """
    brought = tuple(plugins)
    registry = with_plugins(load_registry(), brought)
    model = _model(registry) if brought else _model_of_installed()
    by_kind = {"solver": solver, "linear": linear, "refresh": refresh, "operator": operator}
    document = {name: {"kind": value} if isinstance(value, str) else value for name, value in by_kind.items()}
    if refresh is None:
        named = registry.class_of("solver", document["solver"])
        document["refresh"] = getattr(named, "default_refresh", NonlinearSolver.default_refresh)
    document |= {name: value for name, value in (("stop", stop), ("budget", budget)) if value is not None}
    with registry.in_use():
        try:
            made: Any = model.model_validate(document)
        except ValidationError as error:
            problems = problems_in(error, model, document)
        else:
            strategy = Strategy(made.solver, made.linear, made.refresh, made.operator, made.stop, made.budget)
            problems = claims_missing(strategy.solver, strategy.stop)
            if not problems:
                return strategy
    raise InputError("\n".join(problem.sentence(Source(caller)) for problem in problems))
