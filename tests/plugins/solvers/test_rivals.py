"""Anderson, Broyden, Picard, Newton-Krylov, and SciPy's methods under the same ledger."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import PLAIN, near, run, spin_flow
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_rules import Backtracking, Cubic, FullSteps, NonMonotone
from nlsolve_rules.refresh import AverageCost, CostOptimal, EveryIteration, EveryM, Never, PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import (
    Anderson,
    Broyden,
    LevenbergMarquardt,
    Newton,
    NewtonKrylov,
    Picard,
    PseudoTransient,
    TrustRegion,
)
from nlsolve_solvers.external import ScipyRoot
from nlsolve_solvers.krylov.forcing import next_forcing
from nlsolve_solvers.krylov.gmres import gmres
from nlsolve_solvers.levenberg_marquardt import augmented
from nlsolve_solvers.modified_newton import ModifiedNewton
from nlsolve_solvers.trust_region import cauchy_point, dogleg
from pydantic import ValidationError
from scipy.sparse import csr_array

from nlsolve import SolveError, Status
from nlsolve.flow.convection import Convection
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Mixing, NonlinearProblem, NonlinearSolver, RefreshRule, TangentHistory
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing import check_refresh_rule, check_solver
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
METHODS = ("hybr", "krylov", "broyden1", "anderson", "df-sane")
SOLVERS: tuple[NonlinearSolver, ...] = (
    Anderson(),
    Anderson(depth=0),
    Anderson(depth=20, damping=0.7),
    Picard(),
    Picard(damping=1.2),
    Picard(depth=5),
    Broyden(),
    Broyden(memory=2),
    NewtonKrylov(),
    NewtonKrylov(products="jacobian"),
    NewtonKrylov(forcing="linear-model"),
    NewtonKrylov(forcing="constant", globalization=FullSteps()),
    NewtonKrylov(dimension=2),
    NewtonKrylov(globalization=Cubic()),
    Newton(globalization=Cubic()),
    Newton(globalization=NonMonotone()),
    ModifiedNewton(globalization=NonMonotone()),
    Anderson(globalization=Backtracking()),
    Picard(globalization=Cubic()),
    Broyden(globalization=Backtracking()),
    TrustRegion(),
    PseudoTransient(),
    PseudoTransient(shift=1e-3),
    LevenbergMarquardt(),
    LevenbergMarquardt(shift=1.0),
    *(ScipyRoot(method=method) for method in METHODS),
)


def name(component: Any) -> str:
    return " ".join(str(value) for value in component.model_dump().values())


@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize("rule", [EveryIteration(), PoorContraction(), CostOptimal(), Never()], ids=name)
def test_every_rival_conforms_with_every_refresh_rule(solver: NonlinearSolver, rule: RefreshRule) -> None:
    check_solver(solver, rule)


@pytest.mark.parametrize("solver", [s for s in SOLVERS if getattr(s, "method", "") != "hybr"], ids=name)
def test_every_rival_finds_newtons_solution_of_the_spin(solver: NonlinearSolver) -> None:
    flow = spin_flow(0.5)
    tight = StoppingTest(tolerance=1e-11)
    rule = EveryIteration() if isinstance(solver, Picard) else PoorContraction()
    outcome, _ = run(flow, solver, rule, near(flow, 0.52), stop=tight)
    newton, _ = run(flow, Newton(), EveryIteration(), near(flow, 0.52), stop=tight)
    assert outcome.status is Status.CONVERGED, outcome.detail
    assert np.linalg.norm(outcome.state - newton.state) <= 1e-8 * np.linalg.norm(newton.state)


def iterates(problem: NonlinearProblem, solver: NonlinearSolver, other: NonlinearProblem, count: int) -> list[Any]:
    """`count` states after the start, near an index of 0.52, with the tangent of `other` kept throughout."""
    ledger = Ledger()
    tangent = Tangent(PLAIN, Never(), ledger)
    start = near(spin_flow(0.5), 0.52)
    tangent.refresh_if_due(lambda: other.jacobian(start))
    states = solver.steps(CountedProblem(problem, ledger), tangent, start)
    return [next(states).state for _ in range(count + 1)]


def minimal_residual(matrix: Any, b: Any, dimension: int) -> Any:
    """x in span{b, A b, …} with the least ‖b − A x‖, by orthogonal bases of both."""
    space = b[:, None] / np.linalg.norm(b)
    for _ in range(dimension - 1):
        space = np.linalg.qr(np.hstack([space, (matrix @ space[:, -1])[:, None]]))[0]
    return space @ np.linalg.lstsq(matrix @ space, b, rcond=None)[0]


# Anderson.


@pytest.mark.parametrize("k", [1, 3, 6])
def test_anderson_on_a_linear_problem_is_gmres(k: int) -> None:
    """u_{k+1} = g(u_k^GMRES), of GMRES on K*⁻¹ J w = −K*⁻¹ R (Walker & Ni 2011, theorem 2.2)."""
    flow, other = spin_flow(1.0), spin_flow(0.8)
    states = iterates(flow, Anderson(depth=20), other, k + 1)
    start, inverse = states[0], np.linalg.inv(other.jacobian(states[0]).toarray())
    best = start + minimal_residual(inverse @ flow.jacobian(start).toarray(), -inverse @ flow.residual(start), k)
    expected = best - inverse @ flow.residual(best)
    np.testing.assert_allclose(states[-1], expected, atol=1e-7 * np.linalg.norm(expected - start))


def test_anderson_may_be_deeper_than_there_are_unknowns() -> None:
    """As many differences as unknowns span all there is: f = −0.4 A u ends at 0 in three more steps than unknowns."""
    matrix, u = np.array([[2.0, 0.3], [0.1, 0.5]]), np.array([3.0, -2.0])
    mixing = Mixing(5, 1.0)
    for _ in range(5):
        u = mixing.next(u, -0.4 * (matrix @ u))
    assert np.linalg.norm(u) < 1e-12


def test_without_depth_anderson_is_modified_newton() -> None:
    flow = spin_flow(0.5)
    np.testing.assert_array_equal(
        iterates(flow, Anderson(depth=0), flow, 4), iterates(flow, ModifiedNewton(globalization=FullSteps()), flow, 4)
    )


def test_mixing_forgets_the_columns_that_say_nothing_new() -> None:
    mixing = Mixing(depth=5, damping=1.0)
    f = np.array([1.0, 0.5, 0.25])
    for k in range(4):  # changes of f that are parallel
        u = mixing.next(np.full(3, float(k)), (4.0 - k) * f)
    np.testing.assert_allclose(u, 3.0 + 1.0, rtol=1e-12)  # where f vanishes on the line through the iterates


def test_damping_and_depth_take_their_parts() -> None:
    """Two pairs of the scalar map f(u) = b − a u: the mixed point is the secant method's, whatever the damping."""
    for damping in (0.3, 1.0):
        mixing = Mixing(depth=1, damping=damping)
        first = mixing.next(np.array([0.0]), np.array([2.0]))
        assert first == pytest.approx(2.0 * damping)
        assert mixing.next(first, 2.0 - 4.0 * first) == pytest.approx(0.5)


