"""Constitutive laws: one formula, and its tangent and limits drawn from it."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from nlsolve_laws import PowerLaw
from pydantic import ValidationError

from nlsolve.contracts.continuum.law import rate_squared, stress, tangent_moduli
from nlsolve.plugin import ConstitutiveLaw
from nlsolve.series import Array
from nlsolve.testing import check_law

INDICES = (1.0, 0.5, 0.3, 0.1324, 0.05)


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("regularization", [1e-3, 1e-2, 1.0])
def test_power_law_conforms(index: float, regularization: float) -> None:
    check_law(PowerLaw(index=index, regularization=regularization))


class WithoutTaylor(PowerLaw):
    """Values that are right and a slope that is not: the formula leaves the series it is given."""

    def viscosity(self, rate_squared: Any) -> Any:
        mu = super().viscosity(rate_squared)
        return mu if isinstance(rate_squared, np.ndarray) else mu + 1e-6 * (rate_squared - rate_squared.coefficient(0))


class Negative(ConstitutiveLaw):
    kind: Literal["negative"] = "negative"

    def viscosity(self, rate_squared: Any) -> Any:
        return 1.0 - rate_squared


class Misnamed(PowerLaw):
    continued_by: ClassVar = {"indx": "larger"}


def test_the_check_of_laws_can_fail() -> None:
    with pytest.raises(AssertionError, match=r"continued by \['indx'\], which are none of its fields"):
        check_law(Misnamed())
    with pytest.raises(AssertionError, match="by seed"):
        check_law(WithoutTaylor())
    with pytest.raises(AssertionError, match="positive finite"):
        check_law(Negative())


def test_equivalent_stress_is_k_rate_to_the_n() -> None:
    """3 μ ε̄ = k T^A ε̄ⁿ with k T^A = 164.76 N/mm² at 300 K."""
    law = PowerLaw(index=0.1324, regularization=0.0)
    rate = np.array([0.1, 1.0, 100.0])
    np.testing.assert_allclose(3.0 * law.viscosity(rate**2) * rate, 164.76 * rate**0.1324, rtol=1e-4)
    form = law.power_form()
    np.testing.assert_allclose(3.0 * law.viscosity(rate**2) * rate, form.consistency * rate**form.index, rtol=1e-12)


def test_simple_shear_of_the_power_form() -> None:
    """γ̇ alone: ε̇xy = γ̇/2 and τ = S_xy = m γ̇ⁿ."""
    law = PowerLaw(index=0.3, regularization=0.0)
    form = law.power_form()
    shear = np.array([2.0, 50.0])
    s = stress(law, np.stack([0.0 * shear, 0.0 * shear, 0.5 * shear]))
    np.testing.assert_allclose(s[2], form.shear_consistency * shear**form.index, rtol=1e-12)


def test_equivalent_rate_of_uniaxial_flow_is_the_axial_rate_of_plane_strain() -> None:
    """ε̇ = (e, −e, 0): ε̄² = 2/3 · 2 e²; shear counts twice."""
    np.testing.assert_allclose(rate_squared(np.array([[3.0], [-3.0], [0.0]])), [12.0])
    np.testing.assert_allclose(rate_squared(np.array([[0.0], [0.0], [3.0]])), [12.0])


@pytest.mark.parametrize("index", INDICES)
@given(arrays(float, (3, 4), elements=st.floats(-100.0, 100.0)))
def test_tangent_moduli_are_the_derivative_of_the_stress(index: float, rate: Array) -> None:
    law = PowerLaw(index=index, regularization=10.0)
    moduli = tangent_moduli(law, rate)
    assert moduli.shape == (3, 3, 4)
    for i in range(3):
        step = np.zeros((3, 1))
        step[i] = 1e-3
        difference = (stress(law, rate + step) - stress(law, rate - step)) / 2e-3
        np.testing.assert_allclose(moduli[:, i], difference, rtol=1e-6, atol=1e-6 * float(np.abs(moduli).max()))


def test_continuation_passes_through_easier_laws_only() -> None:
    law = PowerLaw(index=0.25)
    assert [step.index for step in law.continuation("index", (1.0, 0.5, 0.3, 0.2))] == [1.0, 0.5, 0.3, 0.25]
    assert [step.regularization for step in law.continuation("regularization", (10.0, 1.0))] == [10.0, 1.0, 1e-2]
    with pytest.raises(ValueError, match=r"'indx'.* is continued by index, regularization only$"):
        law.continuation("indx", (1.0,))
    with pytest.raises(ValueError, match=r"'temperature'.* is continued by index, regularization only$"):
        law.continuation("temperature", (1.0,))
    with pytest.raises(ValueError, match=r"the law 'negative' is continued by none of its fields"):
        Negative().continuation("index", (1.0,))


def test_a_law_says_what_its_regularization_is() -> None:
    assert PowerLaw(regularization=0.5).regularization_rate == 0.5
    assert Negative().regularization_rate is None


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("index", 0.0),
        ("index", -0.5),
        ("regularization", -1e-3),
        ("temperature", 0.0),
        ("consistency", -1.0),
        ("index", float("nan")),
        ("consistency", float("inf")),
        ("index", "soft"),
        ("indx", 0.3),
    ],
)
def test_a_law_that_makes_no_sense_is_refused_by_field(field: str, value: Any) -> None:
    with pytest.raises(ValidationError, match=field):
        PowerLaw(**{field: value})
    with pytest.raises(ValidationError, match=field):
        PowerLaw().with_(**{field: value})


def test_laws_are_frozen_values() -> None:
    law = PowerLaw()
    with pytest.raises(ValidationError, match="frozen"):
        law.index = 0.5  # type: ignore[misc]
    assert law.with_(index=0.5).index == 0.5
    assert law.index == 0.1324
