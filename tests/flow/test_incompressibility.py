"""The iterated pressure: mixing on linear maps, the divergence reached, its costs, its endings, and no locking."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import PLAIN, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import PoorContraction, RangeUnderOne
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton
from pydantic import ValidationError
from scipy.sparse import csr_array

from nlsolve import SolveError, Status
from nlsolve.flow.incompressibility import DEPTH, pressure_mixing
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Discretizer, FlowScene, Misfit, NodeMotion, Operators, Physics, PointOperators, TimeSteps
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import StoppingTest

# Mixing.


def contraction(dimension: int, radius: float = 0.95, seed: int = 0) -> tuple[Array, Array, Array]:
    """A, b of g(p) = A p + b with eigenvalues between ± radius, and the fixed point (I − A)⁻¹ b."""
    random = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(random.standard_normal((dimension, dimension)))
    matrix = basis @ np.diag(np.linspace(-radius, radius, dimension)) @ basis.T
    b = random.standard_normal(dimension)
    return matrix, b, np.linalg.solve(np.eye(dimension) - matrix, b)


def errors(dimension: int, steps: int, mixed: bool) -> list[float]:
    """‖p − p*‖/‖p*‖ after each of the steps from p = 0."""
    matrix, b, fixed = contraction(dimension)
    mixing, p, found = pressure_mixing(), np.zeros(dimension), []
    for _ in range(steps):
        image = matrix @ p + b
        p = mixing.next(p, image - p) if mixed else image
        found.append(float(np.linalg.norm(p - fixed) / np.linalg.norm(fixed)))
    return found


@pytest.mark.parametrize("dimension", [1, 3, 6, DEPTH])
def test_mixing_ends_on_a_linear_map_after_as_many_steps_as_it_has_dimensions(dimension: int) -> None:
    """On a linear map Anderson's mixing is GMRES (Walker & Ni 2011); plain iteration has 0.95^k of the error left."""
    assert errors(dimension, dimension + 2, mixed=True)[-1] < 1e-10
    assert errors(dimension, dimension + 2, mixed=False)[-1] > 1e-2


def test_mixing_of_fewer_iterates_than_dimensions_still_helps() -> None:
    assert errors(40, 60, mixed=True)[-1] < 1e-2 * errors(40, 60, mixed=False)[-1]


def test_a_fixed_point_stays_where_it_is() -> None:
    """Differences that have become rounding noise are not extrapolated."""
    matrix, b, fixed = contraction(3)
    mixing, p = pressure_mixing(), np.zeros(3)
    for _ in range(30):
        p = mixing.next(p, matrix @ p + b - p)
    np.testing.assert_allclose(p, fixed, rtol=1e-12)


# Marches. The spin and the orbit on coarse rings, λ/μ = 100.

ASKED = 1e-8
TIGHT = StoppingTest(tolerance=1e-11)
DISCRETIZERS = {
    "mls pairs": MovingLeastSquares(),
    "delaunay": LinearTriangles(),
}


SPIN, ORBIT = (
    StirringTool.model_validate({"motion": motion, "nodes": Rings(spacing=0.5)}) for motion in ("spin", "orbit")
)


def iterated(penalty: float = 100.0, **fields: Any) -> Physics:
    return Physics(penalty=penalty, divergence_tolerance=ASKED, **fields)


def solved(scene: FlowScene, physics: Physics, **parts: Any) -> tuple[dict[str, Any], Array]:
    """The row of a case that must converge, and its nodal velocities."""
    record = march(setup(scene, physics=physics, **{"stop": TIGHT, **parts}))
    assert record.summary["status"] == "converged", record.summary["message"]
    return record.summary, record.fields[["u", "v"]].to_numpy()


@pytest.mark.parametrize("discretizer", DISCRETIZERS.values(), ids=DISCRETIZERS)
@pytest.mark.parametrize("scene", [SPIN, ORBIT], ids=["spin", "orbit"])
def test_the_divergence_asked_for_is_reached_and_the_flow_is_that_of_a_huge_penalty(
    scene: FlowScene, discretizer: Discretizer
) -> None:
    row, velocity = solved(scene, iterated(), discretizer=discretizer)
    assert row["divergence"] <= ASKED
    assert 1 <= row["pressure_iterations"] <= 20
    assert row["increments"] == 1
    stiff, expected = solved(scene, Physics(penalty=1e7), discretizer=discretizer)
    assert stiff["pressure_iterations"] is None
    weak, loose = solved(scene, Physics(penalty=100.0), discretizer=discretizer)
    size = np.linalg.norm(expected)
    assert np.linalg.norm(velocity - expected) < 1e-5 * size
    assert np.linalg.norm(loose - expected) > 1e-4 * size  # what iterating the pressure was for
    assert weak["divergence"] > 1e3 * ASKED