# Broyden.


def test_broydens_iterates_are_those_of_the_updated_matrix_and_it_meets_the_secant_condition() -> None:
    flow, other = spin_flow(0.5), spin_flow(0.6)
    states = iterates(flow, Broyden(), other, 6)
    matrix = other.jacobian(states[0]).toarray()
    for u, following in pairwise(states):
        s = -np.linalg.solve(matrix, flow.residual(u))
        np.testing.assert_allclose(following - u, s, atol=1e-7 * np.linalg.norm(s))
        y = flow.residual(u + s) - flow.residual(u)
        matrix += np.outer(y - matrix @ s, s) / (s @ s)
        assert np.linalg.norm(matrix @ s - y) <= 1e-10 * np.linalg.norm(y)


def test_broyden_begins_anew_when_its_memory_is_full() -> None:
    """With a memory of one step each pair is a chord step and one update of it."""
    flow, other = spin_flow(0.5), spin_flow(0.6)
    states = iterates(flow, Broyden(memory=1), other, 4)
    chord = np.linalg.inv(other.jacobian(states[0]).toarray())
    for k in (0, 2):
        expected = -chord @ flow.residual(states[k])
        np.testing.assert_allclose(states[k + 1] - states[k], expected, atol=1e-8 * np.linalg.norm(expected))


