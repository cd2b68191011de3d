"""The spacing of nodes that follow a solution: second derivatives, their power, the number of nodes, and the slope."""

from __future__ import annotations

import numpy as np
import pytest
from nlsolve_laws import PowerLaw
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from scipy.spatial import Delaunay

from nlsolve.flow.accuracy.spacing import GROWTH, POWER, NodalSpacing, second_derivatives, wanted_spacing
from nlsolve.plugin import Cloud
from nlsolve.series import Array


def rings(spacing: float) -> Cloud:
    return StirringTool(nodes=Rings(spacing=spacing)).cloud(PowerLaw())


def cubic(nodes: Array) -> Array:
    """u = x³/6, v = 0: |∇∇V| = |x|."""
    return np.stack([nodes[:, 0] ** 3 / 6.0, 0.0 * nodes[:, 0]], axis=1)


def nodes_of(cloud: Cloud, spacing: NodalSpacing) -> float:
    """∫ 2/(√3 h²) dA over the annulus, by the points of a fine grid."""
    x = np.stack([axis.ravel() for axis in np.meshgrid(*[np.arange(-6.0, 6.0, 0.02) + 0.01] * 2)], axis=1)
    x = x[(np.hypot(*x.T) > 1.5) & (np.hypot(*x.T) < 6.0)]
    return float(2.0 / np.sqrt(3.0) * (0.02**2 / spacing(x) ** 2).sum())


def test_second_derivatives_of_a_parabola_are_exact() -> None:
    cloud = rings(0.5)
    x, y = cloud.nodes.T
    parabola = np.stack([1.0 + x - 2.0 * y + 3.0 * x**2 + x * y, 2.0 * y**2 - x], axis=1)
    np.testing.assert_allclose(second_derivatives(cloud, parabola), np.sqrt(36.0 + 2.0 + 16.0))


def test_the_spacing_is_a_power_of_the_second_derivatives_and_has_the_nodes_asked_for() -> None:
    cloud = rings(0.2)
    spacing = wanted_spacing(cloud, cubic(cloud.nodes), 5000, 2.0)
    assert nodes_of(cloud, spacing) == pytest.approx(5000, rel=0.03)
    points = np.array([[2.0, 3.0], [4.0, 2.0], [-4.0, -3.0], [-2.5, 2.0]])
    ratio = spacing(points) * np.abs(points[:, 0]) ** POWER
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=0.02)


def test_the_spacing_grows_slowly_away_from_its_least() -> None:
    """A bump of width 0.2 mm at (3, 0) is all that bends the field."""
    cloud = rings(0.1)
    bump = np.exp(-(((cloud.nodes - [3.0, 0.0]) / 0.2) ** 2).sum(axis=1))
    spacing = wanted_spacing(cloud, np.stack([bump, bump], axis=1), 2000, 0.6)
    corners = Delaunay(cloud.nodes).simplices
    i, j = corners[:, 0], corners[:, 1]
    slope = np.abs(spacing.values[i] - spacing.values[j]) / np.linalg.norm(cloud.nodes[i] - cloud.nodes[j], axis=1)
    assert slope[~cloud.on_boundary[corners].all(axis=1)].max() < GROWTH * (1.0 + 1e-9)
    assert spacing.values.max() == pytest.approx(0.6)
    assert np.linalg.norm(cloud.nodes[spacing.values.argmin()] - [3.0, 0.0]) < 0.3


def test_a_field_that_does_not_bend_takes_even_nodes_and_no_spacing_is_above_the_largest() -> None:
    cloud = rings(0.5)
    spacing = wanted_spacing(cloud, np.zeros_like(cloud.nodes), 10_000, 0.4)
    np.testing.assert_allclose(spacing.values, spacing.values[0])
    assert nodes_of(cloud, spacing) == pytest.approx(10_000, rel=0.01)
    few = wanted_spacing(cloud, cubic(cloud.nodes), 10, 0.4)
    np.testing.assert_allclose(few.values, 0.4)


def test_beyond_the_nodes_the_nearest_spacing_holds() -> None:
    spacing = NodalSpacing(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(spacing(np.array([[0.25, 0.25], [2.0, 0.1], [-1.0, 3.0]])), [0.175, 0.2, 0.3])
