"""The spin of any law: quadrature against closed forms and against itself, and solves against the quadrature."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from cases import LAWS, setup
from nlsolve_laws import Bingham, HerschelBulkley, PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import Couette, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings
from pydantic import ValidationError
from scipy.integrate import quad

from nlsolve.contracts.continuum.law import stress
from nlsolve.flow.continuation import Start
from nlsolve.plugin import ConstitutiveLaw, Exact, FlowScene
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march
from nlsolve.testing import check_scene


def exact_of(scene: FlowScene, law: ConstitutiveLaw, radii: Array) -> Exact:
    exact = scene.exact(law, np.stack([radii, 0.0 * radii], axis=1), 0.0)
    assert exact is not None
    return exact


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("scene", [Couette(), Couette(tool_radius=1.0, plate_radius=1.2, nodes=Rings(spacing=0.1))])
def test_the_scene_conforms(scene: FlowScene, kind: str) -> None:
    check_scene(scene, LAWS[kind])


@pytest.mark.parametrize("index", [1.0, 0.5, 0.3, 0.1324, 0.05])
@pytest.mark.parametrize("plate_radius", [1.6, 6.0, 150.0])
def test_power_law_agrees_with_the_closed_form(index: float, plate_radius: float) -> None:
    radii = np.geomspace(1.5, plate_radius, 50)
    law = PowerLaw(index=index, regularization=1e-8)
    found = exact_of(Couette(plate_radius=plate_radius), law, radii)
    closed = exact_of(StirringTool(plate_radius=plate_radius), law, radii)
    np.testing.assert_allclose(found.velocity, closed.velocity, rtol=0.0, atol=1e-8 * 150.0)
    assert found.quantities["torque"] == pytest.approx(closed.quantities["torque"], rel=1e-8)


@pytest.mark.parametrize("index", [1.0, 0.3, 0.05])
def test_power_law_without_regularization_agrees_at_every_radius(index: float) -> None:
    """From 150 mm/s down to 1e-21 mm/s at n = 0.05."""
    radii, law = np.geomspace(1.5, 5.9, 50), PowerLaw(index=index, regularization=0.0)
    found, closed = (exact_of(scene, law, radii).velocity[:, 1] for scene in (Couette(), StirringTool()))
    np.testing.assert_allclose(found, closed, rtol=1e-11)


def test_rates_below_all_numbers_end_at_rest() -> None:
    """n = 0.02 over a hundred radii: γ̇ falls by 1e200."""
    found = exact_of(Couette(plate_radius=150.0), PowerLaw(index=0.02, regularization=0.0), np.array([1.5, 2.0, 149.0]))
    assert found.velocity[0, 1] == pytest.approx(150.0, rel=1e-14)
    assert 0.0 <= found.velocity[2, 1] < 1e-100


@pytest.mark.parametrize("growth", [1e4, 1e6])
def test_bingham_agrees_with_reiner_and_riwlin(growth: float) -> None:
    """ω = T/(4π η) (1/r_t² − 1/r_p²) − τ_y/η log(r_p/r_t), yielded throughout; τ_y = σ_y/√3."""
    law = Bingham(yield_stress=20.0, plastic_viscosity=2.0, growth=growth, regularization=1e-7)
    torque = exact_of(Couette(), law, np.array([2.0])).quantities["torque"]
    assert torque / (2.0 * np.pi * 6.0**2) > 20.0 / np.sqrt(3.0)
    turning = torque / (8.0 * np.pi) * (1.5**-2 - 6.0**-2) - 10.0 / np.sqrt(3.0) * np.log(4.0)
    assert turning == pytest.approx(100.0, rel=1e-10)


@pytest.mark.parametrize("growth", [10.0, 1e4])
def test_a_core_below_yield_hardly_moves(growth: float) -> None:
    law = HerschelBulkley(yield_stress=300.0, growth=growth, regularization=0.1 / growth)
    found = exact_of(Couette(), law, np.array([1.5, 1.6, 5.0]))
    edge = np.sqrt(found.quantities["torque"] * np.sqrt(3.0) / (2.0 * np.pi * 300.0))  # where 2π r² τ_y = T
    assert 1.6 < edge < 5.0
    assert found.velocity[1, 1] > 1.0
    assert 0.0 < found.velocity[2, 1] < 2.0 / growth


@pytest.mark.parametrize("kind", LAWS)
def test_stress_times_radius_squared_is_constant(kind: str) -> None:
    """τ = S_xy on the x axis with ε̇xy = (u_θ' − u_θ/r)/2 by differences; −2π r² τ is the tool's torque."""
    law, radii, h = LAWS[kind], np.linspace(1.55, 5.9, 30), 1e-4

    def turn(r: Array) -> Array:
        return exact_of(Couette(), law, r).velocity[:, 1] / r

    slope = (8.0 * (turn(radii + h) - turn(radii - h)) - turn(radii + 2 * h) + turn(radii - 2 * h)) / (12 * h)
    shear = 0.5 * radii * slope
    moment = 2.0 * np.pi * radii**2 * stress(law, np.stack([0.0 * shear, 0.0 * shear, shear]))[2]
    np.testing.assert_allclose(-moment, exact_of(Couette(), law, radii).quantities["torque"], rtol=1e-6)


@pytest.mark.parametrize("kind", LAWS)
def test_rates_from_the_torque_turn_the_tool_at_its_speed(kind: str) -> None:
    """∫ γ̇/r dr = ω by another quadrature, in log r, with γ̇ by bisection."""
    law = LAWS[kind]
    torque = exact_of(Couette(), law, np.array([1.5])).quantities["torque"]

    def rate(log_radius: float) -> float:
        target, low, high = torque / (2.0 * np.pi * np.exp(2.0 * log_radius)), -60.0, 20.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            shear = np.exp(middle)
            below = law.viscosity(np.array([shear**2 / 3.0]))[0] * shear < target
            low, high = (middle, high) if below else (low, middle)
        return float(np.exp(low))

    turning, _ = quad(rate, np.log(1.5), np.log(6.0), epsabs=0.0, epsrel=1e-8, limit=200)
    assert turning == pytest.approx(100.0, rel=1e-7)


class Banding(ConstitutiveLaw):
    """τ = γ̇ / (1 + γ̇²/3) falls beyond γ̇ = √3 1/s: no one solution."""

    kind: Literal["banding"] = "banding"

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 / (1.0 + rate_squared)


class Plastic(ConstitutiveLaw):
    """τ → τ_y as γ̇ → ∞: the tool slips at any speed."""

    kind: Literal["plastic"] = "plastic"

    def viscosity(self, rate_squared: Any) -> Any:
        return (1e-4 + rate_squared) ** -0.5


@pytest.mark.parametrize("law", [Banding(), Plastic()], ids=repr)
def test_no_exact_solution_where_there_is_none(law: ConstitutiveLaw) -> None:
    assert Couette().exact(law, np.array([[2.0, 0.0]]), 0.0) is None


def test_the_tool_only_spins() -> None:
    with pytest.raises(ValidationError, match="motion"):
        Couette(motion="orbit")  # type: ignore[arg-type]


# Solves against the quadrature, relative ℓ² errors of the nodal velocities, regularisation included in both.


def solved(kind: str, first: float) -> dict[str, Any]:
    law = LAWS[kind]
    start = Start() if "index" in law.continued_by else Start(by="regularization", values=(1e3, 1e2, 10.0, 1.0))
    scene = Couette(nodes=GradedRings(first=first, growth=0.12))
    row = march(setup(scene, law=law, linear=SuperLU(), start=start)).summary
    assert row["status"] == "converged", row["message"]
    return row


class TestOnModeratelyGradedNodes:
    """2277 nodes, 0.1 mm at the tool: below 0.5 % where the layer at the tool is no thinner than three spacings."""

    velocity = {  # noqa: RUF012
        "bingham": 0.0003,
        "cross": 0.005,
        "carreau-yasuda": 0.006,
        "herschel-bulkley": 0.0075,
        "norton-hoff": 0.011,
        "sellars-tegart": 0.025,
    }

    @pytest.mark.parametrize("kind", velocity)
    def test_velocity_and_torque(self, kind: str) -> None:
        row = solved(kind, first=0.1)
        assert row["nodes"] == 2277
        assert row["velocity_error"] <= self.velocity[kind]
        assert row["torque_error"] <= 0.01


class TestSpacingThatHalfAPercentTakes:
    """The thinner the layer, which d log τ/d log γ̇ at the tool decides, the finer the first spacing [mm]."""

    bound = 0.005

    @pytest.mark.parametrize(
        ("kind", "first"),
        [
            ("carreau-yasuda", 0.05),
            ("herschel-bulkley", 0.05),
            ("norton-hoff", 0.03),
            pytest.param("sellars-tegart", 0.015, marks=pytest.mark.slow),
        ],
    )
    def test_velocity(self, kind: str, first: float) -> None:
        assert solved(kind, first)["velocity_error"] <= self.bound
