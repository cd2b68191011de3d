"""Which check holds for a component, and on what it is made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nlsolve.algebra.system import System
from nlsolve.contracts.component import Component
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.nonlinear_solver import NonlinearSolver
from nlsolve.contracts.rules.globalization import Globalization
from nlsolve.contracts.rules.homotopy_form import HomotopyForm
from nlsolve.contracts.rules.operator import IterationOperator
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.rules.range_rule import RangeRule
from nlsolve.contracts.rules.refresh import RefreshRule
from nlsolve.contracts.scene import Scene
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.scene import FlowScene
from nlsolve.testing.discretizers import check_discretizer
from nlsolve.testing.kit.toys import ToyLaw, toy_cloud, toy_flow
from nlsolve.testing.kit.verdicts import Told, Verdict, verdicts
from nlsolve.testing.laws import check_law
from nlsolve.testing.linear_solvers import check_linear_solver
from nlsolve.testing.rules import (
    check_globalization,
    check_homotopy_form,
    check_operator,
    check_predictor,
    check_range_rule,
    check_refresh_rule,
)
from nlsolve.testing.scenes import check_scene, check_simulation, check_system
from nlsolve.testing.solvers import check_solver
from nlsolve.testing.toy_problem import ToyProblem


def check_operator_anywhere(operator: IterationOperator) -> None:
    """`check_operator` on the toy problem, or on a flow where the operator is made of what only flows have."""
    try:
        operator.begin().matrix(ToyProblem(), ToyProblem.solution)
    except SolveError as error:
        if error.status is Status.NOT_APPLICABLE:
            check_operator(operator, *toy_flow())
            return
    check_operator(operator)


CHECKS: dict[type[Component], Callable[[Any], None]] = {
    System: check_system,
    FlowScene: lambda scene: check_scene(scene, ToyLaw()),
    Scene: check_simulation,
    ConstitutiveLaw: check_law,
    Discretizer: lambda discretizer: check_discretizer(discretizer, toy_cloud()),
    LinearSolver: check_linear_solver,
    NonlinearSolver: check_solver,
    RefreshRule: check_refresh_rule,
    IterationOperator: check_operator_anywhere,
    Predictor: check_predictor,
    Globalization: check_globalization,
    RangeRule: check_range_rule,
    HomotopyForm: check_homotopy_form,
}
"""Contract -> its check, the narrower contracts first."""


def contract_of(cls: type[Component]) -> type[Component]:
    """The contract that a class is checked by. Raises TypeError for a class of none."""
    for contract in CHECKS:
        if issubclass(cls, contract):
            return contract
    raise TypeError(f"{cls.__name__} is of no contract: {', '.join(contract.__name__ for contract in CHECKS)}")


def verdicts_of(component: Component, told: Told | None = None) -> tuple[Verdict, ...]:
    """What is found of each promise of the component's contract, in order."""
    check = CHECKS[contract_of(type(component))]
    return verdicts(lambda: check(component), told=told)
