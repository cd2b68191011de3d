"""Collocation weights and operators: reproduction of polynomials, supports that grow, no odd-even mode."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cases import setup
from clouds import CLOUDS, jittered_points, power
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_discretizers.collocation import GRADIENT, Collocation
from nlsolve_discretizers.weights.least_squares import monomials, weight_function
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from pydantic import ValidationError
from scipy.spatial import cKDTree

from nlsolve import SolveError, Status
from nlsolve.contracts.continuum.cloud import node_major
from nlsolve.plugin import Cloud, Discretizer, Operators
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case
from nlsolve.testing import check_discretizer

SUPPORT = {1: 8, 2: 15, 3: 24, 4: 34}  # of a degree, for least squares

WEIGHTS: list[Collocation] = [
    MovingLeastSquares(degree=degree, support=SUPPORT[degree], force_support=20, volume_support=20, weight=weight)
    for degree in (1, 2, 3, 4)
    for weight in ("gaussian", "quartic", "spline")
] + [RadialBasis(degree=degree, power=power) for degree in (2, 3, 4) for power in (3, 5, 7)]
WEIGHTS += [RadialBasis(kernel=kernel, shape=0.6) for kernel in ("gaussian", "multiquadric", "wendland")]


def label(discretizer: Discretizer) -> str:
    """What is not default."""
    fields = type(discretizer).model_fields
    given = {name: value for name, value in discretizer.model_dump().items() if value != fields[name].default}
    return " ".join([discretizer.kind_name(), *(f"{name}={value}" for name, value in given.items())])


# Weights.


def worst_reproduction(discretizer: Collocation, sources: Array, targets: Array) -> float:
    """Largest |Σ φ_i p(x_i) − L p| / Σ |φ_i p(x_i)| over monomials p of the degree around each target, and L ≤ 2."""
    derivatives = tuple(monomials(min(discretizer.degree, 2)))
    supports, phis = discretizer.weights(sources, targets, "value", derivatives)
    offsets = sources[supports.index] - targets[:, None]
    worst = 0.0
    for derivative, phi in zip(derivatives, phis, strict=True):
        for exponents in monomials(discretizer.degree):
            terms = phi * power(offsets.reshape(-1, 2), exponents, (0, 0)).reshape(phi.shape)
            exact = power(np.zeros((1, 2)), exponents, derivative)
            size = np.abs(terms).sum(axis=1) + np.abs(exact)
            # A sum of terms that all vanish has no size of its own: one distance of a neighbour gives it one.
            size += 1e-3 * np.abs(phi).sum(axis=1) * supports.radius ** sum(exponents)
            worst = max(worst, float((np.abs(terms.sum(axis=1) - exact) / size).max()))
    return worst


@pytest.mark.parametrize("discretizer", WEIGHTS, ids=label)
@settings(max_examples=4)
@given(seed=st.integers(0, 10**6))
def test_weights_reproduce_polynomials_up_to_their_degree(discretizer: Collocation, seed: int) -> None:
    """Values, first and second derivatives, mixed ones too; inside, at nodes, and beyond the last node in a corner."""
    sources = jittered_points(seed)
    inside = np.random.default_rng(seed + 1).uniform(0.1, 0.9, (10, 2))
    targets = np.concatenate([inside, sources[:12], [[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]])
    assert worst_reproduction(discretizer, sources, targets) < 1e-9


def test_one_degree_more_is_not_reproduced() -> None:
    """The check above can fail: x³ is no polynomial of degree 2."""
    sources, target = jittered_points(0), np.array([[0.4, 0.6]])
    for discretizer in (MovingLeastSquares(support=18), RadialBasis(support=18)):
        supports, (phi,) = discretizer.weights(sources, target, "value", ((1, 0),))
        assert abs((phi * sources[supports.index, 0] ** 3).sum() - 3 * 0.4**2) > 1e-5


def test_weights_by_radius_reproduce_polynomials() -> None:
    sources = jittered_points(4)
    targets = np.random.default_rng(0).uniform(0.1, 0.9, (20, 2))
    assert worst_reproduction(MovingLeastSquares(radius=0.35), sources, targets) < 1e-9


def test_weight_functions_are_one_at_the_centre_and_fall_to_the_edge() -> None:
    s = np.linspace(0.0, 1.0, 50)
    for name in ("gaussian", "quartic", "spline"):
        w = weight_function(name, s, 3.0)
        assert w[0] == 1.0
        assert (np.diff(w) < 0.0).all()
    assert weight_function("spline", np.ones(1), 3.0)[0] == pytest.approx(0.0, abs=1e-15)
    assert weight_function("quartic", np.ones(1), 3.0)[0] == 0.0
    np.testing.assert_allclose(weight_function("gaussian", s, 2.0), np.exp(-4.0 * s**2))


# Supports.


def test_supports_hold_the_nearest_neighbours() -> None:
    x, targets = jittered_points(3), np.array([[0.5, 0.5], [0.0, 0.0]])
    supports = Supports.nearest(x, targets, 7)
    for target, index, radius in zip(targets, supports.index, supports.radius, strict=True):
        distance = np.linalg.norm(x - target, axis=1)
        assert set(index) == set(np.argsort(distance)[:7])
        assert np.sort(distance)[6] < radius < np.sort(distance)[7]
    within = Supports.within(x, targets, 0.3)
    ball = cKDTree(x).query_ball_point(targets, 0.3)
    for index, count, near in zip(within.index, within.count, ball, strict=True):
        assert set(index[:count]) == set(near)


def one_sided() -> tuple[Array, Array]:
    """Nodes ten times as dense, column by column, left of x = 0 as right of it, and a target at the last dense one."""
    columns = np.concatenate([np.linspace(-1.0, 0.0, 21), [0.16, 0.4, 0.6]])
    x = np.stack([c.ravel() for c in np.meshgrid(columns, np.linspace(-1.0, 1.0, 41))], axis=1)
    return x, np.array([[0.01, 0.02]])


def test_balanced_supports_reach_the_near_quadrants_that_have_nodes() -> None:
    sources, target = one_sided()
    plain = Supports.nearest(sources, target, 10)
    assert (sources[plain.index][..., 0] < target[0, 0]).all()
    balanced = Supports.nearest(sources, target, 10, balanced=True)
    assert 10 < balanced.count[0] <= 20
    chosen = sources[balanced.index[0, : balanced.count[0]]] - target
    assert {(bool(x >= 0), bool(y >= 0)) for x, y in chosen} == {(a, b) for a in (False, True) for b in (False, True)}
    order = np.argsort(np.linalg.norm(sources - target, axis=1))
    assert set(balanced.index[0, : balanced.count[0]]) == set(order[: balanced.count[0]])


def test_an_empty_quadrant_beyond_reach_does_not_enlarge_a_support() -> None:
    """At a wall there is nothing outside to be balanced with."""
    sources = jittered_points(5)
    supports = Supports.nearest(sources, np.array([[0.0, 0.0]]), 10, balanced=True)
    assert supports.count[0] <= 12


def two_lines() -> tuple[Array, Array]:
    """A quadratic is not determined by the nodes nearest to the target, which lie on two lines."""
    along = np.linspace(0.0, 1.0, 21)
    lines = np.concatenate([np.stack([along, np.full(21, y)], axis=1) for y in (0.0, 0.02, 0.3)])
    return lines, np.array([[0.5, 0.011]])


@pytest.mark.parametrize("discretizer", [MovingLeastSquares(), RadialBasis(support=10)], ids=label)
def test_supports_on_two_lines_grow_until_they_determine_the_polynomial(discretizer: Collocation) -> None:
    sources, target = two_lines()
    before = discretizer.supports(sources, target, "value", None)
    assert len(np.unique(sources[before.index[0, : before.count[0]], 1])) == 2
    after, _ = discretizer.weights(sources, target, "value", GRADIENT)
    assert after.count[0] > before.count[0]
    assert len(np.unique(sources[after.index[0, : after.count[0]], 1])) == 3
    assert worst_reproduction(discretizer, sources, target) < 1e-9


def test_a_radius_that_holds_too_few_neighbours_grows() -> None:
    sources = jittered_points(1)
    discretizer = MovingLeastSquares(radius=0.16)
    before, (after, _) = (
        discretizer.supports(sources, sources, "value", None),
        discretizer.weights(sources, sources, "value", GRADIENT),
    )
    assert before.count.min() < len(monomials(2)) <= after.count.min()
    assert worst_reproduction(discretizer, sources, sources) < 1e-9


def test_sound_supports_do_not_grow() -> None:
    sources = jittered_points(1)
    for discretizer in (MovingLeastSquares(support=14, balanced=False), RadialBasis(support=14, balanced=False)):
        supports, _ = discretizer.weights(sources, np.full((1, 2), 0.5), "value", GRADIENT)
        assert supports.count[0] == 14


# Operators.


def forms(**parts: Any) -> list[Collocation]:
    """Both kinds of weights."""
    return [kind.model_validate(parts) for kind in (MovingLeastSquares, RadialBasis)]


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
@pytest.mark.parametrize(
    "discretizer",
    [
        *forms(),
        *forms(points="nodes"),
        *forms(volume_points="nodes"),
        *forms(form="conservative"),
        *forms(form="conservative", points="nodes", volume_points="nodes"),
        MovingLeastSquares(degree=1, support=6, force_support=6),
        MovingLeastSquares(degree=3, support=20, force_support=22),
        MovingLeastSquares(weight="quartic", support=14, force_support=18),
        MovingLeastSquares(weight="spline", support=14, force_support=18, form="conservative"),
        MovingLeastSquares(radius=1.0),
        MovingLeastSquares(radius=1.0, form="conservative"),
        RadialBasis(degree=3, power=5),
        RadialBasis(degree=3, power=5, form="conservative"),
        RadialBasis(kernel="multiquadric"),
        RadialBasis(kernel="wendland", form="conservative"),
        LinearTriangles(),
    ],
    ids=label,
)
def test_discretizers_conform(cloud: Cloud, discretizer: Discretizer) -> None:
    check_discretizer(discretizer, cloud)


def test_mls_of_the_papers_influence_radius_conforms() -> None:
    for points in ("between", "nodes"):
        check_discretizer(MovingLeastSquares(points=points, radius=2.0), CLOUDS["rings"])


class Twisted(MovingLeastSquares):
    """Shear taken as ∂u/∂y alone: a rotation strains."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        full = super().operators(cloud, volumetric)
        rate = full.strain.rate.tolil()
        rate[2 * len(full.strain.points) :, 1::2] = 0.0
        return replace(full, strain=replace(full.strain, rate=rate.tocsr()))


