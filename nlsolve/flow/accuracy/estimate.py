"""‖V* − V‖₂/‖V*‖₂ over the interior nodes: the error of a solved flow, by solutions on its cloud and an enriched one.

    V* = V_fine + ⅓ (V_fine − V_coarse)

V_fine is the estimator's solution with a node in the middle of every edge, V_coarse that on the cloud itself: what is
of second order in the distance of the nodes cancels (Richardson 1911). An estimator that adds nodes to a cloud, such as
triangles of degree 2, is of a higher order: V* is its solution with the nodes of the cloud and its own.

The pressure that the penalty has built up is given to both beside the penalty, so that what is left of the
compressibility is a small part of what it was: V* − V has the error of the penalty in it too (a step of Uzawa 1958;
Fortin & Glowinski 1983).

Newton's steps, two with each tangent, end when a correction is small beside the way gone. The tangent of V_fine is
solved by cycles with the factors of that of V_coarse, or of linear triangles on the cloud itself (`two_grids`); beside
a penalty, and where cycles fail, its steps all take the factors of the first one (`kept_factors`). Where the flow has a
potential it falls at each step (`energy`): at n = 0.05 a residual made to fall instead cuts the steps so short that
they end far from the solution. None of this is counted with the work of the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.linear_solver import Factors, LinearSolver
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.enrichment import Finer, completed, the_same, twice_as_fine
from nlsolve.flow.accuracy.kept_factors import KeptFactors, Preconditioned
from nlsolve.flow.accuracy.two_grids import Coarser
from nlsolve.flow.linear_triangles import linear_triangles
from nlsolve.flow.state import FlowState
from nlsolve.registry.nested import AnyRefresh
from nlsolve.series import Array
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger

RENEWED: TypeAdapter[RefreshRule] = TypeAdapter(AnyRefresh)
"""Looks up the rule by which tangents are renewed when an estimate begins: plugins may still be being imported now."""

STEPS_WITH_EACH = 2

MOST_STEPS = 20
"""Newton steps after which the flow counts as unsolved on the enriched cloud."""

SMALL = 0.1
"""A correction so small beside the way from the start, with forces so small beside those there, ends the solve."""

SOLVED = 1e-7
"""Relative residual of a state that is not worth a step."""

RICHARDSON = 1.0 / 3.0
"""1/(2² − 1): what is left of an error of second order at half the distance, over what has gone."""


@dataclass(frozen=True)
class Comparison:
    """A velocity V (N, 2) beside the better one V* at the same nodes.

    relative : ‖V* − V‖₂/‖V*‖₂ over the interior nodes.
    worst : the largest |V* − V| there over the largest |V*| of all nodes.
    factorizations : matrices factorised for it.
    """

    relative: float
    worst: float
    factorizations: int = 0

    @property
    def larger(self) -> float:
        """The larger of both errors."""
        return max(self.relative, self.worst)


NOTHING_TO_COMPARE = Comparison(float("nan"), float("nan"))
UNKNOWN = Comparison(float("inf"), float("inf"))
"""Of a flow that could not be solved with more nodes."""


def compared(state: FlowState, velocity: Array, before: Array | None) -> Comparison:
    """The `velocity` (N, 2) [mm/s] at the end of an increment that began with `before` (N, 2), beside the better one;
    NaN where the case has no estimator.

    Raises SolveError where the flow cannot be solved so.
    """
    estimator, inside, work = state.parts.error_estimator, state.cloud.interior, Ledger()
    if estimator is None:
        return NOTHING_TO_COMPARE

    def begun(discretizer: Discretizer, finer: Finer) -> _Enriched:
        return _Enriched(state, finer, discretizer, velocity, before, work)

    here = state.cloud
    complete = estimator.completed(here)
    if len(complete.nodes) > len(here.nodes):
        fine = begun(estimator, completed(complete, here))
        best = fine.velocity(begun(linear_triangles(), the_same(here)) if fine.takes_cycles else None)
    else:
        coarse, fine = begun(estimator, the_same(here)), begun(estimator, twice_as_fine(here))
        coarser, finer = coarse.velocity(), fine.velocity(coarse)
        best = finer + RICHARDSON * (finer - coarser)
    error = (best - velocity)[inside]
    return Comparison(
        float(np.linalg.norm(error) / np.linalg.norm(best[inside])),
        float(np.linalg.norm(error, axis=1).max() / np.linalg.norm(best, axis=1).max()),
        work.counts["factorization"],
    )


@dataclass(frozen=True)
class _Counted:
    """A linear solver whose factorisations are entered in `work`."""

    linear: LinearSolver
    work: Ledger

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        with self.work.entry("factorization"):
            return self.linear.factorize(matrix, previous)


class _Enriched:
    """The flow of `state` on a cloud whose first nodes are its own, to be solved."""

    def __init__(
        self,
        state: FlowState,
        finer: Finer,
        discretizer: Discretizer,
        velocity: Array,
        before: Array | None,
        work: Ledger,
    ) -> None:
        there = state.enriched(finer, discretizer, velocity)
        inertia = there.inertia_from(None if before is None else finer.carry(before))
        self._finer, self._flow = finer, there.flow_of(state.parts.law, inertia)
        self._start = self._flow.unknowns(there.velocity)
        self._method = state.parts.start.method(self._flow)
        self._linear = _Counted(state.parts.linear.for_one_matrix(), work)
        self._factors: Factors | None = None

    @property
    def takes_cycles(self) -> bool:
        """Whether two grids solve with a tangent: not where it is no gradient, and not beside a penalty, which couples
        motions that differ from node to node.
        """
        return self._flow.is_gradient and self._flow.pressure(self._start) is None

    def velocity(self, coarse: _Enriched | None = None) -> Array:
        """V at the nodes of `state`: R(u) = 0 to the accuracy that an estimate needs. Raises SolveError.

        coarse : the flow on fewer of these nodes, if there is one.
        """
        coarser = None
        if coarse is not None and self.takes_cycles:
            coarser = Coarser(coarse.factors(), self._finer.interpolation)
        return self._flow.velocity(self._solved(coarser))[: len(self._finer.coarser.nodes)]

    def factors(self) -> Factors:
        """Of the tangent with which the flow was solved last, or of that at the start. Raises SolveError."""
        return self._factors or self._linear.factorize(self._flow.jacobian(self._start))

    def _solved(self, coarser: Coarser | None) -> Array:
        flow, start = self._flow, self._start
        linear = KeptFactors(linear=self._linear, coarser=coarser)
        rule = RENEWED.validate_python({"kind": "every-m", "m": STEPS_WITH_EACH})
        problem, tangent = CountedProblem(flow, Ledger()), Tangent(linear, rule, Ledger())
        last, forces = start, np.linalg.norm(flow.residual(start))
        if forces <= SOLVED * flow.scale(start):
            return start
        for step in islice(self._method.steps(problem, tangent, start), 1, MOST_STEPS + 1):
            u = step.state.copy()
            if not np.isfinite(u).all():
                break
            correction = np.linalg.norm(u - last) / float(step.notes.get("length", 1.0))
            arrives = correction <= SMALL * np.linalg.norm(u - start)
            if arrives and np.linalg.norm(flow.residual(u)) <= SMALL * forces:
                assert isinstance(tangent.factors, Preconditioned)
                self._factors = tangent.factors.factors
                return u
            last = u
        why = f"Newton does not solve the flow in {MOST_STEPS} steps with twice the nodes"
        raise SolveError(Status.BUDGET_SPENT, why)
