"""What K* is made of: theory on small problems, conformance, memory of a march, operators that cannot be used."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import pytest
import scipy.sparse as sp
from cases import PLAIN, SystemParts, near, setup, spin_flow
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import NortonHoff, PowerLaw
from nlsolve_rules import OPERATORS
from nlsolve_rules.operators import (
    Diagonal,
    FirstTangent,
    Mass,
    Newtonian,
    OtherDiscretization,
    PreviousTangent,
    Secant,
    TangentHere,
)
from nlsolve_rules.refresh import AverageCost, EveryIteration, EveryM, Never, PoorContraction, RangeUnderOne
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import (
    Anderson,
    AsymptoticNumericalMethod,
    Broyden,
    LevenbergMarquardt,
    Newton,
    NewtonKrylov,
    Picard,
    PseudoTransient,
    Robust,
    TrustRegion,
)
from nlsolve_solvers.external import ScipyRoot
from nlsolve_solvers.homotopy.branch import Branch
from nlsolve_solvers.homotopy.forms import FixedPoint, NewtonForm
from nlsolve_solvers.modified_newton import ModifiedNewton

import nlsolve
from nlsolve import InputError, Status
from nlsolve.contracts.outcome import Outcome
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import (
    Component,
    Expansion,
    HomotopyForm,
    IterationOperator,
    NodeMotion,
    NonlinearProblem,
    NonlinearSolver,
    RefreshRule,
    Series,
    TimeSteps,
)
from nlsolve.solving.driver import solve
from nlsolve.solving.matrices import CheckedOperator, checked
from nlsolve.solving.simulate import run_case
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_operator
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
TIGHT = StoppingTest(tolerance=1e-11)
OF_FLOWS = ("newtonian", "other-discretization")
KEEPERS: tuple[NonlinearSolver, ...] = (
    Newton(),
    ModifiedNewton(),
    Broyden(),
    Anderson(),
    NewtonKrylov(),
    NewtonKrylov(products="jacobian"),
    TrustRegion(),
    ScipyRoot(),
    AsymptoticNumericalMethod(order=10),
)
OWNERS: tuple[NonlinearSolver, ...] = (Picard(), PseudoTransient(), LevenbergMarquardt(), Robust())


def toy(
    solver: NonlinearSolver,
    operator: IterationOperator,
    rule: RefreshRule | None = None,
    problem: NonlinearProblem | None = None,
    stop: StoppingTest = TIGHT,
    start: Any = START,
) -> tuple[Outcome, Ledger]:
    """One solve of the toy problem, or of another, with K* made by an operator."""
    ledger = Ledger()
    tangent = Tangent(DenseLU(), rule or Never(), ledger, operator=checked(operator))
    return solve(problem or ToyProblem(), solver, tangent, start, stop, Budget(iterations=400), ledger), ledger


def name(component: Any) -> str:
    return " ".join(map(str, component.model_dump().values())) if isinstance(component, Component) else str(component)


# Theory.


class Linear(ToyProblem):
    """A u = b."""

    def residual(self, u: Any) -> Any:
        return self.matrix @ u - self.matrix @ self.solution

    def jacobian(self, u: Any) -> Any:
        return self.matrix

    def expand(self, u: Any) -> Expansion:
        path = Series(u)
        return Expansion(path, self.residual(path))


def test_a_scaled_diagonal_is_jacobis_iteration():
    outcome, ledger = toy(Newton(), Diagonal(), Never(), Linear(), StoppingTest(tolerance=1e-6))
    state = START
    for _ in range(len(outcome.rows) - 1):
        state = state - Linear().residual(state) / Linear.matrix.diagonal()
    assert outcome.status is Status.CONVERGED
    assert np.abs(outcome.state - state).max() < 1e-14
    assert ledger.counts["factorization"] == ledger.counts["jacobian"] == 1


@pytest.mark.parametrize(("operator", "rate"), [(Mass(scale=6.0), 4.0 / 6.0), (Diagonal(), 0.5)], ids=name)
def test_the_chord_iteration_converges_on_a_dominant_diagonal(operator: IterationOperator, rate: float):
    """The eigenvalues of A are in (2, 6), so 1 − λ/6 < 4/6; half of a row's diagonal is off it."""
    outcome, _ = toy(Newton(), operator, Never(), Linear())
    assert outcome.status is Status.CONVERGED
    assert outcome.rows[-1]["contraction"] <= rate + 1e-6
    nonlinear, _ = toy(Newton(), operator.with_(scale=8.0 if operator.kind == "mass" else 1.0), Never())
    assert nonlinear.status is Status.CONVERGED
    assert np.abs(nonlinear.state - ToyProblem.solution).max() < 1e-10


