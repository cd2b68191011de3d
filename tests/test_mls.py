"""Moving least squares: reproduction of polynomials, patches, and clouds that carry no discretisation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_collocation import MovingLeastSquares
from nlsolve_collocation.least_squares import Supports, monomials, weight_function, weights
from nlsolve_collocation.triangles import Triangles
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.rings import GradedRings, Rings
from pydantic import ValidationError
from scipy.spatial import cKDTree

from nlsolve import Cloud, Operators, SolveError, Status
from nlsolve.flow import Flow, node_major
from nlsolve.series import Array
from nlsolve.testing import check_discretizer

CLOUDS = {
    "rings": StirringTool(nodes=Rings(spacing=0.5)).cloud(PowerLaw()),
    "graded": StirringTool(nodes=GradedRings(first=0.15, growth=0.2, spacing=0.5)).cloud(PowerLaw()),
    "grid": Channel(spacing=0.2).cloud(PowerLaw()),
    "jittered": Channel(spacing=0.2, jitter=0.3, seed=2).cloud(PowerLaw()),
}


def jittered_points(seed: int, side: int = 9) -> Array:
    """A jittered grid over the unit square."""
    shift = np.random.default_rng(seed).uniform(-0.3, 0.3, (side * side, 2)) / (side - 1)
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, side)] * 2), axis=-1).reshape(-1, 2)
    return grid + shift


def power(x: Array, exponents: tuple[int, int], derivative: tuple[int, int]) -> Array:
    """∂^(i+j) of x^a y^b."""
    result = np.ones(len(x))
    for axis in range(2):
        a, i = exponents[axis], derivative[axis]
        factor = float(np.prod([a - l for l in range(i)]))  # noqa: E741
        result = result * (factor * x[:, axis] ** (a - i) if a >= i else 0.0)
    return result


# Least squares.


@settings(max_examples=20)
@given(
    st.integers(0, 10**6),
    st.sampled_from([1, 2, 3, 4]),
    st.sampled_from(["gaussian", "quartic", "spline"]),
    st.booleans(),
)
def test_weights_reproduce_polynomials_up_to_their_degree(seed: int, degree: int, weight: str, by_radius: bool) -> None:
    """Σ φ_i p(x_i) = L p(x) for every monomial p of the degree, L the value or a first or second derivative."""
    x = jittered_points(seed)
    targets = np.random.default_rng(seed + 1).uniform(0.1, 0.9, (12, 2))
    count = 3 * len(monomials(degree))
    supports = Supports.within(x, targets, 0.65) if by_radius else Supports.nearest(x, targets, count)
    derivatives = tuple(d for d in monomials(min(degree, 2)))
    phis = weights(x, targets, supports, degree, derivatives, weight, 3.0)
    for derivative, phi in zip(derivatives, phis, strict=True):
        for exponents in monomials(degree):
            found = (phi * power(x, exponents, (0, 0))[supports.index]).sum(axis=1)
            size = float(np.abs(phi).sum(axis=1).max())
            np.testing.assert_allclose(found, power(targets, exponents, derivative), atol=1e-10 * size)


def test_one_degree_more_is_not_reproduced() -> None:
    """The check above can fail: x³ is no polynomial of degree 2."""
    x = jittered_points(0)
    targets = np.array([[0.4, 0.6]])
    supports = Supports.nearest(x, targets, 18)
    (phi,) = weights(x, targets, supports, 2, ((1, 0),), "gaussian", 3.0)
    assert abs((phi * x[supports.index, 0] ** 3).sum() - 3 * 0.4**2) > 1e-5


def test_weight_functions_are_one_at_the_centre_and_fall_to_the_edge() -> None:
    s = np.linspace(0.0, 1.0, 50)
    for name in ("gaussian", "quartic", "spline"):
        w = weight_function(name, s, 3.0)
        assert w[0] == 1.0
        assert (np.diff(w) < 0.0).all()
    assert weight_function("spline", np.ones(1), 3.0)[0] == pytest.approx(0.0, abs=1e-15)
    assert weight_function("quartic", np.ones(1), 3.0)[0] == 0.0
    np.testing.assert_allclose(weight_function("gaussian", s, 2.0), np.exp(-4.0 * s**2))


def test_supports_hold_the_nearest_neighbours() -> None:
    x, targets = jittered_points(3), np.array([[0.5, 0.5], [0.0, 0.0]])
    supports = Supports.nearest(x, targets, 7)
    for target, index, radius in zip(targets, supports.index, supports.radius, strict=True):
        distance = np.linalg.norm(x - target, axis=1)
        assert set(index) == set(np.argsort(distance)[:7])
        assert np.sort(distance)[6] < radius < np.sort(distance)[7]
    within = Supports.within(x, targets, 0.3)
    ball = cKDTree(x).query_ball_point(targets, 0.3)
    for index, inside in zip(within.index, ball, strict=True):
        assert set(inside) <= set(index)


# Operators.


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
@pytest.mark.parametrize(
    "discretizer",
    [
        MovingLeastSquares(),
        MovingLeastSquares(points="nodes"),
        MovingLeastSquares(volume_points="nodes"),
        MovingLeastSquares(degree=1, support=6, force_support=6),
        MovingLeastSquares(degree=3, support=18, force_support=20),
        MovingLeastSquares(weight="quartic", support=14, force_support=18),
        MovingLeastSquares(weight="spline", support=14, force_support=18),
    ],
    ids=lambda d: f"{d.points} {d.volume_points} {d.degree} {d.weight}",
)
def test_mls_conforms(cloud: Cloud, discretizer: MovingLeastSquares) -> None:
    check_discretizer(discretizer, cloud)


@pytest.mark.parametrize("points", ["between", "nodes"])
def test_mls_of_the_papers_influence_radius_conforms(points: Any) -> None:
    check_discretizer(MovingLeastSquares(points=points, radius=2.0), CLOUDS["rings"])


class Twisted(MovingLeastSquares):
    """Shear taken as ∂u/∂y alone: a rotation strains."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        full = super().operators(cloud, volumetric)
        strain = full.strain.tolil()
        shear = strain[2 * len(full.strain_points) :]
        shear[:, 1::2] = 0.0
        strain[2 * len(full.strain_points) :] = shear
        return Operators(
            strain.tocsr(), full.force, full.strain_points, full.dilatation, full.pressure_force, full.volume_points
        )


