"""Accuracy against exact solutions: what the discretisation is for. Relative ℓ² errors of the nodal velocities."""

from __future__ import annotations

from typing import Any

import accuracy
import numpy as np
import pytest
from cases import setup
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve.plugin import FlowScene, Physics
from nlsolve.solving.simulate import run_case as march


def solved(scene: FlowScene, index: float, **parts: Any) -> dict[str, Any]:
    law = PowerLaw(index=index, regularization=1e-3)
    row = march(setup(scene, law=law, linear=SuperLU(), **parts)).summary
    assert row["status"] == "converged", row["message"]
    return row


class TestSteadySpinOnThePapersNodes:
    """1780 nodes, spacing 0.25 mm, where u_θ falls by e in 0.1 mm at n = 0.1324."""

    nodes = Rings()
    velocity = {1.0: 0.01, 0.5: 0.015, 0.1324: 0.03}  # noqa: RUF012

    @pytest.mark.parametrize("index", velocity)
    def test_velocity(self, index: float) -> None:
        row = solved(StirringTool(nodes=self.nodes), index)
        assert row["nodes"] == 1780
        assert row["velocity_error"] <= self.velocity[index]


class TestSteadySpinOnGradedNodes:
    """At most 4500 nodes, 0.03 mm at the tool: below 0.6 % at n = 0.1324."""

    nodes = GradedRings(first=0.03, growth=0.13, spacing=0.4)
    bound = 0.006

    def test_velocity(self) -> None:
        row = solved(StirringTool(nodes=self.nodes), 0.1324)
        assert row["nodes"] <= 4500
        assert row["velocity_error"] <= self.bound


class TestSteadySpinOnNodesGradedToItsLayer:
    """Velocity within 0.1 % at n = 0.1324 and 0.5 % at n = 0.05 on less than 6000 nodes."""

    @pytest.mark.parametrize(
        ("discretizer", "index", "bound"),
        [
            ("delaunay", 0.1324, 1e-3),
            ("delaunay", 0.05, 5e-3),
            pytest.param("mls", 0.1324, 1e-3, marks=pytest.mark.slow),
            pytest.param("mls", 0.05, 5e-3, marks=pytest.mark.slow),
        ],
    )
    def test_velocity(self, discretizer: str, index: float, bound: float) -> None:
        run = accuracy.spin(discretizer, index)
        assert run["nodes"] <= 6000
        assert run["velocity_error"] <= bound
        assert run["doubt"] == ""


class TestEveryLaw:
    """Defaults of every law on nodes graded to its layer: velocity and torque within 0.5 %."""

    bound = 0.005
    nodes = {"delaunay": 5000, "mls": 9000}  # noqa: RUF012

    @pytest.mark.parametrize(
        ("discretizer", "law"),
        [
            pytest.param(kind, law, marks=pytest.mark.slow if kind == "mls" else ())
            for kind in accuracy.GRADED
            for law in accuracy.LAWS
        ],
    )
    def test_spin(self, discretizer: str, law: str) -> None:
        run = accuracy.couette(discretizer, law)
        assert run["nodes"] <= self.nodes[discretizer]
        assert run["velocity_error"] <= self.bound
        assert run["torque_error"] <= self.bound

    @pytest.mark.parametrize("index", [1.0, 0.5, 0.3, 0.1324])
    def test_channel(self, index: float) -> None:
        assert accuracy.channel("delaunay", index, jitter=0.2)["velocity_error"] <= self.bound


class TestBearing:
    """Torque and force within 0.2 % of Jeffery's closed form."""

    bound = 2e-3

    @pytest.mark.parametrize(
        ("name", "nodes"),
        [
            ("mls, conservative", 4000),
            pytest.param("mls", 6000, marks=pytest.mark.slow),
            pytest.param("delaunay", 12000, marks=pytest.mark.slow),
        ],
    )
    def test_torque_and_force(self, name: str, nodes: int) -> None:
        run = accuracy.bearing(name, accuracy.FEW[name])
        assert run["nodes"] <= nodes
        assert run["divergence"] <= 1e-8
        assert run["torque_error"] <= self.bound
        assert run["force_error"] <= self.bound


