"""ρ (V·∇) V : its Jacobian and series, what it adds, its order, and the driven cavity against Ghia."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import PLAIN, setup
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import NortonHoff, PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.refresh import PoorContraction
from nlsolve_scenes import Cavity, Manufactured, StirringTool
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from nlsolve_solvers.modified_newton import ModifiedNewton

from nlsolve.flow.convection import Convection
from nlsolve.flow.momentum import Flow, Inertia
from nlsolve.plugin import ConstitutiveLaw, FlowScene, Misfit, NodeMotion, Physics, TimeSteps
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.testing import check_problem

VISCOUS = NortonHoff(consistency=1.0, index=1.0)  # μ = 1 MPa s
DENSITY = 20.0
SCENE = Manufactured(spacing=0.2, jitter=0.2)
CLOUD = SCENE.cloud(VISCOUS)
FORM = MovingLeastSquares()
OPERATORS = FORM.operators(CLOUD, True)
GRADIENT = FORM.gradient(CLOUD)
EXACT = SCENE.exact(VISCOUS, CLOUD.nodes, 0.0).velocity
TERMS: dict[str, dict[str, Any]] = {
    "alone": {},
    "inertia": {"inertia": Inertia(DENSITY / 0.01, 0.7 * EXACT)},
    "all": {
        "inertia": Inertia(DENSITY / 0.01, 0.7 * EXACT),
        "penalty_modulus": 50.0,
        "pressure": np.linspace(-1.0, 1.0, len(OPERATORS.volumetric.points)),
        "body_force": SCENE.body_force(CLOUD.nodes[CLOUD.interior], VISCOUS, Physics()),
    },
}


def flow(law: ConstitutiveLaw, convection: bool, **terms: Any) -> Flow:
    carried = Convection(DENSITY, GRADIENT) if convection else None
    return Flow(CLOUD, OPERATORS, law, EXACT[CLOUD.boundary], convection=carried, **terms)


@pytest.mark.parametrize("index", [1.0, 0.5])
@pytest.mark.parametrize("terms", TERMS)
def test_jacobian_and_expansion_are_those_of_the_residual(terms: str, index: float) -> None:
    problem = flow(PowerLaw(index=index), True, **TERMS[terms])
    start = problem.unknowns(EXACT)
    check_problem(problem, start * (1.0 + 0.1 * np.sin(np.arange(len(start)))))


@pytest.mark.parametrize("terms", TERMS)
def test_convection_adds_itself_and_nothing_else(terms: str) -> None:
    """R with it less R without it is ρ (u ∂/∂x + v ∂/∂y)(u, v), with the derivatives at the nodes."""
    with_it, without = (flow(PowerLaw(index=0.5), on, **TERMS[terms]) for on in (True, False))
    u = with_it.unknowns(EXACT) * 1.1
    v = with_it.velocity(u)
    dx, dy = (matrix @ v for matrix in GRADIENT)
    carried = DENSITY * (v[:, :1] * dx + v[:, 1:] * dy)[CLOUD.interior]
    difference = with_it.residual(u) - without.residual(u)
    np.testing.assert_allclose(difference, carried.ravel(), atol=1e-11 * with_it.scale(u))
    assert with_it.scale(u) > without.scale(u)
    assert np.abs(carried).max() > 1.0


def test_uniform_motion_is_carried_without_force() -> None:
    """(V·∇)V = 0 for V = constant, and ω² r inwards for a rigid rotation, both to rounding."""
    turning = np.stack([-CLOUD.nodes[:, 1], CLOUD.nodes[:, 0]], axis=1)
    for velocity, expected in ((np.ones_like(CLOUD.nodes), 0.0), (turning, -CLOUD.nodes[CLOUD.interior].ravel())):
        parts = [
            Flow(CLOUD, OPERATORS, VISCOUS, velocity[CLOUD.boundary], convection=carried)
            for carried in (Convection(1.0, GRADIENT), None)
        ]
        u = parts[0].unknowns(velocity)
        np.testing.assert_allclose(parts[0].residual(u) - parts[1].residual(u), expected, atol=1e-10)


class TestOrderOfConvergence:
    """Manufactured fields at Re = ρ U L/μ with U = 2 mm/s, L = 1 mm: second order; a little less where the error is
    that of a pressure (20 MPa against μ U/L = 2 MPa), which is constant on each of its patches.
    """

    least = 1.8
    least_of_pressure = 1.6

    def order(self, law: ConstitutiveLaw, physics: Physics, spacings: tuple[float, float], **fields: Any) -> float:
        rows = [
            march(setup(Manufactured(spacing=h, **fields), law=law, physics=physics, linear=SuperLU())).summary
            for h in spacings
        ]
        assert all(row["status"] == "converged" for row in rows), [row["message"] for row in rows]
        coarse, fine = (row["velocity_error"] for row in rows)
        assert fine < 1e-3
        return float(np.log(coarse / fine) / np.log(spacings[0] / spacings[1]))

    @pytest.mark.parametrize(("law", "density"), [(VISCOUS, 5.0), (PowerLaw(index=0.5), 100.0)])
    def test_without_a_pressure(self, law: ConstitutiveLaw, density: float) -> None:
        physics = Physics(convection=True, density=density)
        assert self.order(law, physics, (0.1, 0.05), jitter=0.2) >= self.least

    @pytest.mark.parametrize("density", [5.0, 50.0])
    def test_with_a_pressure(self, density: float) -> None:
        physics = Physics(convection=True, density=density, penalty=1e3, divergence_tolerance=1e-7)
        assert self.order(VISCOUS, physics, (0.1, 0.035), nodes="scattered") >= self.least_of_pressure


@pytest.mark.parametrize("solver", [ModifiedNewton(), AsymptoticNumericalMethod()], ids=lambda solver: solver.kind)
def test_inertia_and_convection_march_to_the_steady_state(solver: Any) -> None:
    """From the quasi-static state at Re = 40, in time steps of L/U, all methods find the same steady flow: the exact
    one to the error of the nodes, which no time step changes.
    """
    scene = Manufactured(spacing=0.1, nodes="scattered")
    equations: dict[str, Any] = {"law": VISCOUS, "physics": Physics(density=20.0, convection=True, inertia=True)}
    method: dict[str, Any] = {"solver": solver, "refresh": PoorContraction(), "linear": PLAIN}
    marched = march(setup(scene, time=TimeSteps(horizon=5.0, increment=0.5), **equations, **method)).summary
    steady = march(setup(scene, **equations)).summary
    assert marched["status"] == steady["status"] == "converged", marched["message"]
    assert marched["velocity_error"] == pytest.approx(steady["velocity_error"], rel=1e-4)
    assert marched["velocity_error"] < 0.01


# The driven cavity, Ghia, Ghia & Shin (1982), tables I and II: u along x = L/2 and v along y = L/2.

HEIGHTS, U_100, U_400 = np.array(
    [
        (0.0547, -0.03717, -0.08186),
        (0.0625, -0.04192, -0.09266),
        (0.0703, -0.04775, -0.10338),
        (0.1016, -0.06434, -0.14612),
        (0.1719, -0.10150, -0.24299),
        (0.2813, -0.15662, -0.32726),
        (0.4531, -0.21090, -0.17119),
        (0.5, -0.20581, -0.11477),
        (0.6172, -0.13641, 0.02135),
        (0.7344, 0.00332, 0.16256),
        (0.8516, 0.23151, 0.29093),
        (0.9531, 0.68717, 0.55892),
        (0.9609, 0.73722, 0.61756),
        (0.9688, 0.78871, 0.68439),
        (0.9766, 0.84123, 0.75837),
    ]
).T
PLACES, V_100 = np.array(
    [
        (0.0625, 0.09233),
        (0.0703, 0.10091),
        (0.0781, 0.10890),
        (0.0938, 0.12317),
        (0.1563, 0.16077),
        (0.2266, 0.17507),
        (0.2344, 0.17527),
        (0.5, 0.05454),
        (0.8047, -0.24533),
        (0.8594, -0.22445),
    ]
).T


def velocity(scene: FlowScene, density: float, x: Array, y: Array) -> Array:
    physics = Physics(convection=True, density=density, penalty=1000.0, divergence_tolerance=1e-6)
    case = setup(scene, law=VISCOUS, physics=physics, linear=SuperLU())
    record = march(case)
    assert record.summary["status"] == "converged", record.summary["message"]
    values = case.discretizer.values(record.fields[["x", "y"]].to_numpy(), np.stack([x, y], axis=1))
    return values @ record.fields[["u", "v"]].to_numpy()


def test_cavity_at_reynolds_100() -> None:
    """Within 1 % of the lid's speed in u, 1.5 % in v, on 2300 nodes."""
    scene = Cavity(spacing=1 / 40, grading=0.6)
    assert scene.reynolds(VISCOUS, 100.0) == pytest.approx(100.0)
    half = np.full_like(HEIGHTS, 0.5)
    x, y = np.concatenate([half, PLACES]), np.concatenate([HEIGHTS, np.full_like(PLACES, 0.5)])
    found = velocity(scene, 100.0, x, y)
    np.testing.assert_allclose(found[: len(half), 0], U_100, atol=0.01)
    np.testing.assert_allclose(found[len(half) :, 1], V_100, atol=0.015)


def test_cavity_at_reynolds_400() -> None:
    """Within 1.5 % of the lid's speed on 1600 nodes."""
    scene = Cavity(spacing=1 / 32, grading=0.5)
    found = velocity(scene, 400.0, np.full_like(HEIGHTS, 0.5), HEIGHTS)
    np.testing.assert_allclose(found[:, 0], U_400, atol=0.015)


def test_nodes_that_move_with_the_material_carry_it_already() -> None:
    case = setup(StirringTool(), physics=Physics(convection=True), motion=NodeMotion(nodes="lagrangian"))
    with pytest.raises(Misfit, match=r'physics\.convection: nodes .* carry it already; use motion\.nodes = "fixed"'):
        case.scene.check(case)