class Lopsided(LinearTriangles):
    """Forces twice what the strain rates of the same points ask for."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        full = super().operators(cloud, volumetric)
        return replace(full, strain=replace(full.strain, force=2.0 * full.strain.force))


def test_the_check_of_discretizers_can_fail() -> None:
    with pytest.raises(AssertionError, match="rotation"):
        check_discretizer(Twisted(), CLOUDS["jittered"])
    with pytest.raises(AssertionError, match="S = −Bᵀ A: off by"):
        check_discretizer(Lopsided(), CLOUDS["jittered"])


@pytest.mark.parametrize(
    "discretizer",
    [
        MovingLeastSquares(support=12, force_support=16),
        MovingLeastSquares(degree=3, support=18, force_support=22),
        RadialBasis(),
        RadialBasis(degree=3, power=5),
    ],
    ids=label,
)
@settings(max_examples=4)
@given(seed=st.integers(0, 10**6))
def test_operators_differentiate_polynomials_of_their_degree_exactly(discretizer: Collocation, seed: int) -> None:
    """B on velocities x^i y^j, S on stresses x^i y^j, on jittered clouds."""
    cloud = Channel(spacing=0.2, jitter=0.3, seed=seed).cloud(PowerLaw())
    operators = discretizer.operators(cloud, False)
    nodes, points, inside = cloud.nodes, operators.strain.points, cloud.nodes[cloud.interior]
    strain_size = float(abs(operators.strain.rate).sum(axis=1).max())
    force_size = float(abs(operators.strain.force).sum(axis=1).max())
    for exponents in monomials(discretizer.degree):
        value = power(nodes, exponents, (0, 0))
        along = power(points, exponents, (1, 0)), power(points, exponents, (0, 1))
        rate = operators.strain.rate @ np.stack([value, 2.0 * value], axis=1).ravel()
        expected = np.concatenate([along[0], 2.0 * along[1], 0.5 * along[1] + along[0]])
        np.testing.assert_allclose(rate, expected, atol=1e-10 * strain_size * 2**discretizer.degree)
        s = power(points, exponents, (0, 0))
        slope = power(inside, exponents, (1, 0)), power(inside, exponents, (0, 1))
        force = operators.strain.force @ np.concatenate([s, 3.0 * s, -s])
        expected = np.stack([slope[0] - slope[1], -slope[0] + 3.0 * slope[1]], axis=1).ravel()
        np.testing.assert_allclose(force, expected, atol=1e-10 * force_size * 3 * 2**discretizer.degree)


# The symbol of −div 2 ε̇.

SQUARE = {"spacing": 2.0 / 13.0}  # 196 nodes on 2 × 2 mm
LOWEST = 7.2  # eigenvalue of −div 2 ε̇ there, walls held; 7.19 by linear triangles on a grid, 7.25 by RBF


def minus_divergence(discretizer: Discretizer, cloud: Cloud) -> Array:
    """−W⁻¹ S 2 B on the unknowns."""
    operators = discretizer.operators(cloud, False)
    matrix = -(operators.strain.force @ (2.0 * operators.strain.rate[:, node_major(cloud.interior)])).toarray()
    return matrix if operators.node_areas is None else matrix / np.repeat(operators.node_areas, 2)[:, None]


BETWEEN = [*forms(), *forms(form="conservative"), LinearTriangles()]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("discretizer", BETWEEN, ids=label)
def test_stress_points_between_nodes_have_no_odd_even_mode(discretizer: Discretizer, seed: int) -> None:
    """All eigenvalues lie to the right of the lowest one of the continuous operator, or nearly so."""
    cloud = Channel(**SQUARE, jitter=0.3, seed=seed).cloud(PowerLaw())
    assert np.linalg.eigvals(minus_divergence(discretizer, cloud)).real.min() > 0.95 * LOWEST


@pytest.mark.parametrize("seed", range(3))
def test_the_composed_form_has_odd_even_modes(seed: int) -> None:
    """For contrast: neighbours decouple, so that a mode of the shortest wavelength costs next to nothing, or less."""
    cloud = Channel(**SQUARE, jitter=0.3, seed=seed).cloud(PowerLaw())
    strong, conservative = (
        np.linalg.eigvals(minus_divergence(MovingLeastSquares(points="nodes", form=form), cloud)).real.min()
        for form in ("strong", "conservative")
    )
    assert strong < 0.0
    assert conservative < 0.5 * LOWEST


def cost_of_checkerboard(discretizer: Discretizer) -> float:
    """v · (−div 2 ε̇(v)) / v · v for v = (−1)^(i+j) sin²(πx/2) sin²(πy/2) on a grid: 16/h² at most."""
    cloud = Channel(**SQUARE).cloud(PowerLaw())
    place = (cloud.nodes - cloud.nodes.min(axis=0)) / SQUARE["spacing"]
    wave = (-1.0) ** np.round(place).sum(axis=1) * (np.sin(np.pi * place / 13.0) ** 2).prod(axis=1)
    v = np.stack([wave, wave], axis=1)[cloud.interior].ravel()
    return float(v @ minus_divergence(discretizer, cloud) @ v / (v @ v))


@pytest.mark.parametrize("discretizer", BETWEEN, ids=label)
def test_a_checkerboard_of_velocities_costs_as_much_as_it_should(discretizer: Discretizer) -> None:
    assert cost_of_checkerboard(discretizer) > 2.0 / SQUARE["spacing"] ** 2


@pytest.mark.parametrize("discretizer", [*forms(), *forms(form="conservative")], ids=label)
def test_stress_at_nodes_hardly_sees_a_checkerboard(discretizer: Collocation) -> None:
    """For contrast: the derivative at a node leaves out the node itself; only supports at walls are not symmetric."""
    at_nodes = discretizer.with_(points="nodes")
    assert cost_of_checkerboard(at_nodes) < 0.2 * cost_of_checkerboard(discretizer)


# Values, gradients, diagnostics.


@pytest.mark.parametrize("discretizer", [*forms(), LinearTriangles()], ids=label)
def test_values_and_gradients_of_linear_fields_are_exact(discretizer: Discretizer) -> None:
    cloud = CLOUDS["graded"]
    field, random = 3.0 + cloud.nodes @ [2.0, -1.0], np.random.default_rng(0)
    angle, radius = random.uniform(0.0, 2.0 * np.pi, 50), random.uniform(1.5, 5.9, 50)
    targets = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    np.testing.assert_allclose(discretizer.values(cloud.nodes, targets) @ field, 3.0 + targets @ [2.0, -1.0], atol=1e-9)
    for derivative, slope in zip(discretizer.gradient(cloud), (2.0, -1.0), strict=True):
        np.testing.assert_allclose(derivative @ field, slope, atol=1e-9)


@pytest.mark.parametrize("discretizer", [*forms(), *forms(degree=3, support=24), LinearTriangles()], ids=label)
@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_diagnostics_of_sound_clouds(discretizer: Discretizer, cloud: Cloud) -> None:
    if isinstance(discretizer, MovingLeastSquares) and discretizer.degree == 3:
        discretizer = discretizer.with_(force_support=24, volume_support=24)
    rows = discretizer.diagnostics(cloud)
    assert [row["operator"] for row in rows] == ["strain", "force", "volume"][: len(rows)]
    for row in rows:
        assert set(row) == set(DIAGNOSTICS)
        assert row["smallest_support"] <= row["largest_support"]
        assert 0 <= row["grown"] <= row["targets"]
        assert 1e-4 < row["balance"] <= 1.0
        assert row["reproduction_error"] < 1e-10
        assert 1.0 < row["largest_weight"] < 100.0


def test_diagnostics_tell_of_supports_that_grew() -> None:
    """Rows of nodes twenty times as near as columns: the nearest neighbours all lie in one or two columns."""
    sound = CLOUDS["grid"]
    squeezed = sound.moved_to(sound.nodes * [1.0, 0.05])
    row, sick = (RadialBasis().diagnostics(cloud)[0] for cloud in (sound, squeezed))
    assert row["grown"] == 0 < sick["grown"]
    assert sick["balance"] < 0.5 * row["balance"]
    assert sick["largest_weight"] > 2.0 * row["largest_weight"]


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


def test_collinear_nodes_are_a_bad_cloud() -> None:
    nodes = np.stack([np.linspace(0.0, 1.0, 40)] * 2, axis=1)
    assert "the nodes lie on one line" in failing(nodes).detail


def test_collinear_neighbours_are_named_by_place() -> None:
    """A cluster on a line far from the rest: each point there sees collinear neighbours only, however it grows."""
    line = np.stack([np.linspace(10.0, 11.0, 60), np.zeros(60)], axis=1)
    detail = failing(np.concatenate([jittered_points(1), line])).detail
    assert "do not determine a polynomial of degree 2: widen the supports or lower the degree" in detail
    assert float(detail.split("(")[1].split(",")[0]) > 5.0


def test_supports_smaller_than_the_polynomial_are_refused_at_once() -> None:
    with pytest.raises(ValidationError, match="support = 5: polynomials of degree 2 need at least 6 points"):
        MovingLeastSquares(support=5)
    with pytest.raises(ValidationError, match="force_support = 9: polynomials of degree 3 need at least 10 points"):
        MovingLeastSquares(degree=3, force_support=9, support=12)
    with pytest.raises(ValidationError, match="support = 9: polynomials of degree 3 need at least 10 points"):
        RadialBasis(degree=3, support=9)


def test_a_flow_that_is_not_solved_on_small_supports_is_told_of_them() -> None:
    scene = StirringTool(nodes=Rings(spacing=0.5))
    row = run_case(setup(scene, 0.1324, discretizer=MovingLeastSquares(balanced=False, degree=3))).summary
    assert row["status"] != "converged"
    advice = (
        "discretizer.support = 10 and force_support = 12: few points for polynomials of degree 3, which have 10 "
        "coefficients: give at least 15, or lower discretizer.degree"
    )
    assert advice in row["message"]


def test_the_advice_names_the_supports_that_are_small() -> None:
    advice = MovingLeastSquares(support=6).advice(PowerLaw(), 100.0)
    assert advice.startswith("discretizer.support = 6: few points for polynomials of degree 2, which have 6")


@pytest.mark.parametrize(
    "ample", [{}, {"degree": 1}, {"degree": 3, "support": 15, "force_support": 15}, {"radius": 1.0}]
)
def test_there_is_no_advice_where_supports_are_ample(ample: dict[str, Any]) -> None:
    assert not MovingLeastSquares(**ample).advice(PowerLaw(), 100.0)
