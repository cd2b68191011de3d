"""Laws that create power or whose stress falls, exact solutions that solve nothing, and SI numbers: each is doubted."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from cases import LAWS, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Cavity, Channel, Couette, Manufactured, StirringTool
from nlsolve_scenes.nodes.rings import Rings

from nlsolve import Status
from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.flow.claims.exact import disagreement
from nlsolve.flow.claims.law import falling_stress, gained_power
from nlsolve.flow.claims.units import strange_sizes
from nlsolve.flow.continuation import Start
from nlsolve.flow.validity import LIMITS
from nlsolve.plugin import ConstitutiveLaw, Discretizer, Exact, FlowScene, Physics, SolveError
from nlsolve.solving.simulate import run_case

AT_ONCE = Start(by="load", values=())


def row(scene: FlowScene, **parts: Any) -> dict[str, Any]:
    return run_case(setup(scene, **({"error_estimator": LinearTriangles()} | parts))).summary


class Donor(ConstitutiveLaw):
    """μ = 10 − share ε̄² : a viscosity that is negative at high rates."""

    kind: Literal["donor"] = "donor"
    share: float = 0.4

    def viscosity(self, rate_squared: Any) -> Any:
        return 10.0 - self.share * rate_squared


class Slipping(ConstitutiveLaw):
    """μ = 1/(1 + ε̄²/peak²) : 2 μ ε̄ grows up to ε̄ = peak, then falls."""

    kind: Literal["slipping"] = "slipping"
    peak: float = 1.0

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 / (1.0 + rate_squared / self.peak**2)


# A law that gives off power.


def test_a_law_that_gives_off_power_is_doubted_by_the_run() -> None:
    found = row(Manufactured(spacing=0.15), law=Donor(share=8.0), start=AT_ONCE)
    assert found["status"] == "converged"
    assert found["audit.gained_power"] > 0.0
    assert "the law 'donor' gives off power, S:ε̇ < 0, at " in found["doubt"]
    assert "make its viscosity positive" in found["doubt"]


def test_the_doubt_names_the_worst_point_its_rate_and_the_number_of_points() -> None:
    """ε̇xy = 1, 2, 6 at three points: ε̄² = 4/3 ε̇xy² and S:ε̇ = 4 μ ε̇xy²."""
    points, rate = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 3.0]]), np.zeros((3, 3))
    rate[2] = [1.0, 2.0, 6.0]
    found = gained_power(Donor(), points, rate)
    power = 4.0 * (10.0 - 0.4 * 4.0 / 3.0 * rate[2] ** 2) * rate[2] ** 2
    assert found.value == pytest.approx(-power[2] / np.abs(power).max())
    assert "at 1 of 3 strain points, most at (2, 3), where μ = -9.2 MPa s and ε̄ = 6.93 1/s" in found.sentence


def test_a_positive_viscosity_gives_off_nothing_and_rest_says_nothing() -> None:
    points = np.zeros((4, 2))
    assert gained_power(Donor(), points, 1e-3 * np.ones((3, 4))).value == 0.0
    assert np.isnan(gained_power(Donor(), points, np.zeros((3, 4))).value)


def test_a_viscosity_that_is_negative_everywhere_is_told_twice() -> None:
    rate = np.ones((3, 5)) * np.arange(1, 6)
    assert gained_power(Donor(share=1e3), np.zeros((5, 2)), rate).value == 1.0
    assert np.isnan(falling_stress(Donor(share=1e3), rate).value)


# A stress that falls.


def test_a_stress_that_falls_is_doubted_by_the_run() -> None:
    by_load = Start(by="load", values=tuple(np.linspace(0.1, 0.95, 12)))
    found = row(Manufactured(spacing=0.15), law=Slipping(peak=1.3), start=by_load)
    assert found["status"] == "converged"
    assert found["audit.falling_stress"] > 0.01
    assert "the stress 2 μ ε̄ of the law 'slipping' falls from 1.3 MPa at ε̄ = 1.3 1/s to 1.28 MPa" in found["doubt"]


def test_a_stress_that_falls_at_rates_that_the_state_does_not_have_is_no_doubt() -> None:
    found = row(Manufactured(spacing=0.15), law=Slipping(peak=1e3), start=AT_ONCE)
    assert found["audit.falling_stress"] == 0.0
    assert found["doubt"] == ""


def test_the_fall_is_from_the_largest_stress_before() -> None:
    """2 μ ε̄ = 2 ε̄/(1 + ε̄²) falls from 1 at 1 to 0.2 at about 10; ε̄ = 2/√3 ε̇xy."""
    rate = np.zeros((3, 2))
    rate[2] = np.array([0.1, 10.0]) * np.sqrt(3.0) / 2.0
    found = falling_stress(Slipping(), rate)
    assert found.value == pytest.approx(1.0 - 2.0 * 10.0 / 101.0, rel=1e-3)
    assert "from 1 MPa at ε̄ = 1" in found.sentence
    assert "to 0.198 MPa at 10 1/s" in found.sentence


@pytest.mark.parametrize("law", [*LAWS.values(), PowerLaw(index=1e-3, regularization=0.0), PowerLaw(index=4.0)])
def test_no_shipped_law_falls_or_gives_off_power(law: ConstitutiveLaw) -> None:
    rate = np.zeros((3, 60))
    rate[2] = np.geomspace(1e-12, 1e8, 60)
    with np.errstate(all="ignore"):
        assert falling_stress(law, rate).value <= LIMITS["audit.falling_stress"].largest
        assert gained_power(law, np.zeros((60, 2)), rate).value == 0.0


# An exact solution that does not solve its scene.


class WrongChannel(Channel):
    """A channel whose closed solution is that of a faster flow."""

    kind: Literal["wrong-channel"] = "wrong-channel"  # type: ignore[assignment]
    factor: float = 1.0

    def exact(self, law: ConstitutiveLaw, points: Any, time: float) -> Exact | None:
        exact = super().exact(law, points, time)
        return None if exact is None else Exact(self.factor * exact.velocity, exact.quantities)


@pytest.mark.parametrize("discretizer", [MovingLeastSquares(), MovingLeastSquares(form="conservative")])
@pytest.mark.parametrize(("factor", "doubted"), [(1.3, True), (0.5, True), (1.0, False)])
def test_an_exact_solution_that_does_not_solve_its_scene_is_doubted(
    factor: float, doubted: bool, discretizer: Discretizer
) -> None:
    found = row(WrongChannel(factor=factor), discretizer=discretizer)
    assert (found["audit.exact"] > LIMITS["audit.exact"].largest) == doubted
    assert ("from the exact solution of the scene 'wrong-channel'" in found["doubt"]) == doubted


def test_a_small_error_an_unknown_one_and_one_without_estimate_say_nothing() -> None:
    for error, estimate in ((0.04, 1e-6), (np.nan, 1e-6), (0.5, np.nan), (0.5, 0.0)):
        assert np.isnan(disagreement("spin", error, estimate).value)
    found = disagreement("spin", 0.5, 0.01)
    assert found.value == pytest.approx(50.0)
    assert "is 50 % from the exact solution of the scene 'spin', and its error is estimated as 1 %" in found.sentence


# Numbers in SI units.

METRES = StirringTool(tool_radius=1.5e-3, plate_radius=6e-3, nodes=Rings(spacing=5e-4))
PASCALS = PowerLaw(consistency=2.69e16, index=0.5)


@pytest.mark.parametrize("density", [2.81e-9, 2810.0])
def test_a_scene_in_si_units_gets_one_sentence(density: float) -> None:
    found = row(METRES, law=PASCALS, physics=Physics(density=density))
    assert found["doubt"].count("as if the numbers were in SI units") == 1
    assert "MPa at ε̄ = 100 1/s" in found["doubt"]
    assert ("the density is 2.81e+03 t/mm³" in found["doubt"]) == (density > 1.0)
    assert "in a scene of 0.012 mm" in found["doubt"]


def test_a_scene_in_si_units_whose_nodes_are_spaced_in_mm_says_so_too() -> None:
    found = row(METRES.with_(nodes=Rings()), law=PASCALS)
    assert found["status"] == Status.BAD_CLOUD.word
    assert "none inside" in found["message"]
    assert "are its lengths in m?" in found["message"]


def spread(extent: float) -> Cloud:
    return Cloud(np.array([[0.0, 0.0], [extent, 0.0], [0.0, 0.5 * extent]]), {})


@pytest.mark.parametrize(
    ("law", "density", "rate", "extent"),
    [
        (PowerLaw(), 2.81e-9, 100.0, 12.0),
        (PowerLaw(index=1.0), 2.81e-9, 100.0, 0.05),  # thinner than a hair, at 11 GPa
        (PowerLaw(), 7.8e-9, 1e4, 0.01),
        (PowerLaw(consistency=1.0, index=1.0), 1000.0, 1.0, 1.0),  # no units: a Reynolds number of 1000 and more
        (PowerLaw(index=0.1324), 2.2e-8, 1e-6, 1e4),
    ],
)
def test_materials_in_mm_and_mpa_and_numbers_without_units_are_no_si(
    law: ConstitutiveLaw, density: float, rate: float, extent: float
) -> None:
    assert strange_sizes(law, density, rate, spread(extent)).value <= LIMITS["audit.units"].largest


@pytest.mark.parametrize(
    ("law", "density", "extent"),
    [
        (PASCALS, 2.81e-9, 0.012),
        (PASCALS, 2.81e-9, 0.5),  # half a metre
        (PowerLaw(), 7800.0, 0.012),
        (PowerLaw(), 7.8e-6, 0.012),  # kg/mm³, in m
    ],
)
def test_si_numbers_are_told_by_their_sizes(law: ConstitutiveLaw, density: float, extent: float) -> None:
    assert strange_sizes(law, density, 100.0, spread(extent)).value > LIMITS["audit.units"].largest


@pytest.mark.parametrize(
    "scene", [StirringTool(nodes=Rings(spacing=0.5)), Couette(nodes=Rings(spacing=0.5)), Channel(), Manufactured()]
)
@pytest.mark.parametrize("name", ["audit.gained_power", "audit.falling_stress", "audit.exact", "audit.units"])
def test_no_shipped_scene_belies_itself(scene: FlowScene, name: str) -> None:
    value = row(scene, index=0.5)[name]
    assert np.isnan(value) or value <= LIMITS[name].largest


def test_claims_are_audited_where_the_other_audits_cannot_be_made() -> None:
    class Fails(MovingLeastSquares):
        def gradient(self, cloud: Cloud) -> Any:
            raise SolveError(Status.BAD_CLOUD, "inside out")

    found = row(Manufactured(spacing=0.15), law=Donor(share=8.0), start=AT_ONCE, discretizer=Fails())
    assert found["doubt"].startswith("the audits could not be made: inside out; the law 'donor' gives off power")


def test_a_lid_of_any_density_is_no_si() -> None:
    physics = Physics(density=10.0, convection=True, penalty=1e3)
    law = PowerLaw(consistency=1.0, temperature_exponent=0.0, index=1.0)
    assert row(Cavity(spacing=0.15), law=law, physics=physics)["audit.units"] <= 1.0