def test_the_check_of_discretizers_can_fail() -> None:
    with pytest.raises(AssertionError, match="rotation"):
        check_discretizer(Twisted(), CLOUDS["jittered"])


@pytest.mark.parametrize("degree", [2, 3])
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_operators_differentiate_polynomials_of_their_degree_exactly(degree: int, seed: int) -> None:
    """B on velocities x^i y^j, S on stresses x^i y^j, on jittered clouds."""
    cloud = Channel(spacing=0.2, jitter=0.3, seed=seed).cloud(PowerLaw())
    support = {2: 12, 3: 18}[degree]
    operators = MovingLeastSquares(degree=degree, support=support, force_support=support + 4).operators(cloud, False)
    nodes, points, inside = cloud.nodes, operators.strain_points, cloud.nodes[cloud.interior]
    m = len(points)
    strain_size = float(abs(operators.strain).sum(axis=1).max())
    force_size = float(abs(operators.force).sum(axis=1).max())
    for exponents in monomials(degree):
        value = power(nodes, exponents, (0, 0))
        along = power(points, exponents, (1, 0)), power(points, exponents, (0, 1))
        rate = operators.strain @ np.stack([value, 2.0 * value], axis=1).ravel()
        expected = np.concatenate([along[0], 2.0 * along[1], 0.5 * along[1] + along[0]])
        np.testing.assert_allclose(rate, expected, atol=1e-10 * strain_size * 2**degree)
        s = power(points, exponents, (0, 0))
        slope = power(inside, exponents, (1, 0)), power(inside, exponents, (0, 1))
        force = operators.force @ np.concatenate([s, 3.0 * s, -s])
        expected = np.stack([slope[0] - slope[1], -slope[0] + 3.0 * slope[1]], axis=1).ravel()
        np.testing.assert_allclose(force, expected, atol=1e-10 * force_size * 3 * 2**degree)
    assert rate.shape == (3 * m,)


def eigenvalues(points: Any, seed: int) -> Array:
    """Of R's linear part for n = 1, μ = 1: −S 2 B on the unknowns."""
    scene, law = (
        Channel(spacing=0.25, jitter=0.2, seed=seed),
        PowerLaw(index=1.0, consistency=3.0, temperature_exponent=0.0),
    )
    cloud = scene.cloud(PowerLaw())
    operators = MovingLeastSquares(points=points).operators(cloud, False)
    flow = Flow(cloud, operators, law, scene.boundary_velocity(cloud, law, 0.0))
    return np.linalg.eigvals(flow.jacobian(np.zeros(2 * len(cloud.interior))).toarray())


@pytest.mark.parametrize("seed", range(5))
def test_stress_points_have_no_odd_even_mode(seed: int) -> None:
    """All eigenvalues of −div 2 ε̇ lie well to the right of zero: −∇² on the 2 × 2 square begins at π²/2 ≈ 4.9."""
    assert eigenvalues("between", seed).real.min() > 2.0


@pytest.mark.parametrize("seed", range(5))
def test_the_composed_form_has_odd_even_modes(seed: int) -> None:
    """For contrast: neighbours decouple, so that a mode of the shortest wavelength costs next to nothing, or less."""
    assert eigenvalues("nodes", seed).real.min() < 1.0