# Newton-Krylov.


@pytest.mark.parametrize("dimension", [1, 4, 12])
def test_gmres_leaves_the_least_residual_of_its_space(dimension: int) -> None:
    random = np.random.default_rng(0)
    matrix, kept = np.eye(30) + 0.1 * random.standard_normal((30, 30)), np.diag(random.uniform(1.0, 2.0, 30))
    b, inverse = random.standard_normal(30), np.linalg.inv(kept)
    found = gmres(lambda w: matrix @ w, lambda v: inverse @ v, b, 0.0, dimension)
    np.testing.assert_allclose(found.solution, inverse @ minimal_residual(matrix @ inverse, b, dimension), atol=1e-10)
    assert found.left == pytest.approx(np.linalg.norm(b - matrix @ found.solution), rel=1e-8)
    assert found.count == dimension


def test_gmres_stops_at_the_tolerance_and_at_the_solution() -> None:
    matrix = np.diag(np.arange(1.0, 6.0))
    b = np.ones(5)
    exact = gmres(lambda w: matrix @ w, lambda v: v, b, 0.0, 20)
    assert exact.count == 5
    np.testing.assert_allclose(exact.solution, b / np.arange(1.0, 6.0), rtol=1e-10)
    loose = gmres(lambda w: matrix @ w, lambda v: v, b, 0.3 * np.linalg.norm(b), 20)
    assert loose.count < 5
    assert loose.left <= 0.3 * np.linalg.norm(b)
    assert gmres(lambda w: matrix @ w, lambda v: v / np.arange(1.0, 6.0), b, 1e-12, 20).count == 1


def test_gmres_says_that_a_product_is_not_finite() -> None:
    with pytest.raises(SolveError, match="a product with the Jacobian was not finite"):
        gmres(lambda w: np.nan * w, lambda v: v, np.ones(3), 0.0, 3)


def test_forcing_terms_are_those_of_eisenstat_and_walker() -> None:
    assert next_forcing("linear-model", 0.01, 0.2, 1.0, 0.05) == pytest.approx(0.15)
    assert next_forcing("linear-model", 0.8, 0.2, 1.0, 0.05) == pytest.approx(0.8 ** (0.5 + 0.5 * 5**0.5))
    assert next_forcing("ratio", 0.1, 0.2, 1.0, 0.05) == pytest.approx(0.9 * 0.2**2)
    assert next_forcing("ratio", 0.5, 0.1, 1.0, 0.05) == pytest.approx(0.9 * 0.5**2)
    assert next_forcing("ratio", 0.5, 3.0, 1.0, 0.05) == 0.9
    assert next_forcing("constant", 0.3, 0.2, 1.0, 0.05) == 0.3


@pytest.mark.parametrize("products", ["jacobian", "series"])
def test_the_linear_model_is_solved_as_well_as_the_forcing_term_asks(products: Any) -> None:
    flow, other = spin_flow(0.5), spin_flow(0.7)
    solver = NewtonKrylov(products=products, forcing="constant", first_forcing=1e-3)
    for u, following in pairwise(iterates(flow, solver, other, 3)):
        residual = flow.residual(u)
        left = np.linalg.norm(residual + flow.jacobian(u) @ (following - u)) / np.linalg.norm(residual)
        assert 1e-5 < left <= 1e-3


def order(residuals: Sequence[float], above: float = 1e-11) -> float:
    """log(r_(i+1)/r_i)/log(r_i/r_(i−1)) of the last three that are not rounding."""
    r = np.log([x for x in residuals if above < x < 1e-2])
    return float((r[-1] - r[-2]) / (r[-2] - r[-3]))


