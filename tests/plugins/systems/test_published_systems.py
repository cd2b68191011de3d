"""The published systems: every problem keeps the contract, and its roots are what theory says of them."""

from __future__ import annotations

import numpy as np
import pytest
from nlsolve_systems import Bratu, Chandrasekhar, PLaplacian, Published
from nlsolve_systems.burkardt import hammarling
from nlsolve_systems.catalogue import MORE, PROBLEMS, TEST_NONLIN
from nlsolve_systems.roots import COMPUTED
from pydantic import ValidationError

from nlsolve.plugin import System
from nlsolve.testing import check_system

SIZED = [name for name, listed in PROBLEMS.items() if listed.step]
OTHERS = [
    Bratu(nodes=20),
    Bratu(nodes=6, dimension=2, amplitude=1.0),
    Chandrasekhar(size=8),
    PLaplacian(power=1.5, regularization=0.1),
    PLaplacian(power=3.0, nodes=6, dimension=2),
]


@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_published_problem_keeps_the_contract_and_its_roots(problem: str) -> None:
    """Jacobian by seeds against differences, coefficients along a path, roots to 1e-12 in extended precision."""
    check_system(Published(problem=problem))


@pytest.mark.parametrize("problem", SIZED)
def test_it_does_at_another_size_too(problem: str) -> None:
    check_system(Published(problem=problem, size=12))


@pytest.mark.parametrize(
    "system",
    OTHERS,
    ids=lambda system: f"{system.kind}-{system.dimension}d" if hasattr(system, "dimension") else system.kind,
)
def test_a_discretised_equation_keeps_the_contract(system: System) -> None:
    check_system(system)


def test_there_are_the_23_with_the_published_sizes() -> None:
    assert len(TEST_NONLIN) == 23
    sizes = [len(Published(problem=name).standard_start()) for name in TEST_NONLIN]
    assert sizes == [10, 4, 2, 4, 3, 2, 2, 10, 10, 10, 10, 10, 10, 10, 4, 9, 2, 2, 2, 1, 2, 2, 10]
    assert not set(MORE) & set(TEST_NONLIN)


@pytest.mark.parametrize("problem", [name for name in PROBLEMS if name != "sample-18"])
def test_what_is_said_of_singular_roots(problem: str) -> None:
    """singular ⇔ the least singular value of J is nothing beside the largest at some known root."""
    system = Published(problem=problem)
    roots = system.roots()
    assert roots is not None
    values = [np.linalg.svd(system.equations().jacobian(root).toarray(), compute_uv=False) for root in roots]
    assert system.singular == any(v[-1] <= 1e-12 * max(v[0], 1.0) for v in values)


def test_the_printed_root_of_the_badly_scaled_problem_is_not_accurate() -> None:
    system = Published(problem="powell-badly-scaled")
    printed = np.array([1.098159e-5, 9.106146])
    assert np.abs(system.formula(printed)).max() == pytest.approx(3.8e-7, rel=0.02)
    root = system.nearest_root(printed)
    assert root is not None
    assert np.abs(system.formula(root)).max() < 1e-15
    x = root[0]
    assert np.exp(-x) + np.exp(-1e-4 / x) == pytest.approx(1.0001, abs=1e-15)  # one equation, after elimination


def test_the_other_root_of_the_almost_linear_problem() -> None:
    """x_k = a but for the last, which is a^(1−n): n aⁿ − (n + 1) aⁿ⁻¹ + 1 = 0 (Moré, Garbow & Hillstrom)."""
    root = COMPUTED["brown-almost-linear"][0]
    a = root[0]
    assert 10.0 * a**10 - 11.0 * a**9 + 1.0 == pytest.approx(0.0, abs=1e-14)
    assert root[-1] == pytest.approx(a**-9, rel=1e-14)


@pytest.mark.parametrize("system", [Published(problem="chandrasekhar"), Chandrasekhar(size=7, albedo=0.5)])
def test_the_mean_of_a_root_of_the_h_function(system: System) -> None:
    """Summed over i, the equations of any nodes give c m²/4 − m + 1 = 0 for the mean m."""
    c = getattr(system, "albedo", 0.9)
    roots = system.roots()
    assert roots is not None
    for root in roots:
        mean = root.mean()
        assert c * mean**2 / 4.0 - mean + 1.0 == pytest.approx(0.0, abs=1e-12)
    assert roots[0].mean() == pytest.approx(2.0 * (1.0 - np.sqrt(1.0 - c)) / c, rel=1e-13)


def test_at_the_fold_of_the_h_function_no_root_is_listed_and_it_is_said_to_be_singular() -> None:
    system = Chandrasekhar(size=10, albedo=1.0)
    assert system.roots() is None
    assert system.singular
    problem = system.equations()
    u = system.start()
    for _ in range(40):
        u = u - np.linalg.lstsq(problem.jacobian(u).toarray(), problem.residual(u), rcond=None)[0]
    assert u.mean() == pytest.approx(2.0, abs=1e-5)  # 2 (1 ± 0)/1
    values = np.linalg.svd(problem.jacobian(u).toarray(), compute_uv=False)
    assert values[-1] < 1e-5 * values[0]