# Patches of the volumetric term.


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_patches_cover_every_triangle_once(cloud: Cloud) -> None:
    triangles = Triangles.of(cloud)
    patch = triangles.pairs()
    sizes = np.bincount(patch)
    assert len(patch) == len(triangles.corners)
    assert set(np.unique(sizes)) <= {1, 2}
    assert (sizes == 2).mean() > 0.8  # a matching that leaves many triangles single would lock
    ends, beside = triangles.edges
    neighbours = {frozenset(pair) for pair in beside[beside[:, 1] >= 0].tolist()}
    order = np.argsort(patch, kind="stable")
    pairs = [frozenset(part.tolist()) for part in np.split(order, np.cumsum(sizes)[:-1]) if len(part) == 2]
    assert set(pairs) <= neighbours
    assert (ends[:, 0] < ends[:, 1]).all()


def polygon_area(x: Array) -> float:
    return 0.5 * abs(float(np.sum(x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1))))


@pytest.mark.parametrize("name", CLOUDS)
def test_areas_of_the_triangles_add_up_to_the_polygon(name: str) -> None:
    cloud = CLOUDS[name]
    areas = Triangles.of(cloud).areas
    if name in ("rings", "graded"):
        expected = polygon_area(cloud.nodes[cloud.boundaries["plate"]]) - polygon_area(
            cloud.nodes[cloud.boundaries["tool"]]
        )
    else:
        expected = 2.0 * 2.0
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_volumetric_operators_are_adjoint(cloud: Cloud) -> None:
    """A_i S_θ = −B_θᵀ A on the unknowns, so that the penalty only dissipates: u · A_i S_θ λ B_θ u ≤ 0."""
    operators = MovingLeastSquares().operators(cloud, True)
    triangles = Triangles.of(cloud)
    patch_area = np.bincount(triangles.pairs(), triangles.areas)
    node_area = np.bincount(triangles.corners.ravel(), np.repeat(triangles.areas / 3.0, 3), len(cloud.nodes))
    free = node_major(cloud.interior)
    left = sp.diags_array(np.repeat(node_area[cloud.interior], 2)) @ operators.pressure_force
    right = -(sp.diags_array(patch_area) @ operators.dilatation[:, free]).T
    assert abs(left - right).max() <= 1e-13 * abs(right).max()
    assert patch_area.sum() == pytest.approx(triangles.areas.sum(), rel=1e-13)


def test_there_is_about_one_volume_point_a_node_and_far_more_strain_points() -> None:
    cloud = StirringTool().cloud(PowerLaw())
    operators = MovingLeastSquares().operators(cloud, True)
    assert operators.volume_points is not None
    assert 0.8 < len(operators.volume_points) / len(cloud.nodes) < 1.2
    assert 2.0 < len(operators.strain_points) / len(cloud.nodes) < 3.1


# Clouds that carry no discretisation.


def failing(nodes: Array, boundaries: dict[str, Any] | None = None, **fields: Any) -> SolveError:
    with pytest.raises(SolveError) as ending:
        MovingLeastSquares(**fields).operators(Cloud(nodes, boundaries or {"hull": np.arange(0)}), True)
    assert ending.value.status is Status.BAD_CLOUD
    return ending.value


def test_coincident_nodes_are_named() -> None:
    nodes = jittered_points(1)
    nodes[40] = nodes[41]
    assert f"({nodes[40, 0]:.6g}, {nodes[40, 1]:.6g})" in failing(nodes).detail


def test_too_few_nodes_for_a_support_are_told() -> None:
    assert "10 neighbours was asked for among 9 points" in failing(jittered_points(1, side=3)).detail


def test_too_few_neighbours_within_the_radius_are_named_by_place() -> None:
    detail = failing(jittered_points(1), radius=0.16).detail
    assert "do not determine a polynomial of degree 2" in detail
    assert "the point (" in detail


def test_collinear_nodes_are_a_bad_cloud() -> None:
    nodes = np.stack([np.linspace(0.0, 1.0, 40)] * 2, axis=1)
    failing(nodes)


def test_collinear_neighbours_are_named_by_place() -> None:
    """A cluster on a line far from the rest: each point there sees collinear neighbours only."""
    line = np.stack([np.linspace(10.0, 11.0, 40), np.zeros(40)], axis=1)
    detail = failing(np.concatenate([jittered_points(1), line])).detail
    place = detail.split("(")[1].split(",")[0]
    assert float(place) > 5.0


def test_supports_smaller_than_the_polynomial_are_refused_at_once() -> None:
    with pytest.raises(ValidationError, match="support = 5: polynomials of degree 2 need at least 6 points"):
        MovingLeastSquares(support=5)
    with pytest.raises(ValidationError, match="force_support = 9: polynomials of degree 3 need at least 10 points"):
        MovingLeastSquares(degree=3, force_support=9, support=12)
