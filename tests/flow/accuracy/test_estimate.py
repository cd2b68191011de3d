"""The estimate of the error beside the error: smooth fields, layers, compressed flows, marches, and its failures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
from cases import FlowCase, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_laws import PowerLaw
from nlsolve_scenes import EccentricCylinders, Manufactured, StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings

from nlsolve.contracts.scene import Simulation
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.continuation import Start
from nlsolve.plugin import Cloud, ConstitutiveLaw, Discretizer, FlowScene, NodeMotion, Physics, TimeSteps
from nlsolve.solving.simulate import run_case

REFERENCE = Path(__file__).parents[2] / "reference"
TRIANGLES = LinearTriangles()
GRADED = GradedRings(first=0.08, growth=0.18, spacing=0.45)
MARCHED = {
    "physics": Physics(inertia=True),
    "time": TimeSteps(horizon=2e-4, increment=1e-4),
    "motion": NodeMotion(nodes="lagrangian"),
}


def measured(parts: FlowCase) -> tuple[float, float, str]:
    """The error inside, its estimate, and the doubt."""
    row = run_case(parts).summary
    assert row["status"] == "converged", row["message"]
    return row["velocity_error_inside"], row["velocity_error_estimate"], row["doubt"]


def spin(nodes: Any = GRADED) -> StirringTool:
    return StirringTool(nodes=nodes)


@pytest.mark.parametrize(
    ("scene", "index", "discretizer", "sections"),
    [
        (spin(), 0.3, MovingLeastSquares(), {}),
        (spin(), 0.1324, MovingLeastSquares(support=15, force_support=18), {}),
        (spin(), 0.1324, MovingLeastSquares(degree=1), {}),
        (spin(), 0.1324, RadialBasis(form="strong"), {}),
        (spin(), 0.1324, TRIANGLES, {}),
        (spin(Rings(spacing=0.75)), 1.0, MovingLeastSquares(points="nodes"), {}),
        (spin(), 0.3, MovingLeastSquares(), {"physics": Physics(penalty=1e4)}),
        (
            spin(),
            0.3,
            MovingLeastSquares(form="conservative"),
            {"physics": Physics(penalty=1e2, divergence_tolerance=1e-6)},
        ),
        (spin(), 0.3, MovingLeastSquares(), MARCHED),
        (EccentricCylinders(), 1.0, MovingLeastSquares(points="nodes"), {"physics": Physics(penalty=1e4)}),
        (Manufactured(spacing=0.05), 0.5, MovingLeastSquares(), {}),
        (Manufactured(spacing=0.05), 0.5, TRIANGLES, {}),
    ],
)
def test_the_estimate_is_the_error_within_a_factor_of_two(
    scene: FlowScene, index: float, discretizer: Discretizer, sections: dict[str, Any]
) -> None:
    error, estimate, _ = measured(setup(scene, index, discretizer=discretizer, error_estimator=TRIANGLES, **sections))
    assert error / 2.0 < estimate < 2.0 * error


@pytest.mark.parametrize("penalty", [30.0, 100.0])
def test_the_error_of_the_penalty_is_part_of_the_estimate(penalty: float) -> None:
    """The orbit by triangles that are fine enough for a far smaller error; finite elements of others are the truth."""
    known = pd.read_csv(REFERENCE / "orbit_n1.0.csv").query("where == 'lattice'")
    places, velocity = known[["x", "y"]].to_numpy(), known[["u", "v"]].to_numpy()
    inside = np.abs(np.hypot(*places.T) - 3.75) < 2.24
    seen: list[Simulation] = []
    scene = StirringTool(motion="orbit", nodes=Rings(spacing=0.3))
    parts = setup(
        scene,
        1.0,
        law=PowerLaw(index=1.0, regularization=1e-3),
        discretizer=TRIANGLES,
        error_estimator=TRIANGLES,
        physics=Physics(penalty=penalty),
    )
    row = run_case(parts, watch=seen.append).summary
    found = TRIANGLES.values(seen[-1].state.cloud.nodes, places[inside]) @ seen[-1].state.velocity  # type: ignore[attr-defined]
    error = np.linalg.norm(found - velocity[inside]) / np.linalg.norm(velocity[inside])
    assert error > 0.05
    assert row["velocity_error_estimate"] == pytest.approx(error, rel=0.3)
    assert "a solution with more nodes" in row["doubt"]


class Holed(StirringTool):
    """The nodes of a circle at (2.6, 0) mm are missing."""

    kind: Literal["holed"] = "holed"  # type: ignore[assignment]
    hole: float = 0.8

    def cloud(self, law: ConstitutiveLaw) -> Cloud:
        whole = super().cloud(law)
        kept = (np.linalg.norm(whole.nodes - np.array([2.6, 0.0]), axis=1) > self.hole) | whole.on_boundary
        new = np.cumsum(kept) - 1
        return Cloud(whole.nodes[kept], {name: new[group] for name, group in whole.boundaries.items()})


@pytest.mark.parametrize(("discretizer", "hole"), [(MovingLeastSquares(), 0.5), (TRIANGLES, 0.8), (TRIANGLES, 1.0)])
def test_a_region_without_nodes_is_seen(discretizer: Discretizer, hole: float) -> None:
    """Two discretisations of the same nodes would miss the same ones."""
    scene = Holed(nodes=Rings(spacing=0.25), hole=hole)
    error, estimate, doubt = measured(setup(scene, 0.3, discretizer=discretizer, error_estimator=TRIANGLES))
    assert 0.6 * error < estimate < 1.8 * error
    assert ("a solution with more nodes" in doubt) == (error > 0.035)


def test_a_wrong_field_without_another_blemish_is_in_doubt_by_the_estimate() -> None:
    wrong = setup(spin(), 0.1324, discretizer=MovingLeastSquares(degree=1))
    error, estimate, doubt = measured(wrong)
    assert error > 0.05
    assert np.isnan(estimate)
    assert doubt == ""
    assert "a solution with more nodes" in measured(replace(wrong, error_estimator=TRIANGLES))[2]


def test_an_estimate_that_cannot_be_made_says_so_beside_the_audits() -> None:
    class Fails(LinearTriangles):
        def operators(self, cloud: Cloud, volumetric: bool) -> Any:
            raise SolveError(Status.BAD_CLOUD, "the triangles are inside out")

    row = run_case(setup(spin(Rings(spacing=0.75)), 1.0, error_estimator=Fails())).summary
    assert row["status"] == "converged"
    assert "the error could not be estimated: the triangles are inside out" in row["doubt"]
    assert row["audit.resolution"] > 0.0


def test_a_flow_that_newton_does_not_solve_with_more_nodes_is_in_doubt() -> None:
    class Idle(type(Start().solver)):  # type: ignore[misc]
        def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
            step = next(super().steps(problem, tangent, start))
            while True:
                yield step

    parts = setup(spin(Rings(spacing=0.75)), 1.0, error_estimator=TRIANGLES, start=Start(values=()))
    idle = replace(parts, start=parts.start.model_copy(update={"solver": Idle()}))
    row = run_case(idle).summary
    assert np.isnan(row["velocity_error_estimate"])
    assert "the error could not be estimated: Newton does not solve the flow in 20 steps" in row["doubt"]


@pytest.mark.parametrize("kind", ["mls", "rbf", "delaunay", "a stranger's"])
def test_every_discretizer_has_an_estimator_by_default(kind: str) -> None:
    class Strange(LinearTriangles):
        """It says nothing of an estimator."""

    of = {"mls": MovingLeastSquares, "rbf": RadialBasis, "delaunay": LinearTriangles, "a stranger's": Strange}[kind]
    assert of.default_error_estimator == {"kind": "delaunay"}