def test_newton_krylov_converges_quadratically_under_choice_two_and_linearly_under_a_constant() -> None:
    flow = spin_flow(0.5)

    def residuals(solver: NewtonKrylov, steps: int) -> list[float]:
        states = iterates(flow, solver, spin_flow(0.7), steps)
        return [float(np.linalg.norm(flow.residual(u))) / flow.scale(u) for u in states]

    assert order(residuals(NewtonKrylov(), 5)) == pytest.approx(2.0, abs=0.5)
    constant = residuals(NewtonKrylov(forcing="constant", first_forcing=0.1), 8)
    assert order(constant) == pytest.approx(1.0, abs=0.2)
    assert 0.01 < constant[-1] / constant[-2] <= 0.11


def test_products_and_jacobians_are_in_the_ledger() -> None:
    """A Jacobian assembled for K* serves the products of the same iteration."""
    flow = spin_flow(0.5)
    start = near(flow, 0.52)
    outcome, ledger = run(flow, NewtonKrylov(products="jacobian"), Never(), start)
    assert ledger.counts["jacobian"] == len(outcome.rows) - 1
    assert ledger.counts["matrix_product"] == ledger.counts["triangular_solve"]
    outcome, ledger = run(flow, NewtonKrylov(products="series"), Never(), start)
    assert ledger.counts["jacobian"] == 1
    assert ledger.counts["series_order"] == ledger.counts["triangular_solve"]


# Picard.


def test_the_secant_matrix_times_u_is_the_residual_between_walls_at_rest() -> None:
    """R(u) = A(u) u, with the penalty and with convection; and A is J for a constant viscosity without convection."""
    scene, law, discretizer = StirringTool(nodes=Rings(spacing=0.75)), PowerLaw(index=0.3), MovingLeastSquares()
    cloud = scene.cloud(law)
    still, carried = np.zeros((len(cloud.boundary), 2)), Convection(1e-3, discretizer.gradient(cloud))
    operators = discretizer.operators(cloud, True)
    flow = Flow(cloud, operators, law, still, penalty_modulus=50.0, convection=carried)
    u = near(flow, 0.5)
    residual = flow.residual(u)
    np.testing.assert_allclose(flow.secant(u) @ u, residual, atol=1e-12 * np.abs(residual).max())
    newtonian = Flow(cloud, operators, PowerLaw(index=1.0), still, penalty_modulus=50.0)
    assert abs(newtonian.secant(u) - newtonian.jacobian(u)).max() <= 1e-12 * abs(newtonian.jacobian(u)).max()


@pytest.mark.parametrize("index", [0.8, 0.6, 0.5])
@pytest.mark.parametrize("relaxed", [False, True])
def test_picard_contracts_by_one_minus_n(index: float, relaxed: bool) -> None:
    """J = n A on swirls: 1 − β n, which is 1 − n for β = 1 and (1 − n)/(1 + n) for the best β = 2/(1 + n)."""
    flow = spin_flow(index, regularization=1e-6)
    beta = 2.0 / (1.0 + index) if relaxed else 1.0
    outcome, ledger = run(flow, Picard(damping=beta), EveryIteration(), near(flow, index + 0.02))
    assert outcome.status is Status.CONVERGED
    assert outcome.rows[-1]["contraction"] == pytest.approx(1.0 - beta * index, abs=0.02)
    assert ledger.counts["factorization"] == ledger.counts["jacobian"] == len(outcome.rows) - 1


def test_mixing_speeds_picard_up() -> None:
    flow = spin_flow(0.3)
    counts = [len(run(flow, Picard(depth=depth), EveryIteration(), near(flow, 0.32))[0].rows) for depth in (0, 5)]
    assert counts[1] < 0.6 * counts[0]


class Bare(ToyProblem):
    """A problem that offers no secant matrix."""

    secant = NonlinearProblem.secant  # type: ignore[assignment]


def test_picard_says_when_there_is_no_secant_matrix() -> None:
    outcome, _ = run(Bare(), Picard(), EveryIteration(), START, DenseLU())
    assert outcome.status is Status.NOT_APPLICABLE
    assert outcome.detail.startswith("Bare has no secant matrix A(u) with R(u) = A(u) u + c(u)")


# Pseudo-transient continuation.


