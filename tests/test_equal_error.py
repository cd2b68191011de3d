"""The rival of `benchmarks/equal_error.py` is what it says: Taylor-Hood elements converge to the exact spin."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("skfem")

from equal_error import SADDLE, ours, parts, seconds_at, theirs
from taylor_hood import TaylorHood


def test_finite_elements_converge_to_the_exact_spin_with_their_order() -> None:
    """Degree 2: the error falls with the third power of the distance of the nodes."""
    coarse, fine = theirs("spin", 0.5, 1.4, False), theirs("spin", 0.5, 0.7, True)
    assert fine[1] < 1e-3
    assert np.log2(coarse[1] / fine[1]) > 2.5


def test_their_matrix_is_the_symmetric_tangent_of_their_forces() -> None:
    case = parts("finite elements", "spin", 0.5, 2.0, False)
    flow = TaylorHood(case.scene.cloud(case.law), SADDLE)
    rng = np.random.default_rng(0)
    values = rng.standard_normal(flow.size)
    inside = flow.unknowns
    direction = np.zeros(flow.size)
    direction[inside] = rng.standard_normal(len(inside))
    step = 1e-6
    change = (flow.forces(case.law, values + step * direction) - flow.forces(case.law, values - step * direction)) / (
        2 * step
    )
    matrix = flow.matrix(case.law, values)[: len(inside), : len(inside)]
    np.testing.assert_allclose(matrix @ direction[inside], change[inside], rtol=1e-6, atol=1e-6 * np.abs(change).max())
    assert abs(matrix - matrix.T).max() <= 1e-12 * abs(matrix).max()


def test_the_orbit_is_held_against_the_reference() -> None:
    """Finite elements of degree 2 come near it, and ours as much."""
    coarse, fine = theirs("orbit", 0.3, 2.0, False), theirs("orbit", 0.3, 1.0, False)
    assert fine[1] < min(0.005, coarse[1] / 4.0)
    assert ours("triangles", "orbit", 0.3, 1.0, False, False)[1] < 0.005


def test_seconds_are_interpolated_in_the_logarithms() -> None:
    costs = [(100, 1e-2, 1.0), (400, 1e-4, 100.0)]
    assert seconds_at(1e-3, costs) == pytest.approx(10.0)
    assert np.isnan(seconds_at(1e-5, costs))
