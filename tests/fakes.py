"""Components that compute nothing, and a registry and a study of them: what floors 3 to 5 need to be tested fast."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from cases import FlowCase
from pydantic import Field
from scipy.sparse import csc_array

from nlsolve import Outcome, Status
from nlsolve.plugin import (
    Cloud,
    Component,
    ConstitutiveLaw,
    Discretizer,
    Factors,
    FlowScene,
    IterationOperator,
    LinearSolver,
    NonlinearSolver,
    Operators,
    PointOperators,
    Predictor,
    RefreshRule,
    Step,
    TangentHistory,
    hookimpl,
)
from nlsolve.registry.registry import Registry
from nlsolve.solving.simulate import Progress, Record


class Even(Component):
    """Nodes on a line."""

    kind: Literal["even"] = "even"
    count: int = Field(4, gt=2, description="nodes")


class Random(Component):
    """Nodes anywhere."""

    kind: Literal["random"] = "random"
    seed: int = 0


class Box(FlowScene):
    """A flow with nested kinds."""

    kind: Literal["box"] = "box"
    side: Literal["left", "right"] = "left"
    nodes: Annotated[Even | Random, Field(discriminator="kind")] = Even()

    def way(self, parts: Any) -> tuple[str, ...]:
        """No case waits for the first state of another."""
        return ()

    @property
    def reference_rate(self) -> float:
        return 1.0

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        return Cloud(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.3]]), {"wall": np.array([0, 1, 2])})

    def boundary_position(self, cloud: Cloud, time: float) -> Any:
        return cloud.nodes[cloud.boundary]

    def boundary_velocity(self, cloud: Cloud, law: ConstitutiveLaw, time: float) -> Any:
        return np.zeros((len(cloud.boundary), 2))


class Honey(ConstitutiveLaw):
    """A law with an index."""

    kind: Literal["honey"] = "honey"
    continued_by: ClassVar = {"index": "larger"}
    index: float = Field(0.5, gt=0, description="n")

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 + 0.0 * rate_squared


class Grid(Discretizer):
    """Operators of the identity."""

    default_error_estimator: ClassVar[None] = None

    kind: Literal["grid"] = "grid"
    width: float | Literal["auto"] = "auto"

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        strain = csc_array(np.eye(6, 8, 2))
        return Operators(PointOperators(strain, csc_array(np.eye(2, 6, 4)), cloud.nodes[:2]))

    def gradient(self, cloud: Cloud) -> tuple[Any, Any]:
        return csc_array((4, 4)), csc_array((4, 4))

    def values(self, sources: Any, targets: Any) -> Any:
        return csc_array((len(targets), len(sources)))


class Dense(LinearSolver):
    """Stands in for the default linear solver."""

    kind: Literal["auto"] = "auto"

    def factorize(self, matrix: Any, previous: Factors | None = None) -> Factors:
        class Same(Factors):
            def solve(self, rhs: Any) -> Any:
                return rhs

        return Same()


class Newton(NonlinearSolver):
    """Stands in for Newton, and for the starting method."""

    kind: Literal["newton"] = "newton"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        yield Step(start)


class Homotopy(NonlinearSolver):
    """A solver that claims, with a default rule of its own."""

    kind: Literal["anm"] = "anm"
    default_refresh: ClassVar[Mapping[str, Any]] = {"kind": "every-m", "m": 3}
    claims: ClassVar[bool] = True
    order: int = Field(20, ge=2, description="p")
    tolerance: float = Field(1e-6, gt=0, description="η")

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        yield Step(start, claim=True)


class EveryIteration(RefreshRule):
    """The default rule."""

    kind: Literal["every-iteration"] = "every-iteration"

    def due(self, history: TangentHistory) -> bool:
        return True


class TangentHere(IterationOperator):
    """The default operator."""

    kind: Literal["tangent"] = "tangent"
    is_tangent: ClassVar[bool] = True

    def matrix(self, problem: Any, u: Any) -> Any:
        return problem.jacobian(u)


class EveryM(RefreshRule):
    """A rule with a parameter."""

    kind: Literal["every-m"] = "every-m"
    m: int = Field(5, gt=0, description="uses")

    def due(self, history: TangentHistory) -> bool:
        return history.uses >= self.m


class Previous(Predictor):
    """The default predictor."""

    kind: Literal["previous"] = "previous"

    @property
    def depth(self) -> int:
        return 1

    def guess(self, past: Any) -> Any:
        return past[0]


COMPONENTS = (Box, Honey, Grid, Dense, Newton, Homotopy, EveryIteration, EveryM, TangentHere, Previous)


class Plugin:
    """An object with the hook, as a module would be."""

    def __init__(self, *offered: Any) -> None:
        self.offered = offered

    @hookimpl
    def nlsolve_components(self) -> Any:
        return list(self.offered)


def registry_of(*offered: Any) -> Registry:
    """A registry of these classes only."""
    registry = Registry()
    registry.add(Plugin(*(offered or COMPONENTS)), "fakes 1.0")
    return registry


STUDY = """\
question = "How many branches?"

[scene]
kind = "box"

[law]
kind = "honey"

[discretizer]
kind = "grid"

[solver]
kind = "anm"

[[sweep]]
grid = { "solver.order" = [10, 20], "solver.tolerance" = [1e-6, 1e-8] }

[[table]]
name = "branches"
rows = "solver.order"
columns = "solver.tolerance"
value = "tangents"

[quick]
"scene.side" = "right"
sweep = [{ grid = { "solver.order" = [10] } }]
"""


def write_study(folder: Path, *changes: tuple[str, str], text: str = STUDY) -> Path:
    """The study in a file of its own, with pieces of its text replaced."""
    for old, new in changes:
        assert old in text, f"{old!r} is not in the study"
        text = text.replace(old, new)
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def fake_march(
    parts: FlowCase,
    listen: Callable[[Progress], None] | None = None,
    clock: Callable[[], float] | None = None,
    **way: Any,
) -> Record:
    """A record whose numbers follow from the solver's parameters; there is no way to a first state."""
    order, tolerance = getattr(parts.solver, "order", 1), getattr(parts.solver, "tolerance", 1.0)
    if listen is not None:
        listen(Progress(1, 2, 3, 4))
    steps = pd.DataFrame({"increment": [0, 1], "time": [0.0, 0.1], "accepted": [True, True], "range": [1.5, np.nan]})
    fields = pd.DataFrame({"time": [0.1, 0.1], "node": [0, 1], "u": [1.0, 2.0]})
    tangents = round(-np.log10(tolerance)) * 100 // order
    summary = {"status": "converged", "message": "the stopping test was met", "tangents": tangents, "ordering": None}
    outcome = Outcome(Status.CONVERGED, Status.CONVERGED.sentence, np.zeros(1), 0.0)
    return Record({**summary, "factorizations": 2, "velocity_error": float("nan")}, outcome, steps, fields)


def solver_text(kind: str) -> str:
    """The text of a plugin of one file with Newton's method under another kind, which also offers it by the hook."""
    name = kind.capitalize()
    return f"""
from typing import Literal
from nlsolve.plugin import NonlinearSolver, Step, hookimpl

class {name}(NonlinearSolver):
    kind: Literal["{kind}"] = "{kind}"

    def steps(self, problem, tangent, start):
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - tangent.solve(problem.residual(state))

@hookimpl
def nlsolve_components():
    return [{name}]
"""