def test_pseudo_transient_steps_solve_the_damped_equation_with_a_shift_that_falls_like_the_residual() -> None:
    flow, shift = spin_flow(0.5), 0.5
    start, sizes = near(flow, 0.6), list[float]()
    ledger = Ledger()
    states = PseudoTransient(shift=shift).steps(
        CountedProblem(flow, ledger), Tangent(PLAIN, EveryIteration(), ledger), start
    )
    for u, following in pairwise([next(states).state for _ in range(5)]):
        matrix, residual = flow.jacobian(u), flow.residual(u)
        sizes.append(float(np.linalg.norm(residual)))
        w = following - u
        left = matrix @ w + shift * sizes[-1] / sizes[0] * matrix.diagonal() * w + residual
        assert np.linalg.norm(left) <= 1e-9 * sizes[-1]


def test_pseudo_transient_ends_quadratically() -> None:
    flow = spin_flow(0.5)
    outcome, _ = run(flow, PseudoTransient(), EveryIteration(), near(flow, 0.6), stop=StoppingTest(tolerance=1e-12))
    assert outcome.status is Status.CONVERGED
    assert order([row["residual_norm"] for row in outcome.rows]) > 1.6


# Levenberg-Marquardt.


@pytest.mark.parametrize("shift", [0.0, 1e-3, 10.0])
def test_the_augmented_matrix_solves_the_damped_least_squares(shift: float) -> None:
    """w of (JᵀJ + μ D) w = Jᵀ b and r = b − J w, by QR of J over (μ D)^½; columns of very different size."""
    matrix = np.random.default_rng(0).standard_normal((12, 12)) * 10.0 ** np.linspace(-3.0, 3.0, 12)
    b = np.cos(np.arange(12.0))

    class Linear(ToyProblem):
        def jacobian(self, u: Any) -> Any:
            return csr_array(matrix)

    ledger = Ledger()
    tangent = Tangent(DenseLU(), None, ledger)
    tangent.refresh_if_due(lambda: augmented(CountedProblem(Linear(), ledger).jacobian(b), shift))
    r, w = np.split(tangent.solve(np.concatenate([b, np.zeros(12)])), 2)
    damping = np.diag(np.sqrt(shift) * np.linalg.norm(matrix, axis=0))
    expected = np.linalg.lstsq(np.vstack([matrix, damping]), np.concatenate([b, np.zeros(12)]))[0]
    np.testing.assert_allclose(w, expected, rtol=1e-8)
    np.testing.assert_allclose(r, b - matrix @ expected, atol=1e-9)
    assert ledger.counts["factorization"] == ledger.counts["jacobian"] == 1


def test_levenberg_marquardts_first_step_solves_the_damped_normal_equations() -> None:
    problem = ToyProblem()
    outcome, _ = run(problem, LevenbergMarquardt(shift=0.5), EveryIteration(), START, DenseLU(), iterations=1)
    matrix, residual = problem.jacobian(START).toarray(), problem.residual(START)
    normal = matrix.T @ matrix + 0.5 * np.diag((matrix**2).sum(axis=0))
    np.testing.assert_allclose(outcome.state - START, -np.linalg.solve(normal, matrix.T @ residual), rtol=1e-9)


def test_the_residual_falls_at_each_step_of_levenberg_and_marquardt_from_afar() -> None:
    """And a refused step costs a matrix and a residual, and no row."""
    far = ToyProblem.solution + 8.0 * np.cos(np.arange(12.0))
    outcome, ledger = run(ToyProblem(), LevenbergMarquardt(), EveryIteration(), far, DenseLU())
    assert outcome.status is Status.CONVERGED
    assert (np.diff([row["residual_norm"] for row in outcome.rows]) < 0.0).all()
    assert ledger.counts["factorization"] == ledger.counts["residual"] - 1 >= len(outcome.rows) - 1


