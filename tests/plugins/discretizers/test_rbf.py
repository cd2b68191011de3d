"""Radial basis functions: kernels and their derivatives, conditioning, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import setup
from clouds import CLOUDS, jittered_points
from nlsolve_discretizers import MovingLeastSquares, RadialBasis
from nlsolve_discretizers.collocation import GRADIENT
from nlsolve_discretizers.kernels.offsets import scaled
from nlsolve_discretizers.weights.least_squares import monomials
from nlsolve_discretizers.weights.radial import interpolate, kernel
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_laws import PowerLaw
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Auto

from nlsolve import SolveError, Status
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case as march

KERNELS: dict[str, tuple[Any, Any]] = {
    "phs 3": (kernel("phs", 3, 0.0), lambda r: r**3),
    "phs 5": (kernel("phs", 5, 0.0), lambda r: r**5),
    "phs 7": (kernel("phs", 7, 0.0), lambda r: r**7),
    "gaussian": (kernel("gaussian", 3, 1.3), lambda r: np.exp(-((1.3 * r) ** 2))),
    "multiquadric": (kernel("multiquadric", 3, 1.3), lambda r: np.sqrt(1.0 + (1.3 * r) ** 2)),
    "wendland": (
        kernel("wendland", 3, 1.3),
        lambda r: np.maximum(0.0, 1.0 - 1.3 * r) ** 4 * (5.2 * r + 1.0),
    ),
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_are_the_functions_of_their_names(name: str) -> None:
    """φ(r²), beyond the edge of the one with compact support too."""
    phi, expected = KERNELS[name]
    r = np.linspace(0.01, 1.5, 40)
    np.testing.assert_allclose(phi(r**2), expected(r), atol=1e-13)


@pytest.mark.parametrize("name", KERNELS)
def test_weights_interpolate_the_kernel_of_every_neighbour(name: str) -> None:
    """Σ_i w_i φ(|x_i − x_j|) = L φ(|x − x_j|) for each neighbour j; L of the right by central differences."""
    phi, of_radius = KERNELS[name]
    offsets = jittered_points(2, side=4)[None, :12] - [0.4, 0.35]
    (w_x, w_xy, w_yy), quality = interpolate(
        scaled(offsets.T, np.ones(1)), np.ones(1), 2, ((1, 0), (1, 1), (0, 2)), phi
    )
    assert quality[0] > 1e-13
    distance = np.linalg.norm(offsets[0][:, None] - offsets[0][None], axis=2)

    def at(x: float, y: float) -> Array:
        return of_radius(np.hypot(x - offsets[0][:, 0], y - offsets[0][:, 1]))

    h = 1e-4
    along_x = (at(h, 0) - at(-h, 0)) / (2 * h)
    mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4 * h**2)
    along_yy = (at(0, h) - 2 * at(0, 0) + at(0, -h)) / h**2
    # The multipliers of the polynomials take the rest: it must be a polynomial of degree 2 in x_j.
    polynomials = np.stack([offsets[0][:, 0] ** i * offsets[0][:, 1] ** j for i, j in monomials(2)], axis=1)
    for weights, expected in ((w_x, along_x), (w_xy, mixed), (w_yy, along_yy)):
        rest = expected - of_radius(distance) @ weights[0]
        left = rest - polynomials @ np.linalg.lstsq(polynomials, rest, rcond=None)[0]
        assert np.abs(left).max() < 1e-5 * max(1.0, float(np.abs(expected).max()))


def test_weights_do_not_depend_on_the_size_of_the_cloud() -> None:
    """w of ∂/∂x on a cloud a hundred times as large is a hundredth; shapes follow the spacing."""
    x = jittered_points(3)
    for discretizer in (RadialBasis(), RadialBasis(kernel="gaussian", shape=0.6), RadialBasis(degree=3, power=5)):
        _, (small, _) = discretizer.weights(x, x[30:40], "value", GRADIENT)
        _, (large, _) = discretizer.weights(100.0 * x, 100.0 * x[30:40], "value", GRADIENT)
        np.testing.assert_allclose(100.0 * large, small, rtol=1e-7, atol=1e-9 * np.abs(small).max())


def test_smooth_functions_are_differentiated_to_the_order_of_the_degree() -> None:
    """Error of ∂/∂x of sin(x) cosh(y) falls as h^degree."""
    for degree, power in ((2, 3), (3, 5), (4, 7)):
        errors = []
        for scale in (1.0, 0.5):
            x = scale * (jittered_points(7) - 0.5)
            target = scale * np.random.default_rng(0).uniform(-0.2, 0.2, (20, 2))
            supports, (w, _) = RadialBasis(degree=degree, power=power).weights(x, target, "value", GRADIENT)
            values = np.sin(3 * x[:, 0]) * np.cosh(2 * x[:, 1])
            exact = 3 * np.cos(3 * target[:, 0]) * np.cosh(2 * target[:, 1])
            errors.append(float(np.abs((w * values[supports.index]).sum(axis=1) - exact).mean()))
        assert np.log2(errors[0] / errors[1]) > degree - 0.4


def test_the_estimated_condition_number_is_that_of_the_local_system() -> None:
    """‖A‖_F ‖A⁻¹‖_F within a factor of 30, over thirteen decades."""
    x = jittered_points(5)
    supports = Supports.nearest(x, np.full((1, 2), 0.5), 15)
    offsets = x[supports.index] - 0.5
    for name, power, shape in (("phs", 3, 0.0), ("phs", 7, 0.0), ("gaussian", 3, 1.0), ("gaussian", 3, 0.3)):
        phi = kernel(name, power, shape)
        _, quality = interpolate(scaled(offsets.T, supports.radius), supports.radius, 2, GRADIENT, phi)
        places = offsets[0] / supports.radius[0]
        p = np.stack([places[:, 0] ** i * places[:, 1] ** j for i, j in monomials(2)], axis=1)
        distance = ((places[:, None] - places[None]) ** 2).sum(axis=2)
        system = np.block([[phi(distance), p], [p.T, np.zeros((6, 6))]])
        assert 1 / 30 < quality[0] * np.linalg.cond(system, "fro") < 30


def test_supports_are_half_as_large_again_next_to_walls() -> None:
    cloud = CLOUDS["grid"]
    supports = RadialBasis(balanced=False).supports(cloud.nodes, cloud.nodes, "volume", cloud)
    on_wall = cloud.on_boundary
    assert set(supports.count[on_wall]) == {18}
    middle = np.linalg.norm(cloud.nodes - cloud.nodes.mean(axis=0), axis=1) < 0.5
    assert set(supports.count[middle]) == {12}


# Refusals.


def refused(discretizer: RadialBasis, sources: Array, target: Array) -> str:
    with pytest.raises(SolveError) as ending:
        discretizer.weights(sources, target, "value", GRADIENT)
    assert ending.value.status is Status.ILL_CONDITIONED
    assert f"({target[0, 0]:.6g}, {target[0, 1]:.6g})" in ending.value.detail
    return ending.value.detail


def test_a_kernel_too_flat_is_refused_by_place_with_the_way_out() -> None:
    """ε → 0 makes all rows of Φ alike."""
    for name in ("gaussian", "multiquadric"):
        discretizer = RadialBasis(kernel=name, shape=1e-3)
        sentence = refused(discretizer, jittered_points(1), np.array([[0.5, 0.5]]))
        assert f"the kernel {name!r} on the " in sentence
        assert "has a condition number of " in sentence
        assert sentence.endswith("raise discretizer.shape or use the kernel phs")


def test_collinear_neighbours_are_refused_however_far_they_reach() -> None:
    line = np.stack([np.linspace(0.0, 1.0, 60), np.zeros(60)], axis=1)
    sentence = refused(RadialBasis(), line, np.array([[0.505, 0.0]]))
    assert "the kernel 'phs' on the " in sentence
    assert sentence.endswith("widen the supports")


def test_one_singular_system_does_not_spoil_the_others() -> None:
    """Both lie in one batch; quality 0 for the one, the weights of the other as if it were alone."""
    sound = jittered_points(2, side=4)[None, :12] - 0.4
    line = np.stack([np.arange(12.0), np.zeros(12)], axis=1)[None] / 12.0
    phi = kernel("phs", 3, 0.0)
    alone, _ = interpolate(scaled(sound.T, np.ones(1)), np.ones(1), 2, GRADIENT, phi)
    both, quality = interpolate(scaled(np.concatenate([line, sound]).T, np.ones(2)), np.ones(2), 2, GRADIENT, phi)
    np.testing.assert_allclose(both[:, 1], alone[:, 0], rtol=1e-10)
    assert quality[0] < 1e-14 < quality[1]


def test_phs_and_least_squares_agree_on_smooth_fields() -> None:
    """Two independent sets of weights, one answer to second order."""
    cloud = CLOUDS["jittered"]
    field = np.exp(0.3 * cloud.nodes[:, 0]) * np.sin(0.5 * cloud.nodes[:, 1])
    inside = cloud.interior
    for one, other in zip(RadialBasis().gradient(cloud), MovingLeastSquares().gradient(cloud), strict=True):
        assert np.abs((one - other) @ field)[inside].max() < 0.02


# The form.


@pytest.mark.parametrize(("index", "form"), [(1.0, "strong"), (0.3, "strong"), (0.2, "conservative")])
def test_the_form_that_is_absent_follows_the_index(index: float, form: str) -> None:
    law = PowerLaw(index=index)
    assert RadialBasis().for_law(law, 100.0).form == form
    for given in ("strong", "conservative"):
        assert RadialBasis(form=given).for_law(law, 100.0).form == given


def test_small_indices_are_solved_by_the_default_form_and_not_by_the_strong_one() -> None:
    """The row says which form it was, and where it fails what to choose."""
    law = PowerLaw(index=0.05, regularization=1e-3)
    scene = StirringTool(nodes=Auto(resolution=2.0, growth=0.3, spacing=0.5))
    absent, strong = (
        march(setup(scene, discretizer=discretizer, law=law)).summary
        for discretizer in (RadialBasis(), RadialBasis(form="strong"))
    )
    assert (absent["form"], absent["status"]) == ("conservative", "converged")
    assert absent["torque_error"] < 0.01
    assert strong["form"] == "strong"
    assert strong["status"] != "converged"
    assert 'at an index of 0.05: leave discretizer.form out, or set it to "conservative"' in strong["message"]


def test_there_is_no_advice_where_the_form_is_not_the_cause() -> None:
    for form, index in (("strong", 0.3), ("conservative", 0.05), (None, 0.05)):
        assert not RadialBasis(form=form).advice(PowerLaw(index=index), 100.0)
