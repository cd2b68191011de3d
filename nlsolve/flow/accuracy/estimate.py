"""‖V* − V‖₂/‖V‖₂ over the interior nodes: the error of a solved flow, by solutions on its cloud and on an enriched one.

    V* = V_fine + ⅓ (V_fine − V_coarse)

V_fine is the estimator's solution with a node in the middle of every edge, V_coarse that on the cloud itself: what is
of second order in the distance of the nodes cancels (Richardson 1911).

The pressure that the penalty has built up is given to both beside the penalty, so that what is left of the
compressibility is a small part of what it was: V* − V has the error of the penalty in it too (a step of Uzawa 1958;
Fortin & Glowinski 1983).

Newton's steps, all with the factors of the first tangent (`kept_factors`), end when one is small beside the way gone.
Nothing of this is counted or timed.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.enrichment import Enriched, enriched, twice_as_fine
from nlsolve.flow.accuracy.kept_factors import KeptFactors
from nlsolve.flow.momentum import Flow
from nlsolve.flow.state import FlowState
from nlsolve.series import Array
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger

MOST_STEPS = 20
"""Newton steps after which the flow counts as unsolved on the enriched cloud."""

SMALL = 0.1
"""A step so small beside the way from the start, with forces so small beside those there, ends the solve."""

SOLVED = 1e-7
"""Relative residual of a state that is not worth a step."""

RICHARDSON = 1.0 / 3.0
"""1/(2² − 1): what is left of an error of second order at half the distance, over what has gone."""


def error_estimate(state: FlowState, velocity: Array, before: Array | None) -> float:
    """The estimate for the `velocity` (N, 2) [mm/s] at the end of an increment that began with `before` (N, 2); NaN
    where the case has no estimator.

    Raises SolveError where the flow cannot be solved so.
    """
    estimator, inside = state.parts.error_estimator, state.cloud.interior
    if estimator is None:
        return float("nan")
    nothing = np.empty((0, 2), dtype=int)
    fine = _solution(state, twice_as_fine(state.cloud), estimator, velocity, before)
    coarse = _solution(state, enriched(state.cloud, nothing), estimator, velocity, before)
    best = fine[: len(velocity)] + RICHARDSON * (fine[: len(velocity)] - coarse)
    return float(np.linalg.norm((best - velocity)[inside]) / np.linalg.norm(velocity[inside]))


def _solution(
    state: FlowState, finer: Enriched, discretizer: Discretizer, velocity: Array, before: Array | None
) -> Array:
    """V on an enriched cloud, whose nodes begin with those of `state`. Raises SolveError."""
    there = state.enriched(finer, discretizer, velocity)
    inertia = there.inertia_from(None if before is None else finer.carry(before))
    flow = there.flow_of(state.parts.law, inertia)
    return flow.velocity(_solved(flow, flow.unknowns(there.velocity), state))


def _solved(flow: Flow, start: Array, state: FlowState) -> Array:
    """R(u) = 0 from `start` (U,), to the accuracy that an estimate needs. Raises SolveError."""
    linear = KeptFactors(linear=state.parts.linear.for_one_matrix())
    problem, tangent = CountedProblem(flow, Ledger()), Tangent(linear, None, Ledger())
    last, forces = start, np.linalg.norm(flow.residual(start))
    if forces <= SOLVED * flow.scale(start):
        return start
    for step in islice(state.parts.start.solver.steps(problem, tangent, start), 1, MOST_STEPS + 1):
        u = step.state.copy()
        if not np.isfinite(u).all():
            break
        arrives = np.linalg.norm(u - last) <= SMALL * np.linalg.norm(u - start)
        if arrives and np.linalg.norm(flow.residual(u)) <= SMALL * forces:
            return u
        last = u
    raise SolveError(Status.BUDGET_SPENT, f"Newton does not solve the flow in {MOST_STEPS} steps with twice the nodes")
