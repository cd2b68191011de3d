"""From rest to the first state of a flow: by descent, or stage after stage, and from cloud to cloud."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.scene import Solve
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.adaptation import Adaptation
from nlsolve.flow.accuracy.enrichment import interpolation
from nlsolve.flow.accuracy.estimate import UNKNOWN, compared
from nlsolve.flow.continuation import Solves, Stage, walk
from nlsolve.flow.first_state.descent import (
    TOLERANCES,
    arrival,
    descent,
    is_by_triangles,
    may_descend,
    most_iterations,
)
from nlsolve.flow.incompressibility import iterate_pressure
from nlsolve.flow.momentum import Flow
from nlsolve.flow.state import FlowState

FAR = 3
"""Stages of a steady flow from which on a descent is the shorter way: the first of two is n = 1, a linear flow."""

Approach = Generator[Solve, Outcome, tuple[Outcome, Stage]]
"""Yields the problems on the way; the outcome of the last, and its stage."""


@dataclass(frozen=True)
class FirstState:
    """The way to the quasi-static state at t = 0.

    In a steady flow the last stage is the method's of the case, and a descent leads to the stage before it.

    adaptation : of the nodes; None where they are given.
    is_steady : whether there is no march, so that the method of the case solves the flow in the end.
    increment : a flow -> its problem, for the method of the case.
    settle : takes another cloud for that of t = 0.
    """

    state: FlowState
    adaptation: Adaptation | None
    is_steady: bool
    increment: Callable[[Flow], Solves]
    settle: Callable[[Cloud], None]

    @property
    def leaves_last(self) -> bool:
        """Whether the last stage is left to the method of the case."""
        return self.is_steady and self.adaptation is None

    @property
    def count(self) -> int:
        """Stages to be solved on the first nodes, of which a descent is one."""
        stages = self.state.parts.start.stages(self.state.parts.law)
        return (2 if self.leaves_last else 1) if self.descends(stages) else len(stages)

    def solves(self) -> Approach:
        """Yields the problems up to the first state. May raise SolveError."""
        outcome, stage = yield from self.approach()
        if self.adaptation is None:
            return outcome, stage
        while outcome.status is Status.CONVERGED and self.adapt(self.adaptation):
            outcome = yield from self.solve_stage(stage, True)
            if outcome.status is not Status.CONVERGED:  # the state of the last cloud is no start for this one
                self.state.to_rest()
                outcome, stage = yield from self.approach()
        if outcome.status is Status.CONVERGED:
            outcome = yield from self.solve_last(stage)
            if outcome.status is Status.CONVERGED and not self.adaptation.reached:
                detail = self.adaptation.shortfall(len(self.state.cloud.nodes))
                outcome = replace(outcome, status=Status.INACCURATE, detail=detail)
        return outcome, stage

    def approach(self) -> Approach:
        """By descent where any way serves, else, and where that fails, stage after stage."""
        start, state = self.state.parts.start, self.state
        stages = start.stages(state.parts.law)
        if self.descends(stages):
            outcome = yield from self.descend(stages)
            if outcome.status is Status.CONVERGED:
                return (yield from self.solve_last(stages[-1])) if self.leaves_last else outcome, stages[-1]
            state.to_rest()
        return (yield from walk(start, state.parts.law, self.solve_stage))

    def descends(self, stages: list[Stage]) -> bool:
        """Whether the way is a descent."""
        return may_descend(self.state.parts, stages) and (not self.leaves_last or len(stages) >= FAR)

    def descend(self, stages: list[Stage]) -> Solves:
        """To the last stage, or to the one before it, with a tangent there whose pattern the method goes on with."""
        state, law = self.state, stages[-2 if self.leaves_last else -1].law
        if self.leaves_last and is_by_triangles(state):
            return (yield from descent(state, law, (*TOLERANCES, state.parts.start.tolerance)))
        outcome = yield from descent(state, law)
        if outcome.status is not Status.CONVERGED:
            return outcome
        if self.leaves_last:
            return (yield from arrival(state, law, most_iterations(state)))
        return (yield from iterate_pressure(state, lambda: arrival(state, law, most_iterations(state))))

    def solve_stage(self, stage: Stage, last: bool) -> Solves:
        """Yields the problems of one stage of a continuation."""
        if last and self.leaves_last:
            return self.solve_last(stage)
        return iterate_pressure(self.state, lambda: self.prepare(stage)) if last else self.prepare(stage)

    def solve_last(self, stage: Stage) -> Solves:
        """Yields the problems of a steady flow, for the method of the case."""
        return iterate_pressure(self.state, lambda: self.increment(self.state.flow_of(stage.law)))

    def prepare(self, stage: Stage) -> Solves:
        """Yields the problem of one stage. On a cloud made from a solution it may take all iterations of the budget,
        for to go all the way again costs more, and where the way is left open it is solved as at the end of a descent.
        """
        state, start = self.state, self.state.parts.start
        most, is_adapted = state.parts.budget.iterations, self.adaptation is not None and self.adaptation.rounds > 0
        if is_adapted and start.is_free:
            return (yield from arrival(state, stage.law, most))
        flow, preparation = state.flow_of(stage.law, load=stage.load), start.preparation(most)
        if is_adapted:
            preparation = replace(preparation, iterations=most)
        return (yield Solve(flow, flow.unknowns(state.guess), preparation=preparation))

    def adapt(self, adaptation: Adaptation) -> bool:
        """Estimate the error of the state, and carry it to a cloud for the error asked for; False where that is reached
        already, or the limits allow no larger cloud. May raise SolveError.
        """
        state = self.state
        refused: SolveError | None = None
        with state.entry("estimate"):
            try:
                found = compared(state, state.velocity, None)
            except SolveError as refusal:  # a better cloud may be one on which the flow can be solved
                refused, found = refusal, UNKNOWN
        adaptation.judge(found)
        count = None if adaptation.reached else adaptation.next_count(len(state.cloud.nodes), state.discretizer.order)
        if count is None:
            if refused is not None:
                raise refused
            return False
        here = state.cloud
        with state.entry("operators"):
            cloud = adaptation.cloud(state.parts.scene, state.discretizer, here, state.velocity, count)
            carry = interpolation(here, cloud.nodes)
        adaptation.rounds += 1
        state.carry_to(cloud, carry)
        self.settle(cloud)
        return True
