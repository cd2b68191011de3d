"""Continuation from rest, where no series and no Newton step has a useful range, to the first state."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.recording import SystemStart
from nlsolve.contracts.scene import Preparation, Solve
from nlsolve.contracts.status import Status
from nlsolve.flow.momentum import Flow
from nlsolve.registry.nested import AnySolver
from nlsolve.series import Array

LOAD = "load"
"""The value of `by` that is no field of the law: it varies a factor on boundary velocities and body forces."""

REST = "rest"
"""The value of `at` with which a march begins at rest."""

VALUES = (1.0, 0.5, 0.3, 0.2)
"""The values of a continuation for which a study gives none."""

CONTINUATION = ("by", "values", "adaptive", "smallest", "iterations", "tolerance", "solver")
"""The fields of a `Start` that say how its stages are solved; a march from rest has none."""

LED_BY = 5
"""So many of them, the first ones, lead from stage to stage; with a stored state there is one stage."""

EASY = 8  # a stage solved in so many iterations or fewer was easy: the next step is doubled


@dataclass(frozen=True)
class Stage:
    """One problem of the continuation: its law, the factor on its load, and the value of what is varied."""

    law: ConstitutiveLaw
    load: float
    value: float


class Start(SystemStart):
    """How the first state is reached: a stage is solved for each of `values` that is easier than the target, in order,
    and then the target itself. These are values of `by`, a field by which the law is continued, or "load", which is
    easier when it is smaller.

    The method `solver` solves the stages, with a new tangent each iteration; its work is counted apart from the march
    (columns `start_…`). An adaptive continuation begins with the first of `values`, tries the second next, and goes on
    in steps of log(`by`), which are halved when a stage fails and doubled when it was easy. With no values, the method
    of the case solves a steady scene from rest.

    No stages are needed where at most a tolerance is given: Newton's method solves the flow by linear triangles on the
    same nodes from rest (with many nodes from its solution on fewer of them), and from there Newton-Krylov with a kept
    tangent solves that of the case; in a steady scene at the last value before the target, from where the method of the
    case begins. The continuation follows where this fails.

    A march may also begin at rest: V = 0 inside at t = 0, on the boundary what is prescribed there, and nothing is
    solved before the first increment. What that costs is counted in the march; all `start_…` columns are 0.

    With a stored state there is no continuation: the target is solved from that state, carried to the nodes of this
    case linearly where they are others; by the method of the case in a steady scene, by `solver` before a march. A
    system of equations has no other key than `stored`, in place of its own start.

    A perturbation moves the guess that each solve by the method of the case begins with: in a steady scene the state
    after the continuation (or rest), in a march the state that each increment begins with. The equations stay the same.
    """

    at: Literal["state", "rest"] = Field(
        "state",
        description="what a march begins with at t = 0: the quasi-static state, by continuation, or V = 0 inside",
    )
    by: str = Field(
        "index",
        description="what is varied: a field of the law, as index (from 1) or regularization (from large), or load",
    )
    values: tuple[float, ...] | None = Field(
        None, description=f"its values on the way, in order; absent: {', '.join(f'{value:g}' for value in VALUES)}"
    )
    adaptive: bool = Field(False, description="find the values between the first and the target")
    smallest: float = Field(0.01, gt=0, lt=1, description="adaptive: shortest step, as part of the way in log(by)")
    iterations: int = Field(25, gt=0, description="adaptive: iterations after which a stage has failed")
    tolerance: float = Field(1e-10, gt=0, description="relative residual of the first state")
    solver: AnySolver = Field(  # type: ignore[assignment]
        {"kind": "newton"}, description="the method that solves the stages, the same for every strategy"
    )
    perturbation: float = Field(
        0.0, ge=0, description="ε, size of a random change of the case's own first guesses over that of the velocity"
    )
    seed: int = Field(0, ge=0, description="of the perturbation; without one all seeds are one case, that of seed 0")

    @field_validator("seed")
    @classmethod
    def _nothing_to_draw(cls, seed: int, info: ValidationInfo) -> int:
        return seed if info.data.get("perturbation") else 0

    @model_validator(mode="after")
    def _rest_has_no_continuation(self) -> Self:
        if self.at == REST and self.stored is not None:
            raise ValueError('stored: a march from rest begins with V = 0: leave it out, or set at = "state"')
        if self.at == REST or self.stored is not None:
            usual = Start()
            begun, way_out = ("rest", 'set at = "state"') if self.at == REST else ("a stored state", "leave stored out")
            for name in CONTINUATION[: None if self.at == REST else LED_BY]:
                if getattr(self, name) != getattr(usual, name):
                    raise ValueError(f"{name}: a march from {begun} has no continuation: leave it out, or {way_out}")
        return self

    @property
    def path(self) -> tuple[float, ...]:
        """`values`, or `VALUES` where a study gives none."""
        return VALUES if self.values is None else self.values

    @property
    def is_free(self) -> bool:
        """Whether a study says nothing of how its first state is reached, so that any way there is as good."""
        usual = Start()
        said = (*(name for name in CONTINUATION if name != "tolerance"), "at", "stored")
        return all(getattr(self, name) == getattr(usual, name) for name in said)

    def disturbed(self, flow: Flow, u: Array, increment: int) -> Array:
        """u + ε ‖V‖₂ g/‖g‖₂ with V the velocities of all nodes and g normal, drawn anew for each increment."""
        if not self.perturbation:
            return u
        g = np.random.default_rng([self.seed, increment]).standard_normal(len(u))
        return u + self.perturbation * np.linalg.norm(flow.velocity(u)) / np.linalg.norm(g) * g

    def stages(self, law: ConstitutiveLaw) -> list[Stage]:
        """The stages of `values`, in order, and the target last; from a stored state the target alone, for a march from
        rest none.

        Raises ValueError when the law refuses the values.
        """
        if self.at == REST:
            return []
        if self.stored is not None:
            return [Stage(law, 1.0, 1.0)]
        if self.by == LOAD:
            path = (*self.path, 1.0)
            if min(path) <= 0.0 or (np.diff(path) <= 0.0).any():
                raise ValueError(
                    f"start.values = {list(self.path)}: a load grows to 1: give increasing values between 0 and 1, "
                    "such as [1e-4, 1e-2]"
                )
            return [Stage(law, load, load) for load in path]
        if not self.path and self.by not in law.continued_by:  # there is nothing to continue by
            return [Stage(law, 1.0, 1.0)]
        stages = [Stage(each, 1.0, getattr(each, self.by)) for each in law.continuation(self.by, self.path)]
        if self.adaptive and not min(stage.value for stage in stages) > 0.0:
            raise ValueError(
                f"start.by = {self.by!r}: an adaptive continuation steps in its logarithm, and the law's is "
                f"{stages[-1].value:g}: choose another field, or adaptive = false"
            )
        return stages

    def preparation(self, iterations: int) -> Preparation:
        """How one stage is solved: by the method of the start, in at most this many iterations, or fewer of its own."""
        most = min(self.iterations, iterations) if self.adaptive else iterations
        return Preparation(self.solver, self.tolerance, most)

    def method(self, flow: Flow) -> NonlinearSolver:
        """The method of the start, with steps by the potential of a flow that has one, if the method can take them."""
        can = flow.is_gradient and "globalization" in type(self.solver).model_fields
        return self.solver.with_(globalization={"kind": "energy"}) if can else self.solver

    def between(self, first: Stage, target: Stage, part: float) -> Stage:
        """The stage at log-interpolated `by`; part = 0: first, part = 1: target."""
        if part >= 1.0:
            return target
        value = float(first.value * (target.value / first.value) ** part)
        return (
            Stage(target.law, value, value)
            if self.by == LOAD
            else Stage(target.law.with_(**{self.by: value}), 1.0, value)
        )


Solves = Generator[Solve, Outcome, Outcome]
"""A generator that yields problems, is sent the outcome of each, and returns the outcome of the last."""


def walk(
    start: Start, law: ConstitutiveLaw, solve: Callable[[Stage, bool], Solves]
) -> Generator[Solve, Outcome, tuple[Outcome, Stage]]:
    """Solve stage after stage, each from the state of the one before, until one fails or the target is solved.

    solve : (stage, last) -> the problems of a stage; `last` is True for the target.
    Returns the outcome of the last stage, and that stage. Raises ValueError as `Start.stages` does.
    """
    stages = start.stages(law)
    if start.adaptive and len(stages) > 1:
        return (yield from _adaptive(start, stages, solve))
    for stage in stages:
        outcome = yield from solve(stage, stage is stages[-1])
        if outcome.status is not Status.CONVERGED:
            break
    return outcome, stage


def _adaptive(
    start: Start, stages: list[Stage], solve: Callable[[Stage, bool], Solves]
) -> Generator[Solve, Outcome, tuple[Outcome, Stage]]:
    """`walk` by steps in log(by); `step` is a part of the whole way."""
    first, second, target = stages[0], stages[1], stages[-1]
    step = float(np.log(second.value / first.value) / np.log(target.value / first.value))
    reached, here = 0.0, first
    outcome = yield from solve(first, False)
    while outcome.status is Status.CONVERGED and reached < 1.0:
        part = min(1.0, reached + step)
        stage = start.between(first, target, part)
        trial = yield from solve(stage, stage is target)
        if trial.status is Status.CONVERGED:
            outcome, reached, here = trial, part, stage
            step *= 2.0 if trial.iterations <= EASY else 1.0
            continue
        step = 0.5 * (part - reached)
        if step < start.smallest:
            detail = (
                f"the adaptive continuation got from {first.value:g} to {here.value:g}, and from there not even a step "
                f"of {start.smallest:g} of the way succeeds (start.smallest): {trial.detail}"
            )
            return replace(trial, detail=detail), stage
    return outcome, here