@pytest.mark.parametrize("rule", [EveryIteration(), EveryM(m=3), Never()], ids=name)
def test_modified_newton_with_the_secant_is_picards_iteration(rule: RefreshRule):
    flow = spin_flow(0.7)
    stop = StoppingTest(tolerance=1e-8)
    chord, ledger = toy(Newton(globalization={"kind": "none"}), Secant(), rule, flow, stop, near(flow, 0.72))
    picard, own = toy(Picard(), TangentHere(), rule, flow, stop, near(flow, 0.72))
    assert chord.status is picard.status is Status.CONVERGED
    assert np.array_equal(chord.state, picard.state)
    assert ledger.counts == own.counts


@pytest.mark.parametrize("solver", KEEPERS, ids=name)
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(limit=0.1), AverageCost(ratio=2.0)], ids=name)
def test_the_tangent_as_a_strangers_operator_changes_no_number(solver: NonlinearSolver, rule: RefreshRule):
    """J(u) by another name goes through the checks of an operator and gives the same states."""

    class Same(IterationOperator):
        kind: Literal["same"] = "same"

        def matrix(self, problem: NonlinearProblem, u: Any) -> Any:
            return problem.jacobian(u)

    default, ledger = toy(solver, TangentHere(), rule)
    other, books = toy(solver, Same(), rule)
    assert default.status is other.status is Status.CONVERGED
    assert np.array_equal(default.state, other.state)
    assert ledger.counts["factorization"] == books.counts["factorization"]
    assert ledger.counts["triangular_solve"] == books.counts["triangular_solve"]
    assert books.counts["jacobian"] >= ledger.counts["jacobian"]


@pytest.mark.parametrize("form", [FixedPoint(), NewtonForm()], ids=lambda form: form.kind)
@pytest.mark.parametrize("operator", [Mass(scale=7.0), Mass(scale=30.0), Diagonal(scale=1.3), TangentHere()], ids=name)
@pytest.mark.parametrize("p", [1, 2, 5, 12])
def test_on_a_linear_problem_the_homotopy_is_richardsons_iteration(
    operator: IterationOperator, p: int, form: HomotopyForm
):
    """W(1) = W_1 + … + W_p is what p steps u ← u − K*⁻¹ R(u) add, whatever K* is."""
    ledger = Ledger()
    tangent = Tangent(DenseLU(), Never(), ledger, operator=checked(operator))
    problem = CountedProblem(Linear(), ledger, tangent.operator)
    tangent.refresh_if_due(lambda: problem.operator(START))
    branch = Branch(problem, START, form, "series")
    for _ in range(p):
        rhs = branch.recurrence.right_hand_side()
        branch.append(rhs, tangent.solve(rhs))
    state = START
    for _ in range(p):
        state = state - tangent.solve(Linear().residual(state))
    assert np.abs(START + branch.increment(1.0) - state).max() <= 1e-12


@pytest.mark.parametrize("solver", KEEPERS, ids=name)
@pytest.mark.parametrize("operator", [Diagonal(), Mass(scale=8.0), Secant(), FirstTangent()], ids=name)
def test_every_method_that_keeps_k_solves_with_any(solver: NonlinearSolver, operator: IterationOperator):
    outcome, _ = toy(solver, operator, RangeUnderOne() if solver.kind == "anm" else PoorContraction())
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert np.abs(outcome.state - ToyProblem.solution).max() < 1e-9


# Conformance and memory.


