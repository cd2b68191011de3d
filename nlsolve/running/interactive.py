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
from nlsolve.results.columns import RUNS
from nlsolve.running.checked_input import Formula, Given, Posed, Strategy, mistake, posed_problem, strategy_of
from nlsolve.solving.simulate import Record, crashed, simulate
from nlsolve.solving.stopping import Budget, StoppingTest

OF_A_MARCH = ("increments", "seconds_operators", "seconds_all")
"""Columns of `runs` that say nothing of a single solve."""


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
    posed = posed_problem("nlsolve.solve", problem, start, pattern, jacobian)
    return _solved(posed, strategy_of("nlsolve.solve", solver, linear, refresh, stop, budget)).outcome


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
    posed = posed_problem(caller, problem, start, pattern, jacobian)
    if isinstance(solvers, str | Component) or not solvers or (isinstance(solvers, Mapping) and "kind" in solvers):
        raise mistake(caller, "solvers", solvers, 'should be a list or a dictionary of them, such as ["newton", "anm"]')
    named = solvers if isinstance(solvers, Mapping) else None
    chosen = [
        strategy_of(caller, solver, linear, refresh, stop, budget)
        for solver in (solvers if named is None else named.values())
    ]
    names = [_label(strategy.solver) for strategy in chosen] if named is None else list(named)
    rows = [{"solver": name, **_row(posed, strategy)} for name, strategy in zip(names, chosen, strict=True)]
    frame = pd.DataFrame(rows, columns=["solver", *RUNS])
    return frame.drop(columns=[name for name in RUNS if name in OF_A_MARCH or frame[name].isna().all()])


def _solved(posed: Posed, strategy: Strategy) -> Record:
    """One solve with books of its own, a system held against its known roots."""

    def simulation(entry: Entry) -> Simulation:
        if posed.system is not None:
            return posed.system.search(posed.start, strategy.linear, entry)
        return SingleSolve(posed.problem, posed.start)

    return simulate(simulation, strategy)


def _row(posed: Posed, strategy: Strategy) -> dict[str, Any]:
    """The row of one strategy; whatever it raises becomes a row too, but for the caller's mistakes."""
    try:
        return _solved(posed, strategy).summary
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