def test_a_step_is_refused_until_it_is_short_enough() -> None:
    """F = arctan u from u = 3, where a full step ends at −9.5: ‖F‖ falls at once when enough is damped."""

    class Arctan(ToyProblem):
        def residual(self, u: Any) -> Any:
            return np.arctan(u)

        def jacobian(self, u: Any) -> Any:
            return csr_array(np.diag(1.0 / (1.0 + u**2)))

    outcome, ledger = run(Arctan(), LevenbergMarquardt(), EveryIteration(), np.full(2, 3.0), DenseLU())
    assert outcome.status is Status.CONVERGED
    assert ledger.counts["factorization"] > len(outcome.rows) - 1
    assert (np.diff([row["residual_norm"] for row in outcome.rows]) < 0.0).all()
    kept, ledger = run(Arctan(), LevenbergMarquardt(), Never(), np.full(2, 3.0), DenseLU())
    assert kept.status is Status.STAGNATED
    assert kept.detail == "a step was refused because ‖R‖ does not fall, and the refresh rule keeps its matrix"
    assert ledger.counts["factorization"] == 1


def test_a_damping_without_end_is_a_status() -> None:
    outcome, _ = run(Constant(), LevenbergMarquardt(), EveryIteration(), START, DenseLU())
    assert outcome.status is Status.STAGNATED
    assert "with a damping of 3.6e+13" in outcome.detail


# Trust region.


def test_the_dogleg_bends_at_the_cauchy_point_and_ends_at_the_chord() -> None:
    cauchy, chord = np.array([1.0, 0.0]), np.array([1.0, 3.0])
    for radius, expected in ((0.25, [0.25, 0.0]), (5.0**0.5, [1.0, 2.0]), (9.0, [1.0, 3.0])):
        np.testing.assert_allclose(dogleg(cauchy, chord, radius), expected, rtol=1e-12)


def test_the_cauchy_point_is_the_least_of_the_model_along_the_steepest_descent() -> None:
    counted = CountedProblem(ToyProblem(), ledger := Ledger())
    jacobian, residual = counted.jacobian(START), counted.residual(START)
    matrix = ToyProblem().jacobian(START)
    point = cauchy_point(jacobian, residual)
    assert ledger.counts["matrix_product"] == 2
    assert abs((residual + matrix @ point) @ (matrix @ point)) <= 1e-12 * (residual @ residual)
    gradient = matrix.T @ residual
    assert point @ gradient == pytest.approx(-np.linalg.norm(point) * np.linalg.norm(gradient))


def test_in_a_wide_region_the_trust_region_method_is_modified_newton() -> None:
    flow = spin_flow(0.5)
    np.testing.assert_allclose(
        iterates(flow, TrustRegion(), flow, 4),
        iterates(flow, ModifiedNewton(globalization=FullSteps()), flow, 4),
        rtol=1e-12,
    )


def test_the_residual_falls_at_each_step_of_a_trust_region_method_from_afar() -> None:
    far = ToyProblem.solution + 8.0 * np.cos(np.arange(12.0))
    outcome, _ = run(ToyProblem(), TrustRegion(), EveryIteration(), far, DenseLU())
    assert outcome.status is Status.CONVERGED
    assert (np.diff([row["residual_norm"] for row in outcome.rows]) < 0.0).all()


def test_a_region_that_shrinks_to_nothing_is_a_status() -> None:
    outcome, _ = run(Constant(), TrustRegion(), Never(), START, DenseLU())
    assert outcome.status is Status.STAGNATED
    assert "lowers ‖R‖" in outcome.detail


# Rules.


def test_cost_optimal_weighs_iterations_against_a_factorisation() -> None:
    """d = 10, ratio 10, θ_new = 0.1: 20 iterations are worth it, which is θ = 10^(−1/2)."""
    rule = CostOptimal(ratio=10.0, digits=10.0, fresh=0.1)
    check_refresh_rule(rule)
    dues = [rule.due(TangentHistory(contraction=c)) for c in (None, 0.0, 0.3, 0.33, 1.0, float("nan"))]
    assert dues == [False, False, False, True, True, True]
    assert not rule.with_(ratio=1000.0).due(TangentHistory(contraction=0.9))