@pytest.mark.parametrize("operator", [cls() for cls in OPERATORS if cls().kind not in OF_FLOWS], ids=name)
def test_the_operators_keep_their_contract(operator: IterationOperator):
    check_operator(operator)


@pytest.mark.parametrize("operator", [cls() for cls in OPERATORS], ids=name)
def test_the_operators_keep_their_contract_on_a_flow(operator: IterationOperator):
    flow = spin_flow(0.5)
    flow = Flow(flow.cloud, flow.operators, flow.law, boundary(flow), reference_rate=100.0)
    check_operator(operator, flow, near(flow, 0.52))


def boundary(flow: Flow) -> Any:
    return flow.velocity(np.zeros(2 * len(flow.cloud.interior)))[flow.cloud.boundary]


def test_the_check_finds_a_memory_in_the_component():
    class Drifting(IterationOperator):
        kind: Literal["drifting"] = "drifting"
        asked: ClassVar[list[int]] = []

        def matrix(self, problem: NonlinearProblem, u: Any) -> Any:
            self.asked.append(1)
            return float(len(self.asked)) * problem.jacobian(u)

    with pytest.raises(AssertionError, match=r"the K\* of a second march: off by"):
        check_operator(Drifting())


def test_the_check_finds_a_singular_k_and_a_false_tangent():
    class Nothing(IterationOperator):
        kind: Literal["nothing"] = "nothing"

        def matrix(self, problem: NonlinearProblem, u: Any) -> Any:
            return np.zeros((3, len(u)))

    class False_(IterationOperator):
        kind: Literal["false"] = "false"
        is_tangent: ClassVar[bool] = True

        def matrix(self, problem: NonlinearProblem, u: Any) -> Any:
            return 2.0 * problem.jacobian(u)

    with pytest.raises(AssertionError, match=r"no K\* to iterate with: .*'nothing' gave a K\* of shape \(3, 12\)"):
        check_operator(Nothing())
    with pytest.raises(AssertionError, match="said to be the tangent"):
        check_operator(False_())


def test_the_first_tangent_is_assembled_and_factorised_once():
    far = START + 2.0
    outcome, ledger = toy(Newton(), FirstTangent(), EveryIteration(), start=far)
    never, kept = toy(Newton(), TangentHere(), Never(), start=far)
    assert outcome.status is Status.CONVERGED
    assert np.array_equal(outcome.state, never.state)
    assert ledger.counts == kept.counts
    assert ledger.counts["factorization"] == 1


def test_a_renewal_that_cannot_be_given_is_said():
    outcome, _ = toy(Newton(globalization={"kind": "none"}), Mass(scale=0.5), EveryIteration())
    assert outcome.status is Status.DIVERGED
    assert "the refresh rule asked for a new K*, and the operator 'mass' has no other" in outcome.detail


def test_the_previous_tangent_is_that_of_the_last_solution():
    assembly = PreviousTangent().begin()
    here, there = ToyProblem(), Linear()
    assert assembly.renewable
    assert np.array_equal(assembly.matrix(here, START).toarray(), here.jacobian(START).toarray())
    assert assembly.renewable  # before anything has been solved it is the tangent here
    assembly.solved(there, START)
    assert np.array_equal(assembly.matrix(here, 2.0 * START).toarray(), there.jacobian(START).toarray())
    assert not assembly.renewable
    assembly.solved(here, START)
    assert assembly.renewable
    assert np.array_equal(assembly.matrix(there, START).toarray(), here.jacobian(START).toarray())


@pytest.mark.parametrize("operator", [PreviousTangent(), FirstTangent(), TangentHere()], ids=name)
def test_a_march_remembers_across_its_increments(operator: IterationOperator):
    parts = setup(
        StirringTool(nodes=Rings(spacing=0.75)),
        time=TimeSteps(horizon=3e-4, increment=1e-4),
        motion=NodeMotion(nodes="lagrangian"),
        operator=operator,
        solver=Newton(),
        refresh=EveryIteration(),
    )
    row = run_case(parts).summary
    assert (row["status"], row["increments"]) == ("converged", 3)
    expected = {"first-tangent": 1, "previous-tangent": 3, "tangent": row["iterations"]}[operator.kind]
    assert row["tangents"] == row["jacobians"] == row["factorizations"] == expected