class TestOrbitAgainstIndependentFiniteElements:
    """λ/μ = 1e4, at most 6500 nodes: velocity within 0.5 % of the tool speed off the walls, drag within 0.5 %."""

    bound = 0.005

    @pytest.mark.parametrize("index", [1.0, pytest.param(0.3, marks=pytest.mark.slow)])
    def test_velocity_and_drag(self, index: float) -> None:
        comparison = accuracy.orbit_against_reference(index)
        assert comparison.nodes <= 6500
        assert comparison.velocity.max() <= self.bound
        assert abs(comparison.drag / accuracy.DRAG[index] - 1.0) <= self.bound


class TestOrderOfConvergence:
    """Quadratic polynomials, stress points between nodes, similar clouds: second order at n = 1."""

    least = 1.8

    def errors(self, index: float, sizes: tuple[float, ...]) -> np.ndarray:
        family = [GradedRings(first=0.1 * s, growth=0.12 * s, spacing=0.25 * s) for s in sizes]
        return np.array([solved(StirringTool(nodes=nodes), index)["velocity_error"] for nodes in family])

    def rate(self, index: float, sizes: tuple[float, ...]) -> float:
        return float(np.polyfit(np.log(sizes), np.log(self.errors(index, sizes)), 1)[0])

    def test_newtonian(self) -> None:
        assert self.rate(1.0, (1.4, 0.7)) >= self.least

    @pytest.mark.slow
    def test_newtonian_down_to_half(self) -> None:
        assert self.rate(1.0, (1.4, 0.7, 0.5)) >= self.least

    def test_power_law_errors_fall_at_least_linearly(self) -> None:
        assert self.rate(0.3, (1.4, 0.7)) >= 1.0


class TestChannel:
    """Power-law Poiseuille flow on jittered nodes; the kink of the profile at the axis grows sharper as n falls."""

    @pytest.mark.parametrize("index", [0.5, 0.3])
    def test_error_falls_with_the_spacing(self, index: float) -> None:
        spacings = (0.2, 0.1, 0.05)
        errors = [solved(Channel(spacing=h, jitter=0.2), index)["velocity_error"] for h in spacings]
        assert errors[0] > errors[1] > errors[2]
        assert errors[2] < 1e-3

    def test_newtonian_profile_is_a_parabola_and_exact(self) -> None:
        assert solved(Channel(spacing=0.2, jitter=0.2), 1.0)["velocity_error"] < 1e-12


class TestPenalty:
    """Volume points apart from strain points: λ/μ from 1 to 1e4 moves the error by less than a tenth of itself."""

    nodes = GradedRings(first=0.05, growth=0.15)
    part = 0.1

    @pytest.mark.parametrize("index", [0.5, 0.1324])
    def test_the_penalty_does_not_lock(self, index: float) -> None:
        errors = [
            solved(StirringTool(nodes=self.nodes), index, physics=Physics(penalty=penalty))["velocity_error"]
            for penalty in (1.0, 1e4)
        ]
        assert abs(errors[1] - errors[0]) < self.part * errors[0]

    @pytest.mark.slow
    @pytest.mark.parametrize("index", [0.5, 0.1324])
    def test_nor_anywhere_between(self, index: float) -> None:
        errors = [
            solved(StirringTool(nodes=self.nodes), index, physics=Physics(penalty=penalty))["velocity_error"]
            for penalty in (1.0, 10.0, 100.0, 1e3, 1e4)
        ]
        assert max(errors) - min(errors) < self.part * errors[0]


def test_the_composed_form_is_worse_by_far() -> None:
    """Nodal stress, then its divergence: the 2015 paper's form, for contrast."""
    scene = StirringTool()
    composed = solved(scene, 1.0, discretizer=MovingLeastSquares(points="nodes"))["velocity_error"]
    assert composed > 10.0 * solved(scene, 1.0)["velocity_error"]
