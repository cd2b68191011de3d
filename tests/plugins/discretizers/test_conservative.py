"""Conservative forms S = −Bᵀ A: triangles and their patches, the patch test, symmetry, the potential, balance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from clouds import CLOUDS
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_discretizers.collocation import GRADIENT
from nlsolve_discretizers.conservation import conserving
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.triangles import Triangles
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, Manufactured, StirringTool

from nlsolve import SolveError, Status
from nlsolve.contracts.continuum.cloud import node_major
from nlsolve.flow.convection import Convection
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Cloud, Discretizer
from nlsolve.series import Array

FORMS: list[Discretizer] = [
    kind.model_validate({"form": "conservative", "points": points, "volume_points": volume})
    for kind in (MovingLeastSquares, RadialBasis)
    for points, volume in (("between", "pairs"), ("nodes", "nodes"))
]
FORMS.append(LinearTriangles())
LAW = PowerLaw(index=0.4, regularization=1e-2)


def label(discretizer: Any) -> str:
    return f"{discretizer.kind} {getattr(discretizer, 'points', '')}".strip()


# Triangles and patches of the volumetric term.


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_patches_cover_every_triangle_once(cloud: Cloud) -> None:
    triangles = Triangles.of(cloud)
    patch = triangles.pairs()
    sizes = np.bincount(patch)
    assert len(patch) == len(triangles.corners)
    assert sizes.min() >= 1
    assert (sizes == 2).mean() > 0.75  # a matching that leaves many triangles single would lock
    ends, beside = triangles.edges
    neighbours = {frozenset(pair) for pair in beside[beside[:, 1] >= 0].tolist()}
    order = np.argsort(patch, kind="stable")
    pairs = [frozenset(part.tolist()) for part in np.split(order, np.cumsum(sizes)[:-1]) if len(part) == 2]
    assert set(pairs) <= neighbours
    assert (ends[:, 0] < ends[:, 1]).all()


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_every_patch_has_a_node_that_moves(cloud: Cloud) -> None:
    """A patch held by walls only has a dilatation that no unknown can change: a penalty on it would be an error."""
    volumetric = MovingLeastSquares().operators(cloud, True).volumetric
    assert volumetric is not None
    dilatation = volumetric.rate[:, node_major(cloud.interior)]
    assert abs(dilatation).sum(axis=1).min() > 0.0


def test_a_patch_held_by_walls_is_joined_to_a_neighbour() -> None:
    """Three nodes on two walls around a corner: their triangle alone, whatever the pairing, has no unknown."""
    side = np.linspace(0.0, 1.0, 5)
    nodes = np.stack([c.ravel() for c in np.meshgrid(side, side)], axis=1)
    low, left = np.flatnonzero(nodes[:, 1] == 0.0), np.flatnonzero((nodes[:, 0] == 0.0) & (nodes[:, 1] > 0.0))
    other = np.flatnonzero((nodes.max(axis=1) == 1.0) & (nodes.min(axis=1) > 0.0))
    cloud = Cloud(nodes, {"bottom": low, "left": left, "rest": other})
    corners = np.array([[0, 1, 5], [1, 6, 5], [1, 2, 6], [2, 7, 6], [5, 6, 10], [6, 11, 10]])
    held = Triangles(cloud, corners, corners)
    assert cloud.on_boundary[corners[0]].all()
    alone = np.arange(len(corners))
    _, beside = held.edges
    joined = held._without_held_patches(alone, beside[beside[:, 1] >= 0].T)
    assert joined[0] == joined[1]
    assert (np.delete(joined, 0) == np.arange(1, len(corners))).all()


def polygon_area(x: Array) -> float:
    return 0.5 * abs(float(np.sum(x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1))))


@pytest.mark.parametrize("name", CLOUDS)
def test_areas_add_up_to_the_polygon(name: str) -> None:
    """Triangles, nodes, diamonds and patches: four ways to divide the same material."""
    cloud = CLOUDS[name]
    triangles = Triangles.of(cloud)
    if name in ("rings", "graded"):
        plate, tool = (cloud.nodes[cloud.boundaries[wall]] for wall in ("plate", "tool"))
        expected = polygon_area(plate) - polygon_area(tool)
    else:
        expected = 2.0 * 2.0
    assert triangles.areas.min() > 0.0
    for areas in (triangles.areas, triangles.node_areas, triangles.diamonds()[1], triangles.patches().areas):
        assert areas.sum() == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_volumetric_operators_of_the_strong_form_are_adjoint(cloud: Cloud) -> None:
    """W S_θ = −B_θᵀ A on the unknowns, so that the penalty only dissipates: u · W S_θ λ B_θ u ≤ 0."""
    operators = MovingLeastSquares().operators(cloud, True)
    triangles = Triangles.of(cloud)
    patch_area = np.bincount(triangles.pairs(), triangles.areas)
    free = node_major(cloud.interior)
    left = sp.diags_array(np.repeat(triangles.node_areas[cloud.interior], 2)) @ operators.volumetric.force
    right = -(sp.diags_array(patch_area) @ operators.volumetric.rate[:, free]).T
    assert abs(left - right).max() <= 1e-13 * abs(right).max()


def test_there_is_about_one_volume_point_a_node_and_far_more_strain_points() -> None:
    cloud = StirringTool().cloud(PowerLaw())
    operators = MovingLeastSquares().operators(cloud, True)
    assert operators.volumetric is not None
    assert 0.8 < len(operators.volumetric.points) / len(cloud.nodes) < 1.2
    assert 2.0 < len(operators.strain.points) / len(cloud.nodes) < 3.1


# The patch test.


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
@pytest.mark.parametrize("discretizer", FORMS, ids=label)
def test_constant_stress_and_pressure_exert_no_force(discretizer: Discretizer, cloud: Cloud) -> None:
    """Σ_q A_q ∇φ_i(x_q) = 0, the discrete divergence theorem."""
    operators = discretizer.operators(cloud, True)
    m, count = len(operators.strain.points), len(operators.volumetric.points)
    for force, constant in (
        (operators.strain.force, np.repeat([3.0, -1.0, 2.0], m)),
        (operators.volumetric.force, np.ones(count)),
    ):
        assert np.abs(force @ constant).max() < 1e-10 * float((abs(force) @ np.abs(constant)).max())


def test_uncorrected_gradients_fail_the_patch_test() -> None:
    """The check above can fail: S = −Bᵀ A with the gradients of the strong form."""
    cloud = CLOUDS["jittered"]
    points, areas = Triangles.of(cloud).diamonds()
    strong = MovingLeastSquares()._gradient(cloud.nodes, points, "strain", cloud).matrices(len(cloud.nodes))
    for derivative in strong:
        force = (derivative.T @ areas)[cloud.interior]
        assert np.abs(force).max() > 1e-3 * float((abs(derivative).T @ areas).max())


@pytest.mark.parametrize("discretizer", FORMS, ids=label)
def test_linear_velocities_on_the_walls_give_the_linear_field(discretizer: Discretizer) -> None:
    """The patch test solved: R(v) = 0 for v linear, whatever the law."""
    cloud = CLOUDS["jittered"]
    velocity = cloud.nodes @ np.array([[0.6, 0.2], [-0.9, -0.6]])
    flow = Flow(cloud, discretizer.operators(cloud, True), LAW, velocity[cloud.boundary], 1e3)
    u = flow.unknowns(velocity)
    assert np.linalg.norm(flow.residual(u)) < 1e-10 * flow.scale(u)


# Symmetry and the potential.


def flow_of(discretizer: Discretizer, cloud: Cloud, law: PowerLaw = LAW) -> Flow:
    """Walls that shear and stretch, with a penalty."""
    x, y = cloud.nodes[cloud.boundary].T
    walls = np.stack([np.sin(y) + 0.3 * x, 0.5 * np.cos(x) - 0.3 * y], axis=1)
    return Flow(cloud, discretizer.operators(cloud, True), law, walls, 10.0)


@pytest.mark.parametrize("name", ["jittered", "graded"])
@pytest.mark.parametrize("discretizer", FORMS, ids=label)
def test_the_tangent_is_symmetric_and_positive(discretizer: Discretizer, name: str) -> None:
    flow = flow_of(discretizer, CLOUDS[name])
    assert flow.is_gradient
    u = np.random.default_rng(0).standard_normal(2 * len(flow.cloud.interior))
    jacobian = flow.jacobian(u)
    assert abs(jacobian - jacobian.T).max() < 1e-12 * abs(jacobian).max()
    assert np.linalg.eigvalsh(jacobian.toarray()).min() > 0.0


@pytest.mark.parametrize("discretizer", FORMS, ids=label)
def test_the_residual_is_monotone_and_its_work_depends_on_the_ends_only(discretizer: Discretizer) -> None:
    """R(u + t w)·w grows with t (convex potential); ∮ R · du = 0 around a triangle (there is one)."""
    flow = flow_of(discretizer, CLOUDS["jittered"], PowerLaw(index=0.4, regularization=20.0))  # smooth, to integrate
    random = np.random.default_rng(1)
    a, b, c = random.standard_normal((3, 2 * len(flow.cloud.interior)))
    along = [flow.residual(a + t * b) @ b for t in np.linspace(-2.0, 2.0, 21)]
    assert (np.diff(along) > 0.0).all()
    places, weights = np.polynomial.legendre.leggauss(40)

    def work(start: Array, end: Array) -> float:
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        return float(sum(w * (flow.residual(middle + t * half) @ half) for t, w in zip(places, weights, strict=True)))

    parts = [work(a, b), work(b, c), work(c, a)]
    assert abs(sum(parts)) < 1e-6 * max(map(abs, parts))


def test_the_strong_form_and_convection_have_no_potential() -> None:
    cloud = CLOUDS["jittered"]
    walls = np.zeros((len(cloud.boundary), 2))
    strong, conservative = MovingLeastSquares(), MovingLeastSquares(form="conservative")
    assert not Flow(cloud, strong.operators(cloud, False), LAW, walls).is_gradient
    convection = Convection(1.0, conservative.gradient(cloud))
    assert not Flow(cloud, conservative.operators(cloud, False), LAW, walls, convection=convection).is_gradient


@pytest.mark.parametrize("discretizer", FORMS, ids=label)
def test_what_leaves_one_node_enters_its_neighbours(discretizer: Discretizer) -> None:
    """With no node held, Σ_i f_i = 0 and Σ_i x_i × f_i = 0 for any stress whatever: force and torque balance."""
    cloud = CLOUDS["rings"]
    operators = discretizer.operators(cloud, True)
    areas = np.outer([1.0, 1.0, 2.0], operators.strain.areas).ravel()
    stress = np.random.default_rng(2).standard_normal(len(areas))
    pressure = np.random.default_rng(3).standard_normal(len(operators.volumetric.points))
    force = operators.strain.rate.T @ (areas * stress) + operators.volumetric.rate.T @ (
        operators.volumetric.areas * pressure
    )
    f_x, f_y = force.reshape(-1, 2).T
    x, y = cloud.nodes.T
    assert abs(f_x.sum()) + abs(f_y.sum()) < 1e-10 * np.abs(force).sum()
    assert abs((x * f_y - y * f_x).sum()) < 1e-10 * np.abs(x * f_y).sum()
    inside = operators.strain.force @ stress + operators.volumetric.force @ pressure
    np.testing.assert_allclose(inside, -force[node_major(cloud.interior)], atol=1e-12 * np.abs(force).max())


def test_terms_beside_the_stress_weigh_the_areas_of_the_nodes() -> None:
    """Σ W over the inner nodes and the same body force: R of a conservative form is W times that of a strong one."""
    scene = Manufactured(spacing=0.1)
    cloud = scene.cloud(LAW)
    inside = cloud.nodes[cloud.interior]
    still, force = np.zeros((len(cloud.boundary), 2)), np.ones_like(inside)
    operators = LinearTriangles().operators(cloud, False)
    assert operators.node_areas is not None
    flow = Flow(cloud, operators, LAW, still, body_force=force)
    residual = flow.residual(np.zeros(2 * len(inside)))
    np.testing.assert_allclose(residual, -np.repeat(operators.node_areas, 2), rtol=1e-12)


# Clouds that carry no conservative form.


def test_a_node_outside_every_triangle_is_a_bad_cloud() -> None:
    """Two nodes nearer to each other than the triangulation can tell, far from the origin."""
    cloud = Channel(spacing=0.25).cloud(LAW)
    nodes = cloud.nodes + 1e5
    first, second = cloud.interior[:2]
    nodes[second] = nodes[first] + 1e-8
    with pytest.raises(SolveError, match="a node belongs to no triangle of the cloud") as ending:
        Triangles.of(cloud.moved_to(nodes))
    assert ending.value.status is Status.BAD_CLOUD


def test_a_node_that_no_point_feels_cannot_be_balanced() -> None:
    cloud = CLOUDS["grid"]
    triangles = Triangles.of(cloud)
    points, areas = triangles.diamonds()
    deaf = cloud.interior[40]
    others = np.delete(np.arange(len(cloud.nodes)), deaf)
    supports, both = MovingLeastSquares().weights(cloud.nodes[others], points, "strain", GRADIENT)
    gradient = Gradient(others[supports.index], both)
    with pytest.raises(SolveError, match="cannot be made conservative on this cloud: widen the supports") as ending:
        conserving(cloud, points, areas, gradient)
    assert ending.value.status is Status.BAD_CLOUD


def test_supports_that_leave_no_freedom_to_conserve_are_refused() -> None:
    """Three neighbours for a linear polynomial determine their gradient: only rounding could balance it."""
    discretizer = MovingLeastSquares(form="conservative", degree=1, support=3, balanced=False)
    with pytest.raises(SolveError, match=r"the supports of 3 neighbours .*widen discretizer.support") as refused:
        discretizer.operators(CLOUDS["rings"], False)
    assert refused.value.status is Status.ILL_CONDITIONED
