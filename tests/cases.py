"""Small flows and systems that several tests share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import Bingham, CarreauYasuda, Cross, HerschelBulkley, NortonHoff, PowerLaw, SellarsTegart
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.operators import TangentHere
from nlsolve_rules.predictors import Previous
from nlsolve_rules.refresh import EveryIteration
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton
from nlsolve_systems import Published

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.recording import IterateRecording, SystemStart
from nlsolve.flow.continuation import Start
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import (
    ConstitutiveLaw,
    Discretizer,
    IterationOperator,
    LinearSolver,
    NodeMotion,
    NonlinearProblem,
    NonlinearSolver,
    Physics,
    Predictor,
    Recording,
    RefreshRule,
    Scene,
    TimeSteps,
)
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger

LAWS: dict[str, ConstitutiveLaw] = {
    law.kind_name(): law
    for law in (
        PowerLaw(),
        NortonHoff(),
        CarreauYasuda(),
        Cross(),
        HerschelBulkley(),
        Bingham(),
        SellarsTegart(),
    )
}
PLAIN = SuperLU(ordering="mmd-ata")  # no trials of orderings in the counts


def spin_flow(index: float, spacing: float = 0.75, regularization: float = 1e-2) -> Flow:
    """The steady spin on coarse rings."""
    scene = StirringTool(nodes=Rings(spacing=spacing))
    law = PowerLaw(index=index, regularization=regularization)
    cloud = scene.cloud(law)
    operators = MovingLeastSquares().operators(cloud, False)
    return Flow(cloud, operators, law, scene.boundary_velocity(cloud, law, 0.0))


def near(flow: Flow, index: float) -> Array:
    """The unknowns of the exact spin of another index: a start some way off, with every strain rate away from zero."""
    exact = StirringTool().exact(PowerLaw(index=index), flow.cloud.nodes, 0.0)
    assert exact is not None
    return flow.unknowns(exact.velocity)


def run(
    problem: NonlinearProblem,
    solver: NonlinearSolver,
    rule: RefreshRule | None,
    start: Array,
    linear: Any = PLAIN,
    stop: StoppingTest | None = None,
    iterations: int = 200,
) -> tuple[Outcome, Ledger]:
    """One solve under the driver, and its books."""
    ledger = Ledger()
    tangent = Tangent(linear, rule, ledger)
    test = stop or StoppingTest(tolerance=1e-10)
    return solve(problem, solver, tangent, start, test, Budget(iterations=iterations), ledger), ledger


@dataclass(frozen=True)
class FlowCase:
    """The components of a flow by the names of their sections, with the defaults of a study."""

    scene: Geometry
    law: ConstitutiveLaw
    discretizer: Discretizer
    linear: LinearSolver
    solver: NonlinearSolver
    refresh: RefreshRule
    predictor: Predictor
    error_estimator: Discretizer | None = None
    operator: IterationOperator = field(default_factory=TangentHere)
    physics: Physics = field(default_factory=Physics)
    time: TimeSteps = field(default_factory=TimeSteps)
    motion: NodeMotion = field(default_factory=NodeMotion)
    start: Start = field(default_factory=Start)
    stop: StoppingTest = field(default_factory=StoppingTest)
    budget: Budget = field(default_factory=Budget)
    record: Recording = field(default_factory=Recording)


def setup(scene: Geometry, index: float = 0.5, **parts: Any) -> FlowCase:
    """A case of a flow: Newton on the default discretisation, but for the parts given."""
    given: dict[str, Any] = {
        "law": PowerLaw(index=index, regularization=1e-3),
        "discretizer": MovingLeastSquares(),
        "linear": PLAIN,
        "solver": Newton(),
        "refresh": EveryIteration(),
        "predictor": Previous(),
        "stop": StoppingTest(tolerance=1e-10),
    }
    return FlowCase(scene=scene, **(given | parts))


@dataclass(frozen=True)
class SystemParts:
    """A case of a system, or of any scene that declares no section of its own: Newton, but for the parts given."""

    scene: Scene
    linear: LinearSolver = PLAIN
    solver: NonlinearSolver = field(default_factory=Newton)
    refresh: RefreshRule = field(default_factory=EveryIteration)
    operator: IterationOperator = field(default_factory=TangentHere)
    stop: StoppingTest = field(default_factory=StoppingTest)
    budget: Budget = field(default_factory=Budget)
    record: IterateRecording = field(default_factory=IterateRecording)
    start: SystemStart = field(default_factory=SystemStart)


class Recorded(FormulaProblem):
    """A problem that keeps the points where its residual is asked for."""

    def __init__(self, system: Published) -> None:
        super().__init__(system.formula, len(system.start()), columns=True)
        self.points: list[Array] = []

    def residual(self, u: Array) -> Array:
        self.points.append(np.array(u))
        return super().residual(u)
