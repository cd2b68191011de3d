"""F(u) = 0 from Python: one solve, or the same problem under several strategies, without a study file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd
from numpy.typing import ArrayLike

from nlsolve.algebra.system import System
from nlsolve.contracts.component import Component
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.scene import Entry, Simulation, SingleSolve
from nlsolve.contracts.status import InputError
from nlsolve.registry.plugin_files import Plugin
from nlsolve.results.columns import RUNS
from nlsolve.running.checked_input import Formula, Given, Posed, Strategy, mistake, posed_problem, strategy_of
from nlsolve.solving.simulate import Record, crashed, simulate
from nlsolve.solving.stopping import Budget, StoppingTest

OF_A_MARCH = ("increments", "seconds_operators", "seconds_all")
"""Columns of `runs` that have no meaning for a single solve."""


def solve(
    problem: Formula | System | NonlinearProblem,
    start: ArrayLike | None = None,
    solver: Given = "robust",
    *,
    linear: Given = "auto",
    refresh: Given | None = None,
    operator: Given = "tangent",
    stop: Mapping[str, Any] | StoppingTest | None = None,
    budget: Mapping[str, Any] | Budget | None = None,
    pattern: Any | None = None,
    jacobian: Formula | None = None,
    typical_sizes: ArrayLike | None = None,
    plugins: Iterable[Plugin] = (),
) -> Outcome:
    """Solve F(u) = 0 from `start`.

    problem : F, a function of arrays (U,) -> (U,), whose Jacobian comes from the formula itself; or a `System`, or a
        `NonlinearProblem`.
    start : u_0, (U,); may be left out for a `System`, which has its own.
    solver, linear, refresh, operator : by kind ("newton"), with parameters ({"kind": "anm", "order": 15}), or as
        instances; `operator` is what K* is made of; without `refresh` the solver's default rule decides when it is
        renewed.
    stop, budget : stopping test and budget, such as {"tolerance": 1e-10} and {"iterations": 50}.
    pattern : for a function: sparse (U, U), with an entry wherever J(u) may differ from zero; J(u) then costs a few
        columns instead of U.
    jacobian : for a function that is not analytic: u -> J(u), dense or sparse (U, U).
    typical_sizes : for a function: sizes (U,) beside which an unknown that is small counts as zero; without them the
        size it began with.
    plugins : component classes, and paths of files with such, whose kinds the other arguments may name.

    The `Outcome` says how the solve ended, a failure too. Raises InputError for arguments that cannot be used.
    """
    posed = posed_problem("nlsolve.solve", problem, start, pattern, jacobian, typical_sizes)
    return _solved(
        posed, strategy_of("nlsolve.solve", solver, linear, refresh, operator, stop, budget, plugins)
    ).outcome


def compare(
    problem: Formula | System | NonlinearProblem,
    start: ArrayLike | None = None,
    solvers: Iterable[Given] | Mapping[str, Given] = (),
    *,
    linear: Given = "auto",
    refresh: Given | None = None,
    operator: Given = "tangent",
    stop: Mapping[str, Any] | StoppingTest | None = None,
    budget: Mapping[str, Any] | Budget | None = None,
    pattern: Any | None = None,
    jacobian: Formula | None = None,
    typical_sizes: ArrayLike | None = None,
    plugins: Iterable[Plugin] = (),
) -> pd.DataFrame:
    """Solve one problem from one start with each of `solvers`: one row for each, with the columns of `runs` that apply.

    solvers : a list, or a dictionary that names them: {"full steps": {"kind": "newton", "globalization": …}}. The first
        column, `solver`, holds the names.

    The other arguments are those of `solve`. A method that fails, or crashes, gives a row that says so. Raises
    InputError for arguments that cannot be used.
    """
    caller, brought = "nlsolve.compare", tuple(plugins)
    posed = posed_problem(caller, problem, start, pattern, jacobian, typical_sizes)
    if isinstance(solvers, str | Component) or not solvers or (isinstance(solvers, Mapping) and "kind" in solvers):
        raise mistake(caller, "solvers", solvers, 'should be a list or a dictionary of them, such as ["newton", "anm"]')
    named = solvers if isinstance(solvers, Mapping) else None
    chosen = [
        strategy_of(caller, solver, linear, refresh, operator, stop, budget, brought)
        for solver in (solvers if named is None else named.values())
    ]
    names = [_label(strategy.solver) for strategy in chosen] if named is None else list(named)
    rows = [{"solver": name, **_row(posed, strategy)} for name, strategy in zip(names, chosen, strict=True)]
    frame = pd.DataFrame(rows, columns=["solver", *RUNS])
    return frame.drop(columns=[name for name in RUNS if name in OF_A_MARCH or frame[name].isna().all()])


def _solved(posed: Posed, strategy: Strategy) -> Record:
    """One solve with its own ledger; the solution of a system is compared with the system's known roots."""

    def simulation(entry: Entry) -> Simulation:
        if posed.system is not None:
            return posed.system.search(posed.start, strategy.linear, entry)
        return SingleSolve(posed.problem, posed.start)

    return simulate(simulation, strategy)


def _row(posed: Posed, strategy: Strategy) -> dict[str, Any]:
    """The row of one strategy. Every exception becomes a row too, except InputError, a mistake of the caller."""
    try:
        return _solved(posed, strategy).summary
    except InputError:
        raise
    except Exception as error:  # as in a study: a stranger's method may raise anything
        return crashed(error)


def _label(component: Component) -> str:
    """The kind, and the given parameters that differ from their defaults: "anm, order = 15"."""
    words = [component.kind_name()]
    for name, field in type(component).model_fields.items():
        value = getattr(component, name)
        if name != "kind" and name in component.model_fields_set and value != field.default:
            words.append(f"{name} = {_label(value) if isinstance(value, Component) else value}")
    return ", ".join(words)