def test_two_forms_of_one_equation_have_one_root() -> None:
    """The integral equation is the boundary value problem under its Green's function, which is exact for its nodes."""
    boundary, integral = (COMPUTED[name][0] for name in ("discrete-boundary-value", "discrete-integral-mgh"))
    np.testing.assert_allclose(integral, boundary, rtol=1e-14)
    assert np.abs(COMPUTED["discrete-integral"][0] - boundary).max() > 1e-3  # which counts j = k twice


def test_roots_that_are_more_than_a_list() -> None:
    trigonometric, axes = Published(problem="trigonometric"), Published(problem="sample-18")
    known = COMPUTED["trigonometric"][1]
    turned = known + 2.0 * np.pi * np.arange(-5.0, 5.0)
    np.testing.assert_allclose(trigonometric.formula(turned), 0.0, atol=1e-13)
    np.testing.assert_allclose(trigonometric.nearest_root(turned + 1e-3), turned, atol=1e-14)
    np.testing.assert_array_equal(axes.nearest_root(np.array([1e-3, -4.0])), [0.0, -4.0])
    np.testing.assert_allclose(axes.formula(np.array([3.0, 1e-6])), 0.0, atol=1e-5)


def test_the_surface_of_square_roots() -> None:
    """V X V⁻¹ with V from the commutant of A squares to A as X does, wherever the signs of the blocks differ."""
    root = Published(problem="hammarling-3-by-3").roots()
    assert root is not None
    v = np.array([[1.0, 0.0, 0.7], [0.0, 1.0, 0.0], [0.0, -0.4, 1.0]])
    moved = v @ root[2].reshape(3, 3) @ np.linalg.inv(v)
    np.testing.assert_allclose(hammarling(moved.ravel()), 0.0, atol=1e-13)
    assert np.abs(moved.ravel() - root[2]).max() > 1e-3


def test_bratu_has_two_roots_one_or_none() -> None:
    """u = 2 ln(cosh θ/cosh(θ (1 − 2 x))) with θ = √(λ/8) cosh θ, to second order in h."""
    errors = []
    for nodes in (15, 31):
        roots = Bratu(nodes=nodes).roots()
        assert roots is not None
        assert len(roots) == 2
        theta = 0.4
        for _ in range(100):
            theta = np.sqrt(1.0 / 8.0) * np.cosh(theta)
        x = np.arange(1.0, nodes + 1.0) / (nodes + 1)
        exact = 2.0 * np.log(np.cosh(theta) / np.cosh(theta * (1.0 - 2.0 * x)))
        errors.append(np.abs(roots[0] - exact).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert Bratu(strength=3.6).roots() is None
    lower, upper = Bratu(strength=3.5, nodes=63).roots()
    assert lower.max() < 1.1868 < upper.max()  # where they meet: 1.18684 at λ = 3.51383


def test_the_p_laplacian_with_two_is_poissons_equation() -> None:
    system = PLaplacian(power=2.0, nodes=9)
    np.testing.assert_allclose(system.formula(system.standard_start()), 0.0, atol=1e-13)
    np.testing.assert_allclose(system.roots()[0], system.standard_start(), rtol=1e-14)
    square = PLaplacian(power=2.0, dimension=2, nodes=9)
    np.testing.assert_allclose(
        square.equations().jacobian(square.start()).toarray(),
        Bratu(strength=0.0, dimension=2, nodes=9).equations().jacobian(square.start()).toarray(),
        atol=1e-10,
    )


def test_the_p_laplacian_approaches_the_channel_flow() -> None:
    """Without regularization u = (p − 1)/p (½^q − |½ − x|^q), q = p/(p − 1)."""
    p, nodes = 1.5, 127
    q, x = p / (p - 1.0), np.arange(1.0, nodes + 1.0) / (nodes + 1)
    (root,) = PLaplacian(power=p, regularization=1e-6, nodes=nodes).roots()
    exact = (0.5**q - np.abs(0.5 - x) ** q) / q
    assert np.abs(root - exact).max() < 1e-4 * exact.max()


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"problem": "woods"}, "problem = 'woods': no such problem; did you mean 'wood'"),
        ({"problem": "zzz"}, "there are generalized-rosenbrock, powell-singular"),
        ({"problem": "wood", "size": 5}, "size = 5: wood has 4 unknowns; leave size out"),
        ({"problem": "powell-singular", "size": 6}, "powell-singular can have a multiple of 4 unknowns"),
        ({"problem": "trigonometric", "size": 1}, "trigonometric can have 2 or more unknowns"),
        ({"problem": "wood", "factor": 0.0}, "greater than 0"),
    ],
)
def test_what_is_no_published_problem(fields: dict, sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        Published(**fields)
