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
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np
import scipy.optimize
from pydantic import Field
from threadpoolctl import threadpool_limits

from nlsolve.algebra import Algebraic, AlgebraicSetup
from nlsolve.balance import sample
from nlsolve.component import Component
from nlsolve.linear import LinearSolver
from nlsolve.problems import Expansion, NonlinearProblem
from nlsolve.series import Array
from nlsolve.setup import Setup

PREFIX = "unit."
"""Before the name of a unit cost in `runs`."""

ROUNDS = 5
"""How often all kinds of work are timed in turn."""

FEWEST_ROUNDS, ENOUGH_SECONDS = 2, 1.0
"""Rounds that are made however long they take, and seconds after which no further one is begun."""

ORDER = 20
"""Orders of the series that is timed; the cost of later ones is on the line through these."""

PART_OF_STATE = 0.9
"""R at this part of the solution is a right-hand side as a march has them; R at the solution is rounding."""

RATIO_OF_TERMS = 0.5
"""Of the coefficients pushed: none of their products may become so small that arithmetic slows down."""


COUNTS = (
    "residuals",
    "expansions",
    "jacobians",
    "matrix_products",
    "factorizations",
    "triangular_solves",
    "series_orders",
    "series_terms",
)
"""Columns of `runs` that the unit costs are for."""


CLOCKS: dict[str, Callable[[], float]] = {"wall": time.perf_counter, "processor": time.process_time}


class Timing(Component):
    """How the cases of a study are timed."""

    noun: ClassVar[str] = "timing"

    rounds: int = Field(
        1, gt=0, description="how often all cases are run, one after the other; a case's fastest round counts"
    )
    clock: Literal["wall", "processor"] = Field(
        "processor",
        description="seconds the processor worked for the case, which other programs on the machine do not lengthen, "
        "or seconds that passed",
    )
    calibrate: bool = Field(
        False, description="measure after each case what a unit of its work costs, and predict its seconds from that"
    )


@dataclass(frozen=True)
class UnitCosts:
    """Seconds of one piece of work of each kind; a Taylor coefficient of order j: series_order + j series_term."""

    residual: float
    expansion: float
    jacobian: float
    matrix_product: float
    factorization: float
    triangular_solve: float
    series_order: float
    series_term: float

    @property
    def ratio(self) -> float:
        """ρ = factorisation / triangular solve."""
        return self.factorization / self.triangular_solve

    def predict(self, counts: Mapping[str, float]) -> float:
        """Seconds of the work counted under the names of `COUNTS`; a name that is absent counts 0."""
        n = {name: counts.get(name, 0.0) for name in COUNTS}
        return (
            (n["residuals"] - n["expansions"]) * self.residual
            + n["expansions"] * self.expansion
            + n["jacobians"] * self.jacobian
            + n["matrix_products"] * self.matrix_product
            + n["factorizations"] * self.factorization
            + n["triangular_solves"] * self.triangular_solve
            + n["series_orders"] * self.series_order
            + n["series_terms"] * self.series_term
        )

    def columns(self) -> dict[str, float]:
        """As columns of `runs`."""
        return {PREFIX + kind: seconds for kind, seconds in asdict(self).items()}

    @classmethod
    def of_columns(cls, run: Mapping[str, Any]) -> Self:
        """From columns of `runs`."""
        return cls(**{kind: float(run[PREFIX + kind]) for kind in cls.__dataclass_fields__})


@dataclass(frozen=True)
class Calibration:
    """What a case that has not been run costs: its size, seconds of its operators, and unit costs."""

    nodes: int | None
    unknowns: int
    operators: float
    unit: UnitCosts


def calibrate(setup: Setup | AlgebraicSetup, rounds: int = ROUNDS) -> Calibration:
    """On the cloud a case begins with (see `balance.sample`), or at the start of a system. Raises SolveError where the
    cloud or the first tangent is bad.
    """
    with threadpool_limits(limits=1):
        if isinstance(setup, AlgebraicSetup):
            system, start = Algebraic(setup.scene), setup.scene.start()
            return Calibration(None, len(start), 0.0, measure(system, setup.linear, start, rounds))
        problem, state, ledger = sample(setup)
        unit = measure(problem, setup.linear, state, rounds)
    return Calibration(len(problem.cloud.nodes), len(state), ledger.seconds["operators"], unit)


@np.errstate(all="ignore")
def measure(
    problem: NonlinearProblem,
    linear: LinearSolver,
    state: Array,
    rounds: int = ROUNDS,
    clock: Callable[[], float] = time.process_time,
) -> UnitCosts:
    """Medians of rounds in which every kind of work is done in turn, as a method does it, around a state (U,).

    Raises SolveError where the tangent there cannot be factorised.
    """
    watch = _Watch(clock)
    begun = clock()
    factors = linear.factorize(problem.jacobian(state))  # settles the ordering, off the clock
    for done in range(rounds):
        if done >= FEWEST_ROUNDS and clock() - begun > ENOUGH_SECONDS:
            break
        matrix = watch("jacobian", problem.jacobian, state)
        factors = watch("factorization", linear.factorize, matrix, factors)
        expansion = watch("expansion", _begun, problem, state)
        for j in range(1, ORDER + 1):
            rhs = watch("residual", problem.residual, PART_OF_STATE * state)
            solution = watch("triangular_solve", factors.solve, rhs)
            watch("matrix_product", operator.matmul, matrix, solution)
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
        return statistics.median(self._seconds[kind])
