"""Laws beside the power law: their contract, their limits, and flows driven by them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import Bingham, CarreauYasuda, Cross, HerschelBulkley, NortonHoff, PowerLaw, SellarsTegart
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from pydantic import ValidationError

from nlsolve.flow.momentum import Flow
from nlsolve.plugin import ConstitutiveLaw, Series
from nlsolve.registry.registry import load_registry
from nlsolve.series import Array
from nlsolve.testing import check_law, check_problem

LAWS: dict[str, ConstitutiveLaw] = {
    "norton-hoff": NortonHoff(),
    "carreau-yasuda": CarreauYasuda(),
    "carreau-yasuda, sharp": CarreauYasuda(sharpness=5.0, fast_viscosity=0.2),
    "cross": Cross(),
    "cross, with a floor": Cross(index=0.05, fast_viscosity=0.2),
    "herschel-bulkley": HerschelBulkley(),
    "herschel-bulkley, stiff": HerschelBulkley(yield_stress=200.0, growth=1e3, index=0.1),
    "bingham": Bingham(),
    "bingham, stiff": Bingham(yield_stress=200.0, growth=1e3),
    "sellars-tegart": SellarsTegart(),
    "sellars-tegart, cold": SellarsTegart(temperature=300.0),
}
RATES = 10.0 ** np.arange(-2.0, 4.0)
SCENE = StirringTool(nodes=Rings(spacing=0.75))
CLOUD = SCENE.cloud(PowerLaw())
OPERATORS = MovingLeastSquares().operators(CLOUD, False)


def equivalent_stress(law: ConstitutiveLaw, rates: Array = RATES) -> Array:
    """3 μ ε̄ [MPa]."""
    return 3.0 * law.viscosity(rates**2) * rates


# The contract.


@pytest.mark.parametrize("name", LAWS)
def test_laws_conform_far_above_and_below_their_regularization(name: str) -> None:
    check_law(LAWS[name])
    check_law(LAWS[name], rates=(1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1))


@pytest.mark.parametrize("name", LAWS)
def test_series_have_finite_coefficients_at_rest(name: str) -> None:
    rest = Series.seed(np.zeros(1))
    for _ in range(6):
        rest.append(np.ones(1))
    viscosity = LAWS[name].viscosity(rest)
    assert all(np.isfinite(viscosity.coefficient(j)).all() for j in range(8))
    assert viscosity.coefficient(0) > 0.0


@pytest.mark.parametrize("name", LAWS)
def test_equivalent_stress_grows_with_the_rate(name: str) -> None:
    assert (np.diff(equivalent_stress(LAWS[name], 10.0 ** np.linspace(-6.0, 6.0, 200))) > 0.0).all()


@pytest.mark.parametrize("name", LAWS)
def test_jacobian_and_expansion_are_those_of_the_residual(name: str) -> None:
    law = LAWS[name]
    flow = Flow(CLOUD, OPERATORS, law, SCENE.boundary_velocity(CLOUD, law, 0.0))
    exact = StirringTool().exact(PowerLaw(index=0.5), CLOUD.nodes, 0.0)
    assert exact is not None
    check_problem(flow, flow.unknowns(exact.velocity))


def test_studies_can_name_them() -> None:
    classes = load_registry().classes("law")
    assert {law.kind_name(): type(law) for law in LAWS.values()}.items() <= classes.items()


def test_power_forms_are_the_laws_without_regularization() -> None:
    for law in (NortonHoff(), HerschelBulkley(yield_stress=0.0), Bingham(yield_stress=0.0)):
        form = law.power_form()
        assert form is not None
        pure = law.with_(regularization=1e-12)
        np.testing.assert_allclose(equivalent_stress(pure), form.consistency * RATES**form.index, rtol=1e-12)
    for law in (HerschelBulkley(), Bingham(), Cross(), CarreauYasuda(), SellarsTegart()):
        assert law.power_form() is None


@pytest.mark.parametrize("name", LAWS)
def test_laws_declare_their_regularization(name: str) -> None:
    assert LAWS[name].with_(regularization=0.3).regularization_rate == 0.3


def test_yielding_laws_are_continued_by_less_yield_stress_and_growth() -> None:
    law = Bingham(yield_stress=20.0, growth=10.0)
    assert [step.yield_stress for step in law.continuation("yield_stress", (1.0, 5.0, 40.0))] == [1.0, 5.0, 20.0]
    assert [step.growth for step in law.continuation("growth", (0.1, 1.0, 1e3))] == [0.1, 1.0, 10.0]
    for without_index in (Bingham(), SellarsTegart()):
        with pytest.raises(ValueError, match=r"start\.by = 'index': .* is continued by regularization.* only"):
            without_index.continuation("index", (1.0,))


# Special cases and limits.


@pytest.mark.parametrize("regularization", [1e-2, 1.0])
@pytest.mark.parametrize("index", [1.0, 0.3, 0.1324])
def test_norton_hoff_and_herschel_bulkley_without_yield_are_power_laws(index: float, regularization: float) -> None:
    power = PowerLaw(consistency=80.0, temperature_exponent=0.0, index=index, regularization=regularization)
    norton = NortonHoff(consistency=80.0 / 3.0 ** ((index + 1.0) / 2.0), index=index, regularization=regularization)
    herschel = HerschelBulkley(yield_stress=0.0, consistency=80.0, index=index, regularization=regularization)
    np.testing.assert_allclose(equivalent_stress(norton), equivalent_stress(power), rtol=1e-13)
    np.testing.assert_allclose(equivalent_stress(herschel), equivalent_stress(power), rtol=1e-13)
    assert norton.power_form() == pytest.approx(power.power_form())


def test_norton_hoff_in_simple_shear() -> None:
    """τ = K γ̇^m."""
    law, shear = NortonHoff(consistency=7.0, index=0.4, regularization=0.0), np.array([0.1, 3.0, 200.0])
    np.testing.assert_allclose(law.viscosity(shear**2 / 3.0) * shear, 7.0 * shear**0.4, rtol=1e-13)


def test_bingham_is_herschel_bulkley_of_index_one() -> None:
    bingham = Bingham(yield_stress=30.0, growth=5.0, plastic_viscosity=2.0)
    herschel = HerschelBulkley(yield_stress=30.0, growth=5.0, consistency=6.0, index=1.0)
    np.testing.assert_allclose(equivalent_stress(bingham), equivalent_stress(herschel), rtol=1e-14)


def test_yield_stress_is_exact_far_above_one_over_the_growth_and_free_of_cancellation_far_below() -> None:
    law = HerschelBulkley(yield_stress=30.0, growth=1e3, consistency=40.0, index=0.3, regularization=1e-12)
    np.testing.assert_allclose(equivalent_stress(law)[1:], 30.0 + 40.0 * RATES[1:] ** 0.3, rtol=1e-12)
    bingham = Bingham(yield_stress=30.0, growth=10.0, plastic_viscosity=1e-9, regularization=1e-12)
    slow = np.array([1e-10, 1e-7, 1e-4, 0.1, 10.0])
    np.testing.assert_allclose(equivalent_stress(bingham, slow), -30.0 * np.expm1(-10.0 * slow), rtol=1e-8)


def test_carreau_yasuda_between_its_limits() -> None:
    law = CarreauYasuda(rest_viscosity=50.0, time=2.0, sharpness=2.0, index=0.4, regularization=0.0)
    assert law.viscosity(np.zeros(1))[0] == 50.0
    assert law.viscosity(np.array([0.75]))[0] == pytest.approx(50.0 * 4.0**-0.3, rel=1e-14)  # Carreau at λ ε̄ = √3
    fast = np.array([1e5, 1e6])
    np.testing.assert_allclose(law.viscosity(fast**2), 50.0 * (2.0 * fast) ** -0.6, rtol=1e-10)
    np.testing.assert_allclose(law.with_(index=1.0).viscosity(RATES**2), 50.0, rtol=1e-15)
    floor = law.with_(fast_viscosity=0.5).viscosity(RATES**2)
    np.testing.assert_allclose(floor, 0.5 + 0.99 * law.viscosity(RATES**2), rtol=1e-14)


def test_cross_between_its_limits() -> None:
    law = Cross(rest_viscosity=50.0, fast_viscosity=2.0, time=0.1, index=0.25, regularization=0.0)
    rest, half, fast = law.viscosity(np.array([0.0, 100.0, 1e40]))
    assert rest == 50.0
    assert half == pytest.approx(26.0, rel=1e-14)  # λ ε̄ = 1
    assert fast == pytest.approx(2.0, rel=1e-12)
    thin = law.with_(fast_viscosity=0.0).viscosity(np.array([1e20]))[0]
    assert thin == pytest.approx(50.0 * 1e9**-0.75, rel=1e-6)
    np.testing.assert_allclose(law.with_(index=1.0).viscosity(RATES**2), 26.0, rtol=1e-15)


def test_sellars_tegart_inverted() -> None:
    """Z = A sinh(α σ̄)ⁿ, whatever pair of rate and temperature makes it."""
    law = SellarsTegart(regularization=0.0)
    compensated = RATES * np.exp(law.activation_energy / (8.314462618 * law.temperature))
    from_stress = law.rate_factor * np.sinh(law.stress_factor * equivalent_stress(law)) ** law.stress_exponent
    np.testing.assert_allclose(from_stress, compensated, rtol=1e-11)
    warm = law.with_(temperature=800.0)
    same = RATES * np.exp(law.activation_energy / 8.314462618 * (1.0 / 800.0 - 1.0 / 750.0)) ** -1
    np.testing.assert_allclose(equivalent_stress(warm, same), equivalent_stress(law), rtol=1e-12)


def test_sellars_tegart_at_low_and_high_stress() -> None:
    law = SellarsTegart(regularization=0.0)
    n, alpha = law.stress_exponent, law.stress_factor
    slow = 10.0 ** np.arange(-24.0, -20.0)
    arrhenius = np.exp(law.activation_energy / (8.314462618 * law.temperature)) / law.rate_factor
    np.testing.assert_allclose(equivalent_stress(law, slow), (slow * arrhenius) ** (1.0 / n) / alpha, rtol=1e-7)
    decade = np.diff(equivalent_stress(law, np.array([1e20, 1e21])))
    np.testing.assert_allclose(decade, np.log(10.0) / (n * alpha), rtol=1e-6)


# Laws that make no sense.


@pytest.mark.parametrize(
    ("law", "field", "value"),
    [
        (NortonHoff, "consistency", 0.0),
        (NortonHoff, "index", 0.0),
        (NortonHoff, "regularization", -1.0),
        (CarreauYasuda, "rest_viscosity", 0.0),
        (CarreauYasuda, "fast_viscosity", -1.0),
        (CarreauYasuda, "time", 0.0),
        (CarreauYasuda, "sharpness", 0.0),
        (Cross, "index", 1.5),
        (Cross, "fast_viscosity", 60.0),
        (HerschelBulkley, "yield_stress", -1.0),
        (HerschelBulkley, "growth", 0.0),
        (HerschelBulkley, "regularization", 0.0),
        (Bingham, "plastic_viscosity", 0.0),
        (Bingham, "index", 0.5),
        (SellarsTegart, "temperature", 0.0),
        (SellarsTegart, "rate_factor", 0.0),
        (SellarsTegart, "stress_exponent", float("nan")),
    ],
)
def test_a_law_that_makes_no_sense_is_refused_by_field(law: type[Any], field: str, value: Any) -> None:
    with pytest.raises(ValidationError, match=field):
        law(**{field: value})