def test_a_larger_penalty_takes_fewer_iterations() -> None:
    triangles = LinearTriangles()
    counts = [
        solved(ORBIT, iterated(penalty), discretizer=triangles)[0]["pressure_iterations"]
        for penalty in (10.0, 1e2, 1e4)
    ]
    assert counts[0] > counts[1] > counts[2] >= 1


@pytest.mark.parametrize("name", ["mls pairs", "delaunay"])
def test_a_kept_tangent_serves_all_iterations_of_the_pressure(name: str) -> None:
    """The pressure only moves the right-hand side: Newton pays a factorisation each time, a kept tangent few in all."""
    discretizer = DISCRETIZERS[name]
    newton, expected = solved(ORBIT, iterated(), discretizer=discretizer)
    assert newton["tangents"] > newton["pressure_iterations"]
    others = ((ModifiedNewton(), PoorContraction(), 2), (AsymptoticNumericalMethod(), RangeUnderOne(), 6))
    for solver, refresh, most in others:
        kept, velocity = solved(ORBIT, iterated(), discretizer=discretizer, solver=solver, refresh=refresh)
        assert kept["tangents"] <= most < kept["pressure_iterations"]
        assert kept["factorizations"] == kept["tangents"]
        assert kept["triangular_solves"] > kept["pressure_iterations"]
        np.testing.assert_allclose(velocity, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_a_marched_pressure_is_iterated_in_every_increment() -> None:
    """The pressure of the increment before is where the next one begins."""
    triangles = LinearTriangles()
    time = TimeSteps(horizon=3e-4, increment=1e-4)
    row, _ = solved(ORBIT, iterated(), time=time, discretizer=triangles)
    assert row["increments"] == 3
    assert row["divergence"] <= ASKED
    first, _ = solved(ORBIT, iterated(), discretizer=triangles)
    assert row["pressure_iterations"] < 4 * first["pressure_iterations"]


# Endings and refusals.


def test_pressures_used_up_are_a_sentence_with_what_was_reached_and_asked() -> None:
    row = march(setup(ORBIT, physics=iterated(pressure_iterations=1), stop=TIGHT)).summary
    assert row["status"] == "budget spent"
    assert row["pressure_iterations"] == 1
    assert row["divergence"] > ASKED
    assert f"= {row['divergence']:.1e} after 1 iterations of the pressure, 1e-08 was asked for" in row["message"]
    assert "raise the penalty, tighten stop.tolerance" in row["message"]


@pytest.mark.parametrize("penalty", [{}, {"penalty": 0.0}])
def test_a_pressure_is_iterated_with_a_penalty_only(penalty: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match=r"divergence_tolerance = 1e-08: .*; set penalty > 0"):
        Physics(divergence_tolerance=1e-8, **penalty)


def test_nodes_that_move_are_not_carried_twice() -> None:
    case = setup(SPIN, physics=Physics(convection=True), motion=NodeMotion(nodes="lagrangian"))
    with pytest.raises(Misfit, match=r'carry it already; use motion\.nodes = "fixed"'):
        case.scene.check(case)


# Units of λ.


def test_units_of_the_penalty() -> None:
    """λ = c μ(reference rate), c μ(ε̄²) point by point, or c."""
    law, rate, rates = PowerLaw(index=0.5, regularization=0.0), StirringTool().reference_rate, np.array([1.0, 1e4, 1e6])
    reference, local, absolute = (
        Physics.model_validate({"penalty": 50.0, "penalty_unit": unit}).penalty_modulus(law, rate, lambda: rates)
        for unit in ("reference", "local", "absolute")
    )
    at_reference = 164.76 / 3.0 * 100.0**-0.5  # μ = ⅓ k T^A ε̄^(n−1) at ω = 100 rad/s
    assert reference == pytest.approx(50.0 * at_reference, rel=1e-4)
    np.testing.assert_allclose(local, 50.0 * at_reference * np.array([10.0, 1.0, 10.0**-0.5]), rtol=1e-4)
    assert absolute == 50.0
    assert Physics().penalty_modulus(law, rate, lambda: rates) == 0.0


@pytest.mark.parametrize(
    ("unit", "penalty"), [("reference", 100.0), ("local", 100.0), ("absolute", 100.0 * 164.76 / 3.0 / 10.0)]
)
def test_the_unit_does_not_matter_once_the_pressure_is_iterated(unit: str, penalty: float) -> None:
    row, velocity = solved(ORBIT, iterated(penalty, penalty_unit=unit))
    expected = solved(ORBIT, iterated())[1]
    assert row["divergence"] <= ASKED
    np.testing.assert_allclose(velocity, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())


# The condition of the last tangent.


def test_condition_of_a_tiny_matrix() -> None:
    """Within a factor of ten of ‖A‖₁ ‖A⁻¹‖₁ and never above it: Hager's estimate is a lower bound."""
    random = np.random.default_rng(4)
    for size in (2, 5, 12):
        dense = random.standard_normal((size, size)) @ np.diag(10.0 ** -np.linspace(0.0, 6.0, size))
        for ordering in ("auto", "mmd-ata", "colamd", "mmd-at-plus-a", "natural"):
            linear = SuperLU.model_validate({"ordering": ordering})
            estimates = {linear.factorize(csr_array(dense)).condition() for _ in range(3)}
            assert len(estimates) == 1
            part = estimates.pop() / np.linalg.cond(dense, 1)
            assert 0.1 <= part <= 1.0 + 1e-6


def test_a_singular_matrix_has_no_factors_to_ask() -> None:
    with pytest.raises(SolveError) as ending:
        PLAIN.factorize(csr_array(np.array([[1.0, 2.0], [2.0, 4.0]])))
    assert ending.value.status is Status.SINGULAR_TANGENT


def test_the_condition_grows_like_the_penalty_and_is_the_same_in_every_run() -> None:
    """What the iterated pressure spares the linear solver."""
    first, again = (solved(ORBIT, iterated())[0]["condition"] for _ in range(2))
    stiff = solved(ORBIT, Physics(penalty=1e6))[0]["condition"]
    assert np.isfinite(first)
    assert first == again
    assert 1e2 < stiff / first < 1e6


# Locking.


class TestNoLocking:
    """λ/μ from 1 to 1e6 on graded rings moves the error by less than a tenth of itself."""

    penalties = (1.0, 1e2, 1e4, 1e6)
    part = 0.1
    nodes = GradedRings(first=0.1, growth=0.2, spacing=0.5)

    @pytest.mark.parametrize("name", ["mls pairs", "delaunay"])
    def test_spin(self, name: str) -> None:
        found = [
            solved(
                StirringTool(nodes=self.nodes),
                Physics(penalty=penalty),
                index=1.0,
                discretizer=DISCRETIZERS[name],
                stop=StoppingTest(tolerance=1e-9),
            )[0]["velocity_error"]
            for penalty in self.penalties
        ]
        assert max(found) < 2e-3
        assert max(found) - min(found) <= self.part * min(found)

    def test_a_dilatation_at_every_strain_point_would_lock(self) -> None:
        """The check can fail: linear triangles whose penalty acts on each triangle, not on pairs of them."""
        assert self.error_of_triangles(1e4, each=True) > 10.0 * self.error_of_triangles(1e4, each=False)

    def error_of_triangles(self, penalty: float, each: bool) -> float:
        """Relative ℓ² error at n = 1 by one linear solve."""
        law, scene = PowerLaw(index=1.0), StirringTool(nodes=self.nodes)
        cloud = scene.cloud(law)
        operators = LinearTriangles().operators(cloud, True)
        if each:
            strain = operators.strain
            m = len(strain.points)
            trace = strain.rate[:m] + strain.rate[m : 2 * m]
            assert strain.areas is not None
            operators = Operators(strain, PointOperators.conservative(cloud, trace, strain.points, strain.areas))
        modulus = penalty * float(law.viscosity(np.array([1.0]))[0])
        flow = Flow(cloud, operators, law, scene.boundary_velocity(cloud, law, 0.0), modulus)
        start = np.zeros(2 * len(cloud.interior))
        velocity = flow.velocity(-PLAIN.factorize(flow.jacobian(start)).solve(flow.residual(start)))
        exact = scene.exact(law, cloud.nodes, 0.0)
        assert exact is not None
        return float(np.linalg.norm(velocity - exact.velocity) / np.linalg.norm(exact.velocity))