def test_average_cost_renews_where_the_average_is_least() -> None:
    """c + n solves for Σ lg(1/θ_i) digits with θ growing as K* ages: due where the cost of a digit begins to rise."""
    for cost in (5.0, 40.0):
        rule = AverageCost(ratio=cost)
        check_refresh_rule(rule)
        gains = 1.0 - 0.002 * np.arange(400.0)  # digits of the solves
        average = (cost + np.arange(1.0, 401.0)) / np.cumsum(gains)
        histories = [
            TangentHistory(contraction=10.0**-gain, solves=n, digits=float(digits), rate=gain)
            for n, gain, digits in zip(range(1, 401), gains, np.cumsum(gains), strict=True)
        ]
        dues = [rule.due(each) for each in histories]
        assert abs(dues.index(True) - int(average.argmin())) <= 1
        assert all(dues[dues.index(True) :])
    assert not rule.due(TangentHistory())
    assert rule.due(TangentHistory(contraction=0.5, solves=3, digits=-1.0, rate=-1.0))  # it has made things worse
    assert rule.due(TangentHistory(contraction=1.0, solves=3, digits=9.0, rate=3.0))


def test_digits_and_solves_are_counted_for_each_tangent() -> None:
    """Three solves of contraction 0.1 a solve, then one of 0.01: five digits; and a new tangent begins at none."""
    tangent, jacobian = Tangent(DenseLU(), EveryM(m=2), Ledger()), ToyProblem().jacobian(START)
    tangent.refresh_if_due(lambda: jacobian)
    for solves, contraction in ((3, 0.1), (1, 0.01)):
        for _ in range(solves):
            tangent.solve(START)
        tangent.observe(contraction=contraction)
    assert (tangent.history.solves, tangent.history.digits) == (4, pytest.approx(5.0))
    assert tangent.history.rate == pytest.approx(1.0 + (1.0 - np.exp(-0.1)))
    tangent.refresh_if_due(lambda: jacobian)
    assert tangent.history.solves == 4
    tangent.refresh_if_due(lambda: jacobian)
    assert (tangent.history.solves, tangent.history.digits) == (0, 0.0)


@pytest.mark.parametrize("solver", [ModifiedNewton(), Broyden(), Anderson(), NewtonKrylov()], ids=name)
def test_every_kept_tangent_conforms_under_average_cost(solver: NonlinearSolver) -> None:
    check_solver(solver, AverageCost(ratio=2.0))


# SciPy.


def test_scipys_work_is_in_the_ledger() -> None:
    """Every value of F is a residual and, but for those at y = 0, a solve; another one leads from the last y to u."""
    flow = spin_flow(0.5)
    outcome, ledger = run(flow, ScipyRoot(method="krylov"), Never(), near(flow, 0.52))
    runs = len(outcome.rows) - 1
    assert outcome.status is Status.CONVERGED
    assert runs <= ledger.counts["residual"] + runs - ledger.counts["triangular_solve"] <= 3 * runs
    assert ledger.counts["factorization"] == 1


def test_without_a_preconditioner_scipy_never_asks_for_a_matrix() -> None:
    solver = ScipyRoot(method="krylov", precondition=False, tolerance=1e-12)  # it is called once
    outcome, ledger = run(ToyProblem(), solver, None, START, DenseLU())
    assert outcome.status is Status.CONVERGED
    assert ledger.counts["jacobian"] == ledger.counts["triangular_solve"] == 0


class Constant(ToyProblem):
    """A residual that nothing changes."""

    def residual(self, u: Any) -> Any:
        return np.ones(12)


def test_a_failure_inside_scipy_is_a_status() -> None:
    outcome, _ = run(Constant(), ScipyRoot(method="krylov"), Never(), START, DenseLU())
    assert outcome.status is Status.STAGNATED
    assert outcome.detail.startswith("scipy.optimize.root, krylov: ")


@pytest.mark.parametrize(
    ("component", "fields"),
    [
        (Anderson, {"depth": -1}),
        (Anderson, {"damping": 0.0}),
        (Picard, {"damping": 2.0}),
        (Broyden, {"memory": 0}),
        (NewtonKrylov, {"forcing": "eager"}),
        (NewtonKrylov, {"first_forcing": 1.0}),
        (NewtonKrylov, {"dimension": 0}),
        (LevenbergMarquardt, {"shift": 0.0}),
        (Newton, {"globalization": {"kind": "square"}}),
        (CostOptimal, {"fresh": 1.0}),
        (ScipyRoot, {"method": "lm"}),
    ],
)
def test_nonsense_is_refused(component: type[Any], fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        component(**fields)
