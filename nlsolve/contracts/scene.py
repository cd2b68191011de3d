"""What a study's [scene] is: a component that builds the simulation of a case. The contract of scenes and simulations.

    outcome = None
    for each problem that the simulation yields:        Solve(R, u_0)
        outcome = driver.solve(R, method, K*, u_0)       and back to the simulation

A simulation knows its physics and nothing of methods, counters or clocks; a flow, a system of equations and a
stranger's partial differential equation are three of them, and nothing after the case knows which.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import pandas as pd

from nlsolve.contracts.component import Component
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array


class Entry(Protocol):
    """`with entry("operators"): …` counts and times work of one kind in the books of the case."""

    def __call__(self, kind: str) -> AbstractContextManager[None]: ...


@dataclass(frozen=True)
class Preparation:
    """A solve on the way to the first state: by its own method, with a new tangent each iteration, counted apart."""

    solver: NonlinearSolver
    tolerance: float
    iterations: int


@dataclass(frozen=True)
class Solve:
    """One problem for the driver.

    start : u_0, shape (U,).
    increment, time : number of the time step, 0 for a steady state, and the time at its end [s].
    preparation : set on the way to the first state; None: the method of the case solves this.
    """

    problem: NonlinearProblem
    start: Array
    increment: int = 0
    time: float = 0.0
    preparation: Preparation | None = None


@dataclass(frozen=True)
class Workload:
    """What a forecast reckons with: increments, discretisations built, and solves on the way to the first state."""

    increments: int = 1
    discretizations: int = 0
    stages: int = 0


class Simulation(ABC):
    """The problems of one case, in order, and what is measured on the states that solve them.

    increments : time steps wanted; 0 for a steady state.
    prepares : whether there are solves on the way to the first state.
    sizes : columns of `runs` for the size of the case, such as `unknowns`, as far as it is known by now.
    """

    increments: int = 0
    prepares: bool = False
    sizes: Mapping[str, Any] = MappingProxyType({})

    @abstractmethod
    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        """Yields problems, is sent how each ended, and returns how the case ended. May raise SolveError."""

    @abstractmethod
    def sample(self) -> tuple[NonlinearProblem, Array]:
        """A problem of the case and a state for it, to time work on; nothing is iterated. May raise SolveError."""

    def keep(self, solve: Solve, state: Array) -> Mapping[str, float]:
        """A state (U,) that solves the problem; returns columns of `steps` for the step that reached it."""
        return {}

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        """Columns of `runs` besides `sizes`, for the last state kept, whatever the ending of the case."""
        return {}

    def fields(self) -> pd.DataFrame:
        """Rows of `fields` recorded so far."""
        return pd.DataFrame()

    def place(self, blame: Mapping[str, float]) -> str:
        """Where the residual is largest, in words, from the columns `blame_…`; empty where they say it."""
        return ""

    def workload(self) -> Workload:
        """Told before anything is solved."""
        return Workload()

    def diagnostics(self) -> list[dict[str, Any]]:
        """How good the discretisation is, a row an operator (columns `DIAGNOSTICS`); empty: there is none to judge."""
        return []


class SingleSolve(Simulation):
    """R(u) = 0 from one start, with columns of `runs` measured on the solution u (U,)."""

    def __init__(
        self,
        problem: NonlinearProblem,
        start: Array,
        measure: Callable[[Array], Mapping[str, Any]] = lambda u: {},
    ) -> None:
        self.problem, self.start, self.measure = problem, start, measure
        self.sizes = {"unknowns": len(start)}

    def solves(self) -> Generator[Solve, Outcome, Outcome]:
        return (yield Solve(self.problem, self.start))

    def sample(self) -> tuple[NonlinearProblem, Array]:
        return self.problem, self.start

    def measured(self, outcome: Outcome) -> Mapping[str, Any]:
        return self.measure(outcome.state)


@dataclass(frozen=True)
class Section:
    """A section of a study file that a scene asks for.

    contract : what is written there; of a contract with kinds, any installed kind.
    default : the table that a section without a kind is completed with; None: the contract's own default kind.
    of : another section, whose class names the default of this one as `default_SECTION`; None there: no such component.
    """

    contract: type[Component]
    default: Mapping[str, Any] | None = None
    of: str = ""

    @property
    def default_table(self) -> Mapping[str, Any] | None:
        """What is written there by default: `default`, else the contract's own default kind."""
        if self.default is None and self.contract.default_kind is not None:
            return {"kind": self.contract.default_kind}
        return self.default


class Misfit(ValueError):
    """Sections of a case that do not fit together: the section and field to change, and what was expected there."""

    def __init__(self, section: str, field: str, expected: str) -> None:
        super().__init__(f"{section}.{field}: {expected}")
        self.section, self.field, self.expected = section, field, expected


class Scene(Component, ABC):
    """What is simulated. Its class declares the sections it needs beside `scene` and those of every case (linear,
    solver, refresh, stop, budget); a declared name of those replaces their default.

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
        """The simulation of a case. `parts` has the component of each section under its name."""

    def check(self, parts: Any) -> None:
        """Raises Misfit where components that are valid each for itself do not fit together."""
