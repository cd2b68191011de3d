"""A case from outside: the components it is made of, what is told on its way, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.continuum.scene import Scene
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.flow.continuation import Start
from nlsolve.series import Array
from nlsolve.solving.stopping import Budget, StoppingTest


@dataclass(frozen=True)
class Setup:
    """The components of one case. `starter` is the method that reaches the first state, the same for every strategy."""

    scene: Scene
    law: ConstitutiveLaw
    discretizer: Discretizer
    linear: LinearSolver
    solver: NonlinearSolver
    refresh: RefreshRule
    starter: NonlinearSolver
    predictor: Predictor
    stop: StoppingTest = field(default_factory=StoppingTest)
    start: Start = field(default_factory=Start)
    budget: Budget = field(default_factory=Budget)
    counterpart: Discretizer | None = None
    """Discretises the solved flow once more, for an estimate of its error."""
    record: tuple[float, ...] = ()
    """Times [s] at which the fields are recorded, besides the last."""


@dataclass(frozen=True)
class Progress:
    """What a listener is told after every increment."""

    increment: int
    increments: int
    branches: int
    factorizations: int


@dataclass(frozen=True)
class Record:
    """What one case leaves: its row of `runs`, its rows of `steps`, its `fields` (a row a node and recorded time).

    problem, state : the last that was solved, None before the first; for measuring what work on them costs.
    """

    summary: dict[str, Any]
    steps: pd.DataFrame
    fields: pd.DataFrame = field(default_factory=pd.DataFrame)
    problem: NonlinearProblem | None = None
    state: Array | None = None