# Operators of flows.


def test_the_newtonian_operator_is_the_tangent_of_a_newtonian_material():
    flow = spin_flow(0.3)
    u = near(flow, 0.32)
    viscosity = float(flow.law.viscosity(np.array([50.0**2]))[0])
    material = NortonHoff(consistency=viscosity, index=1.0)
    scale = viscosity / float(material.viscosity(np.array([1.0]))[0])
    newtonian = Flow(flow.cloud, flow.operators, material.with_(consistency=scale * viscosity), boundary(flow))
    expected = newtonian.jacobian(u).toarray()
    found = Newtonian(rate=50.0).matrix(flow, u).toarray()
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


def test_the_newtonian_rate_is_the_scenes_when_left_out():
    parts = setup(StirringTool(nodes=Rings(spacing=0.75)), index=0.9, operator=Newtonian())
    given = setup(parts.scene, index=0.9, operator=Newtonian(rate=parts.scene.reference_rate))
    rows = [run_case(part).summary for part in (parts, given)]
    assert rows[0]["iterations"] == rows[1]["iterations"]
    assert rows[0]["residual_norm"] == rows[1]["residual_norm"]
    assert rows[0]["status"] == "converged"


@pytest.mark.parametrize("form", ["strong", "conservative"])
def test_another_discretization_preconditions_in_the_units_of_the_residual(form: str):
    scene = StirringTool(nodes=Rings(spacing=0.5))
    law = PowerLaw(index=0.8, regularization=1e-2)
    cloud = scene.cloud(law)
    wall = scene.boundary_velocity(cloud, law, 0.0)
    flow = Flow(cloud, MovingLeastSquares(form=form).operators(cloud, True), law, wall, 10.0)
    u = near(flow, 0.82)
    own, other = flow.jacobian(u), flow.jacobian_by(LinearTriangles(), u)
    eigenvalues = np.linalg.eigvals(np.linalg.solve(other.toarray(), own.toarray()))
    assert 0.3 < np.median(eigenvalues.real) < 3.0
    same = flow.jacobian_by(MovingLeastSquares(form=form), u)
    assert np.abs(same - own).max() <= 1e-12 * np.abs(own).max()


def test_a_problem_without_what_the_operator_needs_is_a_row():
    for operator in (Newtonian(), OtherDiscretization()):
        outcome, _ = toy(ModifiedNewton(), operator)
        assert outcome.status is Status.NOT_APPLICABLE
        assert "ToyProblem" in outcome.detail
        assert "choose another operator" in outcome.detail
    flow = spin_flow(0.5)
    outcome, _ = toy(ModifiedNewton(), Newtonian(), problem=flow, start=near(flow, 0.52))
    assert outcome.status is Status.NOT_APPLICABLE
    assert outcome.detail == "this flow has no reference rate: give the rate of the Newtonian operator"


# Methods with a matrix of their own.


@pytest.mark.parametrize("solver", OWNERS, ids=name)
def test_a_method_with_a_matrix_of_its_own_refuses(solver: NonlinearSolver):
    outcome, ledger = toy(solver, Diagonal())
    assert outcome.status is Status.NOT_APPLICABLE
    assert f"{type(solver).__name__} factorises a matrix of its own, in which the operator 'diagonal' has no say" in (
        outcome.detail
    )
    assert "modified-newton" in outcome.detail
    assert ledger.counts["factorization"] == 0
    assert toy(solver, TangentHere(), EveryIteration())[0].status is Status.CONVERGED


def test_without_preconditioning_there_is_no_k():
    outcome, _ = toy(ScipyRoot(precondition=False), Diagonal())
    assert outcome.status is Status.NOT_APPLICABLE
    assert "set precondition = true, or leave `operator` at its default" in outcome.detail


# Bad input.


