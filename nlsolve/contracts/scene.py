"""A scene is the component that builds the simulation of a case. The contract of scenes and simulations.

    for each Solve(R, u_0) that the simulation yields:
        outcome = driver.solve(R, method, K*, u_0)
        send the outcome to the simulation

A simulation knows its physics, but no method, counter or clock. A flow, a system of equations and a stranger's partial
differential equation are three kinds of simulation; nothing after the case knows which of them it has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Generator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import numpy as np
import pandas as pd

from nlsolve.contracts.component import Component
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.series import Array


class Entry(Protocol):
    """`with entry("operators"): …` counts and times work of one kind in the ledger of the case."""

    def __call__(self, kind: str) -> AbstractContextManager[None]: ...


@dataclass(frozen=True)
class Preparation:
    """How a problem on the way to the first state is solved; the work is counted apart from that of the case's method.

    solver : the method.
    tolerance : largest relative residual accepted.
    iterations : steps allowed.
    refresh : when K* is renewed; None: at each iteration. A solve after another one with the same rule keeps its K*.
    """

    solver: NonlinearSolver
    tolerance: float
    iterations: int
    refresh: RefreshRule | None = None


@dataclass(frozen=True)
class Solve:
    """One problem that a simulation hands to the driver.

    start : u_0, shape (U,).
    increment : number of the increment; 0 for a steady or first state.
    time : time at the end of the increment [s].
    preparation : how a problem on the way to the first state is solved; None when the method of the case solves it.
    """

    problem: NonlinearProblem
    start: Array
    increment: int = 0
    time: float = 0.0
    preparation: Preparation | None = None


@dataclass(frozen=True)
class Workload:
    """The amount of work from which a forecast computes the seconds of a case.

    increments : solves by the method of the case.
    discretizations : how often operators are built.
    stages : solves on the way to the first state.
    """

    increments: int = 1
    discretizations: int = 0
    stages: int = 0


class Simulation(ABC):
    """The problems of one case, in order, and what is measured on the states that solve them.

    increments : number of increments (time steps); 0 for a steady state.
    prepares : whether there are solves on the way to the first state.
    sizes : columns of `runs` for the size of the case, such as `unknowns`; None for a size that is not known yet.
    """

    increments: int = 0
    prepares: bool = False
    sizes: Mapping[str, Any] = MappingProxyType({})

    @abstractmethod
    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        """Yields problems, is sent the outcome of each, and returns the outcome of the case. May raise SolveError."""

    @abstractmethod
    def sample(self) -> tuple[NonlinearProblem, Array]:
        """A problem of the case and a state (U,) for it, on which the cost of work is timed. Nothing is iterated.

        May raise SolveError.
        """

    def keep(self, solve: Solve, state: Array) -> Mapping[str, float]:
        """Keeps a state (U,) that solves its problem; returns columns of `steps` for the step that reached it."""
        return {}

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """Columns of `runs` besides `sizes`, measured on the last state kept; also called when the case has failed."""
        return {}

    def fields(self) -> pd.DataFrame:
        """Rows of `fields` recorded so far."""
        return pd.DataFrame()

    def place(self, blame: Mapping[str, float]) -> str:
        """Words for the place that the columns `blame_…` give; empty when the columns say enough."""
        return ""

    def workload(self) -> Workload:
        """The amount of work that the case will take; called before anything is solved."""
        return Workload()

    def diagnostics(self) -> list[dict[str, Any]]:
        """One row for each operator on the quality of the discretisation (columns `DIAGNOSTICS`); empty without one."""
        return []


def state_rows(state: Array) -> pd.DataFrame:
    """A row of `fields` for each unknown of a state (U,)."""
    return pd.DataFrame({"unknown": np.arange(len(state)), "value": state})


class SingleSolve(Simulation):
    """The simulation of one problem: R(u) = 0 from `start` (U,).

    measure : u -> columns of `runs`, called with the last state u (U,).
    """

    def __init__(
        self,
        problem: NonlinearProblem,
        start: Array,
        measure: Callable[[Array], Mapping[str, Any]] = lambda u: {},
    ) -> None:
        self.problem, self.start, self.measure = problem, start, measure
        self.sizes = {"unknowns": len(start)}
        self.reached = np.zeros(0)

    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        """Yields the one problem; its outcome is that of the case."""
        outcome = yield Solve(self.problem, self.start)
        self.reached = outcome.state
        return outcome

    def fields(self) -> pd.DataFrame:
        """The state that the solve ended at."""
        return state_rows(self.reached)

    def sample(self) -> tuple[NonlinearProblem, Array]:
        """The problem and its start."""
        return self.problem, self.start

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """The columns that `measure` gives for the state of the outcome."""
        return self.measure(outcome.state)


@dataclass(frozen=True)
class Section:
    """A section of a study file that a scene needs.

    contract : the class of its component. When the contract has kinds, a study chooses any installed one.
    default : the table that completes a section without a kind; None: the default kind of the contract.
    of : name of another section. The class of its component gives the default of this section in its attribute
        `default_SECTION`; None there leaves this section without a component.
    """

    contract: type[Component]
    default: Mapping[str, Any] | None = None
    of: str = ""

    @property
    def default_table(self) -> Mapping[str, Any] | None:
        """`default`, or else a table with the default kind of the contract; None when a study must name a kind."""
        if self.default is None and self.contract.default_kind is not None:
            return {"kind": self.contract.default_kind}
        return self.default


class Misfit(ValueError):
    """Components of a case do not fit together. Names the section and field to change, and what is expected there."""

    def __init__(self, section: str, field: str, expected: str) -> None:
        super().__init__(f"{section}.{field}: {expected}")
        self.section, self.field, self.expected = section, field, expected


class Scene(Component, ABC):
    """What is simulated. Its class declares in `sections` what it needs beside `scene` and the sections of every case
    (linear, solver, refresh, operator, stop, budget, record); a declaration under one of these names replaces the
    default.

    class Heat(Scene):
        kind: Literal["heat"] = "heat"
        power: float = 3.0

        def simulation(self, parts, entry):
            with entry("operators"):
                problem = HeatProblem(self.power)
            return SingleSolve(problem, np.zeros(problem.size))
    """

    noun: ClassVar[str] = "scene"
    sections: ClassVar[Mapping[str, Section]] = {}

    @abstractmethod
    def simulation(self, parts: Any, entry: Entry) -> Simulation:
        """The simulation of a case.

        parts : has the component of each section as an attribute of that name.
        entry : times work outside the method, such as building operators, in the ledger of the case.
        """

    def way(self, parts: Any) -> Collection[str]:
        """The sections on which the way to the first state depends, so that cases which agree in them share it; empty
        where there is none.
        """
        return ()

    def check(self, parts: Any) -> None:
        """Raises Misfit when components, each valid by itself, do not fit together."""
