"""The balance of moments on discs of the flow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from cases import setup
from clouds import CLOUDS
from hypothesis import given, settings
from hypothesis import strategies as st
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve.flow.accuracy.moments import APART, NARROWEST, Discs, largest_moment
from nlsolve.flow.validity import LIMITS
from nlsolve.plugin import Cloud, ConstitutiveLaw, Operators, Physics
from nlsolve.series import Array
from nlsolve.solving.simulate import run_case

LIMIT = LIMITS["audit.moment"].largest
ROUNDING = 1e-12


@pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS)
def test_discs_hold_no_node_of_a_wall_and_no_centre_of_a_larger_one(cloud: Cloud) -> None:
    discs = Discs.within(cloud)
    assert len(discs.radii) >= 1
    assert (np.diff(discs.radii) <= 0.0).all()
    to_walls = np.linalg.norm(discs.centres[:, None] - cloud.nodes[cloud.boundary], axis=2).min(axis=1)
    assert (to_walls >= discs.radii).all()
    for number, (centre, radius) in enumerate(zip(discs.centres, discs.radii, strict=True)):
        assert (np.linalg.norm(discs.centres[number + 1 :] - centre, axis=1) > APART * radius).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(CLOUDS)), st.sampled_from([1e-9, 1.0, 1e9]))
def test_quadratic_stresses_balance_the_force_that_they_need(seed: int, cloud: str, unit: float) -> None:
    """S = c₀ + c₁ x + c₂ y + c₃ x² + c₄ x y + c₅ y² for each component, f = −div S."""
    c = np.random.default_rng(seed).standard_normal((3, 6))

    def stress(points: Array) -> Array:
        x, y = points.T
        return unit * c @ np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])

    def force(points: Array) -> Array:
        x, y = points.T
        along_x = c[:, 1, None] + 2.0 * c[:, 3, None] * x + c[:, 4, None] * y
        along_y = c[:, 2, None] + c[:, 4, None] * x + 2.0 * c[:, 5, None] * y
        return -unit * np.stack([along_x[0] + along_y[2], along_x[2] + along_y[1]], axis=1)

    assert largest_moment(CLOUDS[cloud], stress, force).value < ROUNDING
    assert largest_moment(CLOUDS[cloud], stress, lambda points: 1.5 * force(points)).value > 1e-4


def test_a_pressure_has_no_moment() -> None:
    def pressure(points: Array) -> Array:
        p = np.exp(points[:, 0]) * np.sin(3.0 * points[:, 1])
        return np.stack([p, p, np.zeros_like(p)])

    assert largest_moment(CLOUDS["jittered"], pressure, None).value < ROUNDING


def test_a_turning_force_is_measured() -> None:
    """S_xy = 1, f = ω (−y, x): M = 2π ω R⁴ ∫ φ s³ ds, N = 4π R² ∫_½¹ s² ds, s = r/R; the stress has no moment."""
    omega, cloud = 0.3, CLOUDS["rings"]
    discs = Discs.within(cloud)
    first = discs.radii[0]
    ratios = 2.0 * np.pi * omega * discs.radii**4 * (1 / 64 + 0.08125)
    sizes = 4.0 * np.pi * discs.radii**2 * (7 / 24)
    found = largest_moment(
        cloud,
        lambda points: np.outer([0.0, 0.0, 1.0], np.ones(len(points))),
        lambda points: omega * np.stack([-points[:, 1], points[:, 0]], axis=1),
    )
    assert found.value == pytest.approx((ratios / np.maximum(sizes, sizes.mean())).max(), rel=1e-12)
    assert f"on the disc of radius {first:.3g} mm around (" in found.sentence


def test_a_flow_at_rest_is_in_balance() -> None:
    assert largest_moment(CLOUDS["grid"], lambda points: np.zeros((3, len(points))), None).value == 0.0


def test_a_cloud_without_room_for_a_disc_has_no_value() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
    cloud = Cloud(nodes, {"wall": np.arange(4)})
    assert NARROWEST > 1.0
    assert np.isnan(largest_moment(cloud, lambda points: np.ones((3, len(points))), None).value)


class Unbalanced(LinearTriangles):
    """Triangles whose S takes the shear stress half as large again as it is."""

    def operators(self, cloud: Cloud, volumetric: bool) -> Operators:
        true = super().operators(cloud, volumetric)
        factors = np.repeat([1.0, 1.0, 1.5], len(true.strain.points))
        return replace(true, strain=replace(true.strain, force=true.strain.force @ sp.diags_array(factors)))


def test_a_discretizer_whose_forces_are_not_those_of_its_stresses_is_found() -> None:
    honest, lying = (
        run_case(setup(StirringTool(nodes=Rings(spacing=0.25)), index=1.0, discretizer=discretizer)).summary
        for discretizer in (LinearTriangles(), Unbalanced())
    )
    assert honest["velocity_error_inside"] < 0.005
    assert honest["audit.moment"] < 0.01
    assert honest["doubt"] == ""
    assert lying["velocity_error_inside"] > 0.1
    assert lying["audit.moment"] > LIMIT
    assert "check the discretizer" in lying["doubt"]


class Holed(StirringTool):
    """The tool's flow on a cloud in which a circle of 1 mm radius is empty."""

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        whole = super().cloud(law)
        keep = (np.linalg.norm(whole.nodes - [2.6, 0.0], axis=1) > 1.0) | whole.on_boundary
        number = np.cumsum(keep) - 1
        return Cloud(whole.nodes[keep], {name: number[group] for name, group in whole.boundaries.items()})


def test_a_hole_that_the_estimate_cannot_see_is_out_of_balance() -> None:
    """The orbit with a penalty, wrong by 0.76 inside: moving least squares leap over the hole, and so the triangles of
    the estimate do.
    """
    graded = GradedRings(first=0.05, growth=0.12, spacing=0.3)
    found = run_case(
        setup(
            Holed(nodes=graded, motion="orbit"),
            index=1.0,
            discretizer=MovingLeastSquares(),
            error_estimator=LinearTriangles(),
            physics=Physics(penalty=1e4),
        )
    ).summary
    assert found["velocity_error_estimate"] < 0.03
    assert found["audit.moment"] > LIMIT
    assert "the moments are out of balance by" in found["doubt"]
