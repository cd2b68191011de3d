"""To the first state without continuation, by linear triangles on the same nodes:

    Φ(v) → min     R_Δ = ∇Φ by linear triangles; Newton's steps from rest, along each of which Φ falls
    R(v) = 0       by the case's discretizer, from there; Newton-Krylov with a kept K*

Φ is convex, so that the first line cannot fail, and no other matrix of these nodes is as cheap. Its solution is an
error of discretisation away from that of the second line, which one K* reaches as a rule. Where convection leaves R_Δ
without a potential, ‖R_Δ‖ falls instead. With many nodes the first line begins with its own solution on fewer of them
(`nested`).
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from pydantic import TypeAdapter

from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Preparation, Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.enrichment import interpolation
from nlsolve.flow.continuation import Solves, Stage
from nlsolve.flow.first_state.thinning import thinned
from nlsolve.flow.linear_triangles import linear_triangles
from nlsolve.flow.momentum import Flow
from nlsolve.flow.state import FlowParts, FlowState
from nlsolve.registry.nested import AnyRefresh, AnySolver
from nlsolve.series import Array

TOLERANCES = (1e-2, 1e-6)
"""‖R_Δ‖ over its forces at rest, and then over those of the flow that this has led to, which may be far smaller."""

TOLERANCES_ON_FEWER = (1e-2, 1e-3)
"""The same for a flow whose solution is a guess."""

MANY = 4000
"""Nodes from which on a descent begins on fewer of them."""

MOST = 60
"""Iterations of one solve, after which this way is given up for the continuation."""

METHOD: TypeAdapter[NonlinearSolver] = TypeAdapter(AnySolver)
RULE: TypeAdapter[RefreshRule] = TypeAdapter(AnyRefresh)
"""They look up the method and its rule when a way begins: plugins may still be being imported now."""


def may_descend(parts: FlowParts, stages: list[Stage]) -> bool:
    """Whether a study leaves open how its first state is reached, and this state does not depend on that: a penalty in
    units of the local viscosity does. One stage is solved as it is.
    """
    return parts.start.is_free and len(stages) > 1 and parts.physics.penalty_unit != "local"


def descent(state: FlowState, law: ConstitutiveLaw, tolerances: Sequence[float] = TOLERANCES) -> Solves:
    """Yields the problems of the way from rest to the flow by this law on linear triangles, from which `arrival` leads
    to that of the case; the outcome of the last. It has failed where the nodes carry no triangles.
    """
    try:
        easier = by_triangles(state, law)
    except SolveError as refusal:
        return Outcome(refusal.status, refusal.detail, np.zeros(0), np.nan)
    state.guess = yield from first_guess(state, law)
    for tolerance in tolerances:
        preparation = Preparation(state.parts.start.method(easier), tolerance, most_iterations(state))
        outcome = yield Solve(easier, easier.unknowns(state.guess), preparation=preparation)
        if outcome.status is not Status.CONVERGED:
            return outcome
        state.guess = easier.velocity(outcome.state)
    return outcome


def first_guess(state: FlowState, law: ConstitutiveLaw) -> Generator[Solve, Outcome, Array]:
    """Yields the problems of a descent on fewer nodes, if there are many; its velocity at these nodes (N, 2), or rest.

    From there a few steps of Newton's method are left (nested iteration: Kronsjö & Dahlquist 1972; Hackbusch 1985).
    """
    rest = np.zeros_like(state.cloud.nodes)
    if len(state.cloud.nodes) < MANY:
        return rest
    try:
        with state.entry("operators"):
            fewer = thinned(state.cloud)
            carry = interpolation(fewer, state.cloud.nodes)
        there = state.at_rest_on(fewer, linear_triangles())
    except SolveError:  # where fewer nodes carry no triangles, all of them begin at rest
        return rest
    outcome = yield from descent(there, law, TOLERANCES_ON_FEWER)
    return carry @ there.guess if outcome.status is Status.CONVERGED else rest


def most_iterations(state: FlowState) -> int:
    """Iterations of one solve on this way."""
    return min(MOST, state.parts.budget.iterations)


def by_triangles(state: FlowState, law: ConstitutiveLaw) -> Flow:
    """The flow by linear triangles. May raise SolveError (bad cloud)."""
    return (state if is_by_triangles(state) else state.discretized_by(linear_triangles())).flow_of(law)


def is_by_triangles(state: FlowState) -> bool:
    """Whether linear triangles are the discretizer of the case."""
    return state.discretizer == linear_triangles()


def arrival(state: FlowState, law: ConstitutiveLaw, most: int) -> Solves:
    """Yields the flow by this law with the state so far for its start, which is near the solution."""
    flow, start = state.flow_of(law), state.parts.start
    solver = METHOD.validate_python({"kind": "newton-krylov"})
    refresh = RULE.validate_python(solver.default_refresh)
    return (
        yield Solve(flow, flow.unknowns(state.guess), preparation=Preparation(solver, start.tolerance, most, refresh))
    )
