"""Triangles of degree 2: their functions, their nodes on walls, projections on pressures, and third order."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import CLOUDS, power
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_discretizers import LinearTriangles, QuadraticTriangles
from nlsolve_discretizers.elements import functions
from nlsolve_discretizers.elements.mesh import Mesh, _without_single_ones
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from orders import NODES, errors, orders

from nlsolve import SolveError, Status, Study
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Cloud
from nlsolve.solving.simulate import run_case
from nlsolve.testing import check_discretizer

LAW = PowerLaw(index=0.4, regularization=1e-2)
QUADRATICS = [(i, j) for i in range(3) for j in range(3 - i)]


def mesh(name: str) -> Mesh:
    return QuadraticTriangles().completed(CLOUDS[name])


# Functions and quadrature.


def test_each_function_is_one_at_its_own_node() -> None:
    assert np.allclose(functions.values(functions.NODES), np.eye(6), atol=1e-15)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_functions_add_up_to_one_and_slopes_are_their_derivatives(one: float, other: float) -> None:
    at = np.array([[1.0 - one - other, one, other]])
    assert functions.values(at).sum() == pytest.approx(1.0)
    step = 1e-6
    for axis, turn in enumerate(([-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0])):
        ahead, behind = (functions.values(at + sign * step * np.array(turn)) for sign in (1.0, -1.0))
        assert np.allclose(functions.slopes(at)[..., axis], (ahead - behind) / (2.0 * step), atol=1e-8)


@pytest.mark.parametrize(
    ("exponents", "integral"), [((0, 0), 0.5), ((1, 0), 1 / 6), ((2, 0), 1 / 12), ((1, 1), 1 / 24)]
)
def test_the_rule_is_exact_for_quadratics(exponents: tuple[int, int], integral: float) -> None:
    x = functions.POINTS[:, 1:]
    assert power(x, exponents, (0, 0)).mean() / 2.0 == pytest.approx(integral)


# Nodes.


@pytest.mark.parametrize("name", CLOUDS)
def test_discretizer_conforms(name: str) -> None:
    check_discretizer(QuadraticTriangles(), CLOUDS[name])


@pytest.mark.parametrize("name", CLOUDS)
def test_every_edge_has_one_middle_and_every_outer_one_is_on_a_wall(name: str) -> None:
    cloud, full = CLOUDS[name], mesh(name)
    corners = len(cloud.nodes)
    sides = np.unique(np.sort(full.elements[:, functions.EDGES].reshape(-1, 2), axis=1), axis=0)
    assert len(full.nodes) == corners + len(sides)
    assert (np.unique(full.elements) == np.arange(len(full.nodes))).all()
    times = np.bincount(full.elements[:, 3:].ravel(), minlength=len(full.nodes))[corners:]
    assert set(times) == {1, 2}
    assert (full.on_boundary[corners:] == (times == 1)).all()


def test_middles_on_a_circle_lie_on_it() -> None:
    """To the fourth power of their distance."""
    off = []
    for spacing in (0.5, 0.25):
        full = Mesh.of(StirringTool(nodes=Rings(spacing=spacing)).cloud(LAW))
        radius = np.hypot(*full.nodes[full.boundaries["tool"]].T)
        off.append(np.ptp(radius))
    assert off[1] < off[0] / 12.0


def test_a_middle_beside_a_corner_is_on_the_wall_without_the_corner() -> None:
    cloud = Channel(spacing=0.2).cloud(LAW)
    full = Mesh.of(cloud)
    inlet = full.nodes[full.boundaries["inlet"]]
    assert (inlet[:, 0] == 0.0).all()
    assert len(inlet) == 2 * len(cloud.boundaries["inlet"]) + 1
    assert (np.abs(full.nodes[full.boundaries["bottom"]][:, 1] + 1.0) < 1e-14).all()


def test_no_triangle_is_alone_in_its_patch() -> None:
    for name in CLOUDS:
        assert np.bincount(mesh(name).patch).min() >= 2


def test_a_triangle_that_is_alone_joins_its_first_neighbour() -> None:
    patch = _without_single_ones(np.array([0, 0, 1, 2, 2]), np.array([[2, 3], [1, 2], [0, 1], [3, 4]]))
    assert patch.tolist() == [0, 0, 0, 1, 1]


def test_a_triangle_turned_inside_out_is_told_with_its_place() -> None:
    full = mesh("grid")
    nodes = full.nodes.copy()
    nodes[full.elements[0, 3]] = nodes[full.elements[0, 2]] + 1e-3  # a middle carried beyond the opposite corner
    with pytest.raises(SolveError, match=r"turned inside out at \(.*linear triangles") as refusal:
        QuadraticTriangles().operators(full.moved_to(nodes), True)
    assert refusal.value.status is Status.BAD_CLOUD


def test_nodes_of_no_triangles_are_refused() -> None:
    with pytest.raises(SolveError, match="`completed` of the discretizer"):
        QuadraticTriangles().operators(CLOUDS["grid"], False)


def test_kept_nodes_carry_their_triangles_along() -> None:
    full = mesh("jittered")
    turned = full.moved_to(full.nodes @ np.array([[0.0, 1.0], [-1.0, 0.0]]))
    one, other = (QuadraticTriangles().operators(each, True) for each in (full, turned))
    assert np.allclose(one.node_areas, other.node_areas, rtol=1e-12)


# Operators.


@pytest.mark.parametrize("name", ["grid", "jittered", "scattered"])
@pytest.mark.parametrize("exponents", QUADRATICS)
def test_quadratic_velocities_have_their_strain_rates(name: str, exponents: tuple[int, int]) -> None:
    """Exact at every point where the walls are straight, and div v, which is linear, at every place of pressures."""
    full = mesh(name)
    operators = QuadraticTriangles().operators(full, True)
    assert operators.volumetric is not None
    velocity = np.stack([power(full.nodes, exponents, (0, 0)), 2.0 * power(full.nodes, exponents, (0, 0))], axis=1)
    dx, dy = (power(operators.strain.points, exponents, d) for d in ((1, 0), (0, 1)))
    assert np.allclose(operators.strain_rate(velocity), [dx, 2.0 * dy, 0.5 * dy + dx], atol=1e-11)
    dx, dy = (power(operators.volumetric.points, exponents, d) for d in ((1, 0), (0, 1)))
    assert np.allclose(operators.volumetric.rate @ velocity.ravel(), dx + 2.0 * dy, atol=1e-10)


@pytest.mark.parametrize("name", ["grid", "jittered", "scattered"])
@pytest.mark.parametrize("exponents", QUADRATICS)
def test_node_areas_and_gradients_are_exact_for_quadratics(name: str, exponents: tuple[int, int]) -> None:
    full = mesh(name)
    for axis, derivative in enumerate(QuadraticTriangles().gradient(full)):
        exact = power(full.nodes, exponents, (1, 0) if axis == 0 else (0, 1))
        assert np.allclose(derivative @ power(full.nodes, exponents, (0, 0)), exact, atol=1e-10)
    strain = QuadraticTriangles().operators(full, False).strain
    assert strain.areas is not None
    (a, b), high = exponents, full.nodes.max(axis=0)
    low = full.nodes.min(axis=0)
    side = (high ** np.array([a + 1, b + 1]) - low ** np.array([a + 1, b + 1])) / [a + 1, b + 1]
    assert strain.areas @ power(strain.points, exponents, (0, 0)) == pytest.approx(side[0] * side[1], abs=1e-12)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_the_tangent_is_symmetric_and_the_potentials_derivative(seed: int) -> None:
    full = mesh("jittered")
    flow = Flow(full, QuadraticTriangles().operators(full, True), LAW, np.zeros((len(full.boundary), 2)), 1e3)
    u = np.random.default_rng(seed).normal(size=2 * len(full.interior))
    tangent = flow.jacobian(u).toarray()
    assert np.abs(tangent - tangent.T).max() <= 1e-12 * np.abs(tangent).max()
    direction = np.random.default_rng(seed + 1).normal(size=len(u))
    step = 1e-6
    change = (flow.residual(u + step * direction) - flow.residual(u - step * direction)) / (2.0 * step)
    assert np.allclose(tangent @ direction, change, rtol=1e-5, atol=1e-6 * np.abs(change).max())


def test_linear_triangles_of_the_same_nodes_precondition_it() -> None:
    """The corners have no weight of their own in other terms: their rows are taken as they are."""
    full = mesh("jittered")
    flow = Flow(full, QuadraticTriangles().operators(full, True), LAW, np.zeros((len(full.boundary), 2)), 1e2)
    u = np.random.default_rng(0).normal(size=2 * len(full.interior))
    by_linear = flow.jacobian_by(LinearTriangles(), u)
    ratio = by_linear.diagonal() / flow.jacobian(u).diagonal()
    assert ((ratio > 0.02) & (ratio < 50.0)).all()


# Flows.


@pytest.mark.parametrize("nodes", NODES)
def test_errors_fall_with_the_third_power(nodes: str) -> None:
    (order,) = orders(*errors(QuadraticTriangles(), NODES[nodes], 0.5, (0.2, 0.1)))
    assert order >= 2.7


def summary(scene: dict[str, object], kind: str, index: float, penalty: float, **more: object) -> dict[str, object]:
    case = Study.from_dict(
        {
            "question": "?",
            "scene": scene,
            "law": {"kind": "power-law", "index": index, "regularization": 1e-3},
            "physics": {"penalty": penalty},
            "discretizer": {"kind": kind},
            "solver": {"kind": "newton"},
            "stop": {"tolerance": 1e-9},
            **more,
        }
    ).cases[0]
    return dict(run_case(case.parts).summary)


@pytest.mark.parametrize("penalty", [1e2, 1e5, 1e8])
def test_poiseuille_flow_is_exact_and_no_penalty_locks(penalty: float) -> None:
    row = summary({"kind": "channel", "spacing": 0.25}, "triangles", 1.0, penalty)
    assert row["velocity_error_inside"] < 1e-7


def test_the_spin_needs_a_fraction_of_the_nodes_and_its_error_is_estimated() -> None:
    nodes = {"kind": "auto", "resolution": 1.5, "layers": 1.0, "growth": 0.75, "spacing": 1.5, "middle": 1.5}
    row = summary({"kind": "stirring-tool", "nodes": nodes}, "triangles", 0.3, 1e4)
    linear = summary({"kind": "stirring-tool", "nodes": {"kind": "auto"}}, "delaunay", 0.3, 1e4)
    assert row["nodes"] < 0.3 * linear["nodes"]
    assert row["velocity_error_inside"] < 0.01
    assert 0.8 < row["velocity_error_inside"] / row["velocity_error_estimate"] < 1.25


def test_adaptive_nodes_count_those_between() -> None:
    nodes = {"kind": "adaptive", "error": 0.01, "spacing": 1.0}
    row = summary({"kind": "stirring-tool", "nodes": nodes}, "triangles", 0.5, 1e4)
    assert row["status"] == "converged"
    assert row["velocity_error_inside"] < 0.01


def test_a_march_with_kept_nodes_and_inertia_goes_to_the_steady_flow() -> None:
    """Inertia has no weight at corners."""
    scene = {"kind": "channel", "spacing": 0.25}
    march = summary(
        scene,
        "triangles",
        1.0,
        1e4,
        time={"horizon": 3e-3, "increment": 1e-3},
        physics={"inertia": True, "penalty": 1e4},
        motion={"nodes": "fixed"},
    )
    assert march["status"] == "converged"
    assert march["velocity_error_inside"] < 1e-6


def test_its_doubts_and_failures_are_told_for_a_line_of_nodes() -> None:
    line = np.stack([np.arange(4.0), np.zeros(4)], axis=1)
    with pytest.raises(SolveError, match="lie on one line"):
        QuadraticTriangles().completed(Cloud(line, {"ends": np.array([0, 3])}))
