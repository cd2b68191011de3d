"""p ← p − λ div v : the pressure of an incompressible flow iterated from one solve with a penalty to the next.

Each iterate is a solution with the penalty λ alone and the pressure so far as a force (augmented Lagrangian: Powell
1969, Hestenes 1969; for viscous flow Fortin & Glowinski 1983). The map contracts like μ/λ, but slowly for pressures
that the velocities hardly feel; mixing the last few iterates (Anderson 1965) deals with those.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nlsolve.contracts.status import Status
from nlsolve.flow.continuation import Solves
from nlsolve.flow.observables import divergence
from nlsolve.flow.state import FlowState
from nlsolve.solving.anderson_mixing import Mixing

DEPTH = 8  # changes of the pressure that are mixed


def pressure_mixing() -> Mixing:
    """The mixing for one increment: undamped, over the last `DEPTH` changes."""
    return Mixing(DEPTH, 1.0)


def iterate_pressure(state: FlowState, solve_once: Callable[[], Solves]) -> Solves:
    """Solve, and iterate the pressure until ‖div v‖ ≤ divergence_tolerance · ‖ε̄‖ when the physics set this tolerance.

    solve_once : yields the problem with the present pressure.
    Returns the outcome of the last solve; "budget spent" when the iterations of the pressure do not suffice.
    """
    physics, mixing = state.parts.physics, pressure_mixing()
    asked, most = physics.divergence_tolerance, physics.pressure_iterations
    outcome = yield from solve_once()
    if asked is None:
        return outcome
    for _ in range(most):
        if outcome.status is not Status.CONVERGED:
            return outcome
        assert state.flow is not None
        if divergence(state.flow, state.velocity) <= asked:
            return outcome
        image = state.flow.pressure(outcome.state)
        assert image is not None
        pressure = np.zeros_like(image) if state.pressure is None else state.pressure
        state.pressure = mixing.next(pressure, image - pressure)
        state.pressure_iterations += 1
        outcome = yield from solve_once()
    reached = divergence(state.flow, state.velocity) if state.flow is not None else np.nan
    if outcome.status is not Status.CONVERGED or reached <= asked:
        return outcome
    detail = (
        f"‖div V‖/‖ε̄‖ = {reached:.1e} after {most} iterations of the pressure, {asked:g} was asked for: "
        "raise the penalty, tighten stop.tolerance, or take the dilatation in another form"
    )
    return replace(outcome, status=Status.BUDGET_SPENT, detail=detail)
