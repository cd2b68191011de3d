"""Newton's line search on the potential: from rest without continuation, downhill all the way, or refused."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import PLAIN, run, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_rules import Energy
from nlsolve_rules.refresh import PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton
from nlsolve_solvers.modified_newton import ModifiedNewton

from nlsolve import SolveError, Status
from nlsolve.flow.continuation import Start
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Discretizer, Physics
from nlsolve.series import Array
from nlsolve.solving.driver import solve
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_solver
from nlsolve.testing.toy_problem import ToyProblem

ENERGY = Newton(globalization=Energy())
AT_ONCE = Start(values=(1.0,))  # the Newtonian flow, whose one linear solve is a start like any other
TIGHT = StoppingTest(tolerance=1e-12)


def at_rest(index: float, discretizer: Discretizer | None = None, spacing: float = 0.5) -> tuple[Flow, Array]:
    """The steady spin, ε₀ = 10⁻³ 1/s, and its start: nothing moves but the tool."""
    scene, law = StirringTool(nodes=Rings(spacing=spacing)), PowerLaw(index=index, regularization=1e-3)
    cloud = scene.cloud(law)
    operators = (discretizer or LinearTriangles()).operators(cloud, False)
    return Flow(cloud, operators, law, scene.boundary_velocity(cloud, law, 0.0)), np.zeros(2 * len(cloud.interior))


def scrambled(rest: Array) -> Array:
    """A velocity field without sense, about as fast as the tool."""
    return rest + 100.0 * np.random.default_rng(0).standard_normal(len(rest))


def climb(flow: Flow, start: Array, end: Array) -> float:
    """Φ(end) − Φ(start) = ∫₀¹ R(start + t (end − start)) · (end − start) dt, in pieces that shrink to both ends."""
    places, weights = np.polynomial.legendre.leggauss(8)
    knots = np.concatenate([[0.0], np.geomspace(1e-4, 0.5, 10)])
    knots = np.concatenate([knots, 1.0 - knots[-2::-1]])
    t = (0.5 * (knots[1:] + knots[:-1])[:, None] + 0.5 * np.diff(knots)[:, None] * places).ravel()
    weight = (0.5 * np.diff(knots)[:, None] * weights).ravel()
    way = end - start
    return float(sum(w * (flow.residual(start + x * way) @ way) for w, x in zip(weight, t, strict=True)))


def iterates(flow: Flow, solver: Newton, start: Array, rule: Any = None, most: int = 60) -> list[Array]:
    """States of the method until ‖R‖ is 10⁻¹⁰ of its scale."""
    found: list[Array] = []
    scale, ledger = flow.scale(start), Ledger()
    for step in solver.steps(CountedProblem(flow, ledger), Tangent(PLAIN, rule, ledger), start):
        found.append(step.state)
        if np.linalg.norm(flow.residual(step.state)) <= 1e-10 * scale or len(found) > most:
            break
    return found


@pytest.mark.parametrize("index", [0.1324, 0.05])
class TestFromRest:
    """μ runs over eight decades and more; no law in between is solved on the way."""

    def test_it_converges(self, index: float) -> None:
        flow, rest = at_rest(index)
        outcome, ledger = run(flow, ENERGY, None, rest, stop=TIGHT)
        assert outcome.status is Status.CONVERGED, outcome.detail
        assert ledger.counts["factorization"] <= 40

    def test_the_potential_falls_with_every_iterate(self, index: float) -> None:
        flow, rest = at_rest(index)
        for start in (rest, scrambled(rest)):
            found = iterates(flow, ENERGY, start)
            changes = [climb(flow, a, b) for a, b in pairwise(found)]
            assert len(found) < 60
            assert changes[0] < 0.0
            assert max(changes) < 1e-8 * max(map(abs, changes))

    def test_the_solution_is_that_of_the_residual_search(self, index: float) -> None:
        """Which is led there from the Newtonian flow through the laws in between."""
        flow, rest = at_rest(index)
        found = run(flow, ENERGY, None, rest, stop=TIGHT)[0].state
        start = rest
        for easier in (1.0, 0.5, 0.3, 0.2, 0.13, 0.08, index):
            start = run(at_rest(max(easier, index))[0], Newton(), None, start, stop=TIGHT)[0].state
        np.testing.assert_allclose(found, start, rtol=0.0, atol=1e-8 * np.abs(start).max())


def test_the_whole_march_from_rest_without_continuation() -> None:
    """A steady case whose starting law is the Newtonian one alone, on the conservative forms."""
    for discretizer in (LinearTriangles(), MovingLeastSquares(form="conservative")):
        scene = StirringTool(nodes=Rings(spacing=0.5))
        parts: dict[str, Any] = {"discretizer": discretizer, "start": AT_ONCE.with_(solver=ENERGY)}
        row = march(setup(scene, 0.1324, solver=ENERGY, **parts)).summary
        assert row["status"] == "converged", row["message"]
        assert row["start_factorizations"] == 1


def test_a_step_that_ends_before_the_least_energy_is_taken_in_full() -> None:
    """On a quadratic potential, n = 1, the full step is the solution."""
    flow, rest = at_rest(1.0)
    outcome, _ = run(flow, ENERGY, None, rest)
    assert len(outcome.rows) == 2
    assert outcome.rows[1]["length"] == 1.0


@pytest.mark.parametrize("index", [0.3, 0.1324])
def test_lengths_end_where_the_slope_is_all_but_gone(index: float) -> None:
    """R(u + t w)·w at the length taken: a tenth of its size at t = 0 at most; the full step at the end."""
    flow, rest = at_rest(index)
    found = iterates(flow, ENERGY, scrambled(rest))
    for a, b in pairwise(found):
        before, after = flow.residual(a) @ (b - a), flow.residual(b) @ (b - a)
        assert before < 0.0
        assert after <= 0.1 * abs(before) * (1.0 + 1e-9)
    outcome, _ = run(flow, ENERGY, None, scrambled(rest))
    lengths = [row["length"] for row in outcome.rows[1:]]
    assert outcome.status is Status.CONVERGED
    assert 0.0 < min(lengths) < 0.5
    assert lengths[-1] == 1.0


def test_from_a_field_without_sense_it_takes_fewer_tangents_than_the_residual_search() -> None:
    """‖R‖ must fall by steps so short that the potential could have fallen by longer ones."""
    flow, rest = at_rest(0.3)
    counts = [run(flow, solver, None, scrambled(rest))[1].counts["factorization"] for solver in (ENERGY, Newton())]
    assert counts[0] <= 15 < counts[1]


@pytest.mark.parametrize("trials", [1, 2])
def test_a_search_cut_short_takes_the_length_it_tried_last(trials: int) -> None:
    """The residual it hands on is that of the state it goes to."""
    flow, rest = at_rest(0.3)
    found = iterates(flow, ENERGY.with_(globalization=Energy(trials=trials)), scrambled(rest), most=5)
    sizes = [float(np.linalg.norm(flow.residual(u))) for u in found]
    outcome, _ = run(flow, ENERGY.with_(globalization=Energy(trials=trials)), None, scrambled(rest), iterations=5)
    for i in range(1, 5):
        assert outcome.rows[i]["contraction"] == pytest.approx(sizes[i] / sizes[i - 1], rel=1e-10)


# A kept tangent.


@pytest.mark.parametrize("index", [0.5, 0.1324])
def test_modified_newton_with_the_energy_search(index: float) -> None:
    flow, rest = at_rest(index)
    start = run(at_rest(2.0 * index)[0], ENERGY, None, rest)[0].state
    expected = run(flow, Newton(), None, run(flow, ENERGY, None, rest)[0].state, stop=TIGHT)[0].state
    outcome, ledger = run(flow, ModifiedNewton(globalization=Energy()), PoorContraction(), start, stop=TIGHT)
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert ledger.counts["factorization"] < len(outcome.rows) - 1
    np.testing.assert_allclose(outcome.state, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


# Refusals, and the contract.

REFUSAL = 'the globalization "energy" needs a residual with a potential: choose a conservative discretizer'


@pytest.mark.parametrize("solver", [ENERGY, ModifiedNewton(globalization=Energy())], ids=["newton", "modified"])
def test_a_strong_form_has_no_potential(solver: Newton) -> None:
    flow, rest = at_rest(0.5, MovingLeastSquares())
    outcome, ledger = run(flow, solver, None, rest)
    assert outcome.status is Status.NOT_APPLICABLE
    assert REFUSAL in outcome.detail
    assert ledger.counts["factorization"] == 0
    with pytest.raises(SolveError, match="without convection"):
        next(iter(solver.steps(flow, Tangent(PLAIN, None, Ledger()), rest)))


def test_a_case_that_is_refused_is_a_row_with_the_sentence() -> None:
    scene = StirringTool(nodes=Rings(spacing=0.75))
    for physics, discretizer in (
        (Physics(), MovingLeastSquares()),
        (Physics(convection=True), LinearTriangles()),
    ):
        row = march(setup(scene, 0.5, physics=physics, solver=ENERGY, discretizer=discretizer)).summary
        assert row["status"] == "not applicable"
        assert REFUSAL in row["message"]


class GradientProblem(ToyProblem):
    """A u + sinh u = b with A symmetric: the gradient of ½ uᵀA u + Σ cosh u − bᵀu, and said to be."""

    is_gradient = True


@pytest.mark.parametrize("solver", [ENERGY, ModifiedNewton(globalization=Energy())], ids=["newton", "modified"])
@pytest.mark.parametrize("rule", [None, PoorContraction()], ids=["new", "kept"])
def test_the_small_problem_by_energy(solver: Newton, rule: Any) -> None:
    """From far away, where sinh makes the full step of a new tangent short and that of an old one long."""
    problem = GradientProblem()
    symmetric = GradientProblem.matrix - GradientProblem.matrix.T
    assert abs(symmetric).max() == 0.0
    for far in (0.5, 3.0, -6.0):
        start = problem.solution + far
        outcome, _ = small(problem, solver, rule, start)
        assert outcome.status is Status.CONVERGED, outcome.detail
        np.testing.assert_allclose(outcome.state, problem.solution, atol=1e-9)


def small(problem: ToyProblem, solver: Newton, rule: Any, start: Array) -> Any:
    ledger = Ledger()
    tangent = Tangent(PLAIN, rule, ledger)
    return solve(problem, solver, tangent, start, StoppingTest(tolerance=1e-11), Budget(), ledger), ledger


@pytest.mark.parametrize("rule", [None, PoorContraction()], ids=["new", "kept"])
@pytest.mark.parametrize("kind", [Newton, ModifiedNewton])
@pytest.mark.parametrize("search", ["backtracking", "energy"])
def test_the_solvers_conform(kind: type[Newton], rule: Any, search: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if search == "energy":
        monkeypatch.setattr(ToyProblem, "is_gradient", True)  # which it is: A is symmetric
    check_solver(kind.model_validate({"globalization": {"kind": search}}), rule)


def test_the_check_of_solvers_reports_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ToyProblem, "is_gradient", False)
    with pytest.raises(AssertionError, match="the toy problem was not solved: the globalization"):
        check_solver(ENERGY)
