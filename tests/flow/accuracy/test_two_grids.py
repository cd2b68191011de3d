"""Cycles of two grids: they solve with the tangent of linear triangles as well at any spacing, or give way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy
from cases import PLAIN, setup
from clouds import CLOUDS
from nlsolve_discretizers import LinearTriangles, QuadraticTriangles
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, Manufactured, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings

from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.flow.accuracy import estimate
from nlsolve.flow.accuracy.enrichment import Finer, completed, twice_as_fine
from nlsolve.flow.accuracy.kept_factors import KeptFactors
from nlsolve.flow.accuracy.two_grids import LARGEST, Coarser, TwoGrids
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Cloud, Discretizer, Physics, SolveError, Status
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case

TRIANGLES, QUADRATIC = LinearTriangles(), QuadraticTriangles()


def shear(cloud: Cloud) -> Array:
    """A smooth velocity (N, 2) whose strain rate is nowhere zero."""
    x, y = cloud.nodes.T
    return np.stack([y + 0.02 * y**2, 0.2 * x], axis=1)


def tangent_on(cloud: Cloud, index: float, discretizer: Discretizer) -> Any:
    law = PowerLaw(index=index, regularization=1e-3)
    flow = Flow(cloud, discretizer.operators(cloud, False), law, shear(cloud)[cloud.boundary])
    return flow.jacobian(flow.unknowns(shear(cloud)))


def both(cloud: Cloud, index: float, degree: int = 1) -> tuple[Any, Any, Finer]:
    """A on twice as fine triangles or on triangles of degree 2, A_c, and the finer cloud."""
    finer = twice_as_fine(cloud) if degree == 1 else completed(QUADRATIC.completed(cloud), cloud)
    tangent = tangent_on(finer.cloud, index, TRIANGLES if degree == 1 else QUADRATIC)
    return tangent, tangent_on(cloud, index, TRIANGLES), finer


def two_grids(cloud: Cloud, index: float, degree: int = 1) -> tuple[Any, TwoGrids]:
    tangent, below, finer = both(cloud, index, degree)
    return tangent, TwoGrids(tangent, Coarser(PLAIN.factorize(below), finer.interpolation))


def rings(scale: float) -> Cloud:
    nodes = GradedRings(first=0.1 * scale, growth=0.12 * scale, spacing=0.25 * scale)
    return StirringTool(nodes=nodes).cloud(PowerLaw())


def contraction(cloud: Cloud, index: float, degree: int) -> float:
    """‖I − B A‖ in the norm of A, B one cycle, by the power method."""
    tangent, cycle = two_grids(cloud, index, degree)
    error = np.random.default_rng(1).standard_normal(tangent.shape[0])
    for _ in range(25):
        before = error / np.sqrt(error @ tangent @ error)
        error = before - cycle.solve(tangent @ before)
    return float(np.sqrt(error @ tangent @ error))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(("index", "most"), [(1.0, 0.45), (0.3, 0.7), (0.1, 0.85)])
def test_a_cycle_leaves_a_part_of_the_error_that_does_not_depend_on_the_spacing(
    index: float, most: float, degree: int
) -> None:
    wide, close = (contraction(rings(scale), index, degree) for scale in (2.0, 1.0))
    assert max(wide, close) < most
    assert close == pytest.approx(wide, rel=0.05)


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_a_cycle_is_symmetric_and_definite(cloud: Cloud) -> None:
    tangent, cycle = two_grids(cloud, 0.3)
    a, b = np.random.default_rng(2).standard_normal((2, tangent.shape[0]))
    assert a @ cycle.solve(b) == pytest.approx(b @ cycle.solve(a), rel=1e-10)
    assert a @ cycle.solve(a) > 0.0


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("index", [1.0, 0.05])
@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_no_eigenvalue_of_the_sweeps_is_above_the_largest(cloud: Cloud, index: float, degree: int) -> None:
    tangent, cycle = two_grids(cloud, index, degree)
    ones = scipy.sparse.linalg.LinearOperator(tangent.shape, matvec=lambda v: cycle._inverses @ (tangent @ v))
    largest = scipy.sparse.linalg.eigs(ones, 1, which="LR", return_eigenvectors=False, rng=3)[0].real
    assert 1.0 < largest <= LARGEST


def test_away_from_walls_the_coarser_tangent_is_that_of_the_finer_one_interpolated() -> None:
    """Of a Newtonian law, whose moduli do not change within a triangle."""
    cloud = Channel(spacing=0.2, jitter=0.2).cloud(PowerLaw())
    tangent, below, finer = both(cloud, 1.0)
    carry = finer.interpolation
    off = abs(carry.T @ tangent @ carry - below).max(axis=1).toarray()[0::2]
    far = scipy.spatial.cKDTree(cloud.nodes[cloud.boundary]).query(cloud.nodes[cloud.interior])[0] > 0.45
    assert 10 < far.sum() < 0.6 * len(far)
    assert off[far].max() < 1e-12 * abs(below).max()


def test_interpolation_carries_the_unknowns_as_the_cloud_carries_velocities() -> None:
    cloud = rings(2.0)
    finer = twice_as_fine(cloud)
    values = np.where(cloud.on_boundary[:, None], 0.0, cloud.nodes)
    carried = finer.interpolation @ values[cloud.interior].ravel()
    assert carried == pytest.approx(finer.carry(values)[finer.cloud.interior].ravel(), rel=1e-15)


GRADED = GradedRings(first=0.1, growth=0.15, spacing=0.4)
SCENES: dict[str, Geometry] = {
    "spin": StirringTool(nodes=GRADED),
    "orbit": StirringTool(motion="orbit", nodes=GRADED),
    "manufactured": Manufactured(spacing=0.05),
}


@pytest.mark.parametrize("discretizer", [TRIANGLES, QUADRATIC], ids=["linear", "quadratic"])
@pytest.mark.parametrize("index", [0.5, 0.1324, 0.03])
@pytest.mark.parametrize("kind", SCENES)
def test_the_estimate_is_that_of_a_factorised_tangent(
    kind: str, index: float, discretizer: Discretizer, monkeypatch: Any
) -> None:
    case = setup(SCENES[kind], index, discretizer=discretizer, error_estimator=discretizer)
    by_cycles = run_case(case).summary
    monkeypatch.setattr(estimate._Enriched, "takes_cycles", False)
    by_factors = run_case(case).summary
    for name in ("velocity_error_estimate", "worst_error_estimate"):
        assert by_cycles[name] == pytest.approx(by_factors[name], rel=0.03)


@pytest.mark.parametrize(("penalty", "factorized"), [(0.0, 1), (100.0, 2)])
def test_a_finer_tangent_is_factorised_only_beside_a_penalty(penalty: float, factorized: int, monkeypatch: Any) -> None:
    found: list[estimate.Comparison] = []
    compared = estimate.compared

    def kept(*args: Any) -> estimate.Comparison:
        found.append(compared(*args))
        return found[-1]

    monkeypatch.setattr("nlsolve.flow.march.compared", kept)
    physics = Physics(penalty=penalty)
    run_case(setup(SCENES["spin"], 0.5, discretizer=TRIANGLES, error_estimator=TRIANGLES, physics=physics))
    assert [one.factorizations for one in found] == [factorized]


def test_a_tangent_that_cycles_do_not_solve_is_factorised() -> None:
    tangent, below, finer = both(rings(2.0), 0.3)
    useless = Coarser(PLAIN.factorize(-1e-6 * below), finer.interpolation)
    kept = KeptFactors(linear=PLAIN, coarser=useless)
    first = kept.factorize(tangent)
    rhs = np.cos(np.arange(tangent.shape[0]))
    assert isinstance(first.factors, TwoGrids)
    assert np.linalg.norm(rhs - tangent @ first.solve(rhs)) < 1e-10 * np.linalg.norm(rhs)
    assert not isinstance(first.factors, TwoGrids)
    assert kept.factorize(tangent, first).factors is first.factors


def test_a_node_without_forces_is_refused_as_its_linear_solver_does() -> None:
    tangent, below, finer = both(rings(2.0), 0.3)
    keep = scipy.sparse.diags_array(np.where(np.arange(tangent.shape[0]) < 2, 0.0, 1.0))
    coarser = Coarser(PLAIN.factorize(below), finer.interpolation)
    with pytest.raises(SolveError) as caught:
        KeptFactors(linear=PLAIN, coarser=coarser).factorize(keep @ tangent @ keep).solve(
            np.eye(1, tangent.shape[0])[0]
        )
    assert caught.value.status is Status.SINGULAR_TANGENT