class Planted(IterationOperator):
    """Gives what it is told to."""

    kind: Literal["planted"] = "planted"
    fault: str

    def matrix(self, problem: NonlinearProblem, u: Any) -> Any:
        size = len(u)
        identity = np.eye(size)
        hole = identity.copy()
        hole[3, 3] = 0.0
        hollow = identity.copy()
        hollow[2, 5] = np.nan
        return {
            "singular": hole,
            "flat": sp.csr_array(identity[:, 1:]),
            "small": sp.csr_array(identity[1:, 1:]),
            "nan": hollow,
            "infinite": sp.csr_array(np.inf * identity[:1].T @ identity[:1]),
            "a word": "K*",
            "nothing": None,
            "vector": identity[0],
        }[self.fault]


FAULTS = {
    "singular": (Status.SINGULAR_TANGENT, "gave a K* that cannot be used ("),
    "flat": (Status.NOT_APPLICABLE, "gave a K* of shape (12, 11), which is not square"),
    "small": (Status.NOT_APPLICABLE, "gave a K* of 11 unknowns for a problem of 12"),
    "nan": (Status.NON_FINITE, "gave a K* with numbers that are not finite"),
    "infinite": (Status.NON_FINITE, "gave a K* with numbers that are not finite"),
    "a word": (Status.NOT_APPLICABLE, "gave a str, which is no matrix"),
    "nothing": (Status.NOT_APPLICABLE, "gave a NoneType, which is no matrix"),
    "vector": (Status.NOT_APPLICABLE, "gave a ndarray, which is no matrix"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("solver", [ModifiedNewton(), AsymptoticNumericalMethod()], ids=name)
def test_a_k_that_cannot_be_used_is_one_sentence(fault: str, solver: NonlinearSolver):
    status, sentence = FAULTS[fault]
    ledger = Ledger()
    tangent = Tangent(PLAIN, PoorContraction(), ledger, operator=CheckedOperator(Planted(fault=fault)))
    outcome = solve(ToyProblem(), solver, tangent, START, TIGHT, Budget(), ledger)
    assert outcome.status is status
    assert outcome.detail.startswith("the operator 'planted' " + sentence)
    assert outcome.detail.endswith('correct it, or leave `operator` at its default, "tangent"')
    assert "\n" not in outcome.detail


def test_a_kept_k_of_another_size_is_one_sentence():
    class Half(Linear):
        matrix = ToyProblem.matrix[:6, :6]
        solution = ToyProblem.solution[:6]

    ledger = Ledger()
    tangent = Tangent(DenseLU(), Never(), ledger, operator=checked(FirstTangent()))
    stop, budget = StoppingTest(), Budget()
    assert solve(Linear(), ModifiedNewton(), tangent, START, stop, budget, ledger).status is Status.CONVERGED
    outcome = solve(Half(), ModifiedNewton(), tangent, START[:6], stop, budget, ledger)
    assert outcome.status is Status.NOT_APPLICABLE
    assert "'first-tangent' keeps a K* of 12 unknowns, and the problem has 6 now" in outcome.detail


# Doors.


def test_from_python_by_kind_table_and_instance():
    def formula(u: Any) -> Any:
        return 4.0 * u + np.sin(u) - 1.0

    start = np.zeros(3)
    for operator in ("diagonal", {"kind": "mass", "scale": 5.0}, Mass(scale=5.0)):
        outcome = nlsolve.solve(formula, start, "modified-newton", operator=operator)
        assert outcome.status is Status.CONVERGED
        assert np.abs(formula(outcome.state)).max() < 1e-7
    rows = nlsolve.compare(formula, start, ["modified-newton", "picard"], operator="diagonal")
    assert list(rows["status"]) == ["converged", "not applicable"]
    with pytest.raises(InputError, match=r"operator.*'diagnal'.*no such operator; did you mean 'diagonal'"):
        nlsolve.solve(formula, start, operator="diagnal")


def test_a_case_without_the_section_has_the_tangent():
    assert SystemParts(scene=StirringTool()).operator == TangentHere()
    document = {"question": "?", "scene": {"kind": "published", "problem": "powell-singular"}}
    study = nlsolve.Study.from_dict(document)
    assert study.cases[0].parameters["operator.kind"] == "tangent"
