"""seconds = Σ_kind n_kind c_kind : what a method's work costs on this machine, by counts and measured unit costs.

A Taylor coefficient of order j costs c_order + j c_term, since order j convolves j earlier terms; a series of p orders
costs p c_order + ½ p (p + 1) c_term. Counts do not depend on what a factorisation costs, as no refresh rule asks for
the clock: the counts of one run predict its seconds with any linear solver.
"""

from __future__ import annotations

import operator
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.problem import Expansion, NonlinearProblem
from nlsolve.contracts.status import SolveError
from nlsolve.results.costs.unit_costs import UnitCosts
from nlsolve.series import Array
from nlsolve.solving.simulate import simulation_of
from nlsolve.solving.work.ledger import Ledger

ROUNDS = 5
"""How often all kinds of work are timed in turn."""

FEWEST_ROUNDS, ENOUGH_SECONDS = 2, 1.0
"""Least number of rounds, and the time after which no further round begins [s]."""

ORDER = 20
"""Orders of the series that is timed; the cost of higher orders lies on the line through these."""

PART_OF_STATE = 0.9
"""Right-hand sides are R at this multiple of the solution, as large as in a march; R at the solution is rounding."""

RATIO_OF_TERMS = 0.5
"""Ratio of successive coefficients pushed: no product of them may become so small that arithmetic slows down."""


CLOCKS: dict[str, Callable[[], float]] = {"wall": time.perf_counter, "processor": time.process_time}


@dataclass(frozen=True)
class Calibration:
    """What the work of a case costs, measured without running the case.

    sizes : columns of `runs` for the size of the case.
    operators : time in which its operators were built [s].
    unit : unit costs [s]; None if the discretisation fails or the first tangent cannot be factorised.
    """

    sizes: Mapping[str, Any]
    operators: float
    unit: UnitCosts | None


def calibrate(parts: Any, rounds: int = ROUNDS) -> Calibration:
    """Measure the costs of a case on the problem and the state that its simulation gives as a sample."""
    ledger = Ledger()
    simulation = simulation_of(parts, ledger.entry)
    with threadpool_limits(limits=1):
        try:
            problem, state = simulation.sample()
            unit = measure(problem, parts.linear, state, rounds)
        except SolveError:
            unit = None
    return Calibration(simulation.sizes, ledger.seconds["operators"], unit)


@np.errstate(all="ignore")
def measure(
    problem: NonlinearProblem,
    linear: LinearSolver,
    state: Array,
    rounds: int = ROUNDS,
    clock: Callable[[], float] = time.process_time,
) -> UnitCosts:
    """Unit costs [s] at a state (U,): medians over rounds in which every kind of work is done in turn, as by a method.

    The costs of series are 0 for a problem without them. Raises SolveError if the tangent cannot be factorised.
    """
    watch = _Watch(clock)
    begun = clock()
    factors = linear.factorize(problem.jacobian(state))  # settles the ordering, off the clock
    for done in range(rounds):
        if done >= FEWEST_ROUNDS and clock() - begun > ENOUGH_SECONDS:
            break
        matrix = watch("jacobian", problem.jacobian, state)
        factors = watch("factorization", linear.factorize, matrix, factors)
        expansion = watch("expansion", _begun, problem, state) if problem.has_series else None
        for j in range(1, ORDER + 1):
            rhs = watch("residual", problem.residual, PART_OF_STATE * state)
            solution = watch("triangular_solve", factors.solve, rhs)
            watch("matrix_product", operator.matmul, matrix, solution)
            if expansion is not None:
                expansion.append(RATIO_OF_TERMS**j * state)
                watch(f"order {j}", expansion.coefficient, j)
    orders = np.arange(1, ORDER + 1)
    growth = np.stack([np.ones(ORDER), orders], axis=1)
    (series_order, series_term), _ = scipy.optimize.nnls(growth, np.array([watch.median(f"order {j}") for j in orders]))
    return UnitCosts(
        **{kind: watch.median(kind) for kind in UnitCosts.__dataclass_fields__ if not kind.startswith("series")},
        series_order=float(series_order),
        series_term=float(series_term),
    )


def _begun(problem: NonlinearProblem, state: Array) -> Expansion:
    expansion = problem.expand(state)
    expansion.coefficient(0)
    return expansion


class _Watch:
    """Seconds of each piece of work, by kind."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._seconds: defaultdict[str, list[float]] = defaultdict(list)

    def __call__(self, kind: str, work: Callable[..., Any], *arguments: Any) -> Any:
        begun = self._clock()
        result = work(*arguments)
        self._seconds[kind].append(self._clock() - begun)
        return result

    def median(self, kind: str) -> float:
        """Median seconds of one kind of work; 0 where none was done, as for the series of a problem without them."""
        return statistics.median(self._seconds[kind] or [0.0])
