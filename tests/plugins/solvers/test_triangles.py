"""Newton-Krylov that is preconditioned with the tangent by linear triangles: its solution, its products, its work."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import PLAIN, SystemParts, near, run, setup
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares, RadialBasis
from nlsolve_laws import PowerLaw
from nlsolve_rules.operators import Diagonal
from nlsolve_rules.refresh import EveryIteration, Never, PoorContraction
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import GradedRings, Rings
from nlsolve_solvers import Newton, NewtonKrylov
from nlsolve_solvers.krylov.gmres import gmres
from nlsolve_systems import Bratu

from nlsolve import SolveError, Status
from nlsolve.flow.continuation import Start
from nlsolve.flow.momentum import Flow
from nlsolve.plugin import Discretizer, NonlinearProblem
from nlsolve.solving.matrices import checked
from nlsolve.solving.simulate import run_case
from nlsolve.solving.stopping import StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.counted_problem import CountedProblem
from nlsolve.solving.work.ledger import Ledger

TRIANGLES = NewtonKrylov(preconditioner="triangles")
FORMS = (MovingLeastSquares(), MovingLeastSquares(form="conservative"), RadialBasis())


def spin(discretizer: Discretizer, nodes: Any, index: float = 0.5, penalty: float = 0.0) -> Flow:
    """The steady spin, with a volumetric term where there is a penalty [MPa s]."""
    scene, law = StirringTool(nodes=nodes), PowerLaw(index=index, regularization=1e-2)
    cloud = scene.cloud(law)
    walls = scene.boundary_velocity(cloud, law, 0.0)
    return Flow(cloud, discretizer.operators(cloud, penalty > 0.0), law, walls, penalty)


def products(flow: Flow, u: np.ndarray, tolerance: float) -> int:
    """Products of GMRES for Newton's correction at u (U,), preconditioned with the tangent by triangles."""
    residual, factors = flow.residual(u), PLAIN.factorize(flow.jacobian_by(LinearTriangles(), u))
    found = gmres(
        flow.jacobian(u).__matmul__, factors.solve, -residual, tolerance * float(np.linalg.norm(residual)), 60
    )
    assert found.left <= tolerance * np.linalg.norm(residual)
    return found.count


# Mathematics.


@pytest.mark.parametrize("discretizer", FORMS, ids=lambda discretizer: f"{discretizer.kind}-{discretizer.form}")
@pytest.mark.parametrize("penalty", [0.0, 100.0])
def test_triangles_lead_to_newtons_solution_with_one_tangent(discretizer: Discretizer, penalty: float) -> None:
    flow, tight = spin(discretizer, Rings(spacing=0.5), penalty=penalty), StoppingTest(tolerance=1e-11)
    start = near(flow, 0.52)
    outcome, ledger = run(flow, TRIANGLES, PoorContraction(), start, stop=tight)
    newton, _ = run(flow, Newton(), EveryIteration(), start, stop=tight)
    assert outcome.status is newton.status is Status.CONVERGED, outcome.detail
    assert np.linalg.norm(outcome.state - newton.state) <= 1e-8 * np.linalg.norm(newton.state)
    assert ledger.counts["factorization"] == 1


@pytest.mark.parametrize("index", [0.5, 0.1324])
def test_products_do_not_grow_while_the_nodes_get_nearer(index: float) -> None:
    """The two tangents are spectrally near, whatever the distance of the nodes."""
    for scale in (1.4, 1.0, 0.7):
        nodes = GradedRings(first=0.1 * scale, growth=0.12 * scale, spacing=0.25 * scale)
        flow = spin(MovingLeastSquares(), nodes, index)
        assert products(flow, near(flow, index), 1e-2) <= 3
        assert products(flow, near(flow, index), 1e-4) <= 7


# Work.


def test_tangents_by_triangles_are_counted_as_what_they_are() -> None:
    """Each is a Jacobian and a factorisation; products with J are series, or come of a Jacobian of their own."""
    flow = spin(MovingLeastSquares(), Rings(spacing=0.5))
    start = near(flow, 0.52)
    outcome, ledger = run(flow, TRIANGLES, EveryIteration(), start)
    steps = len(outcome.rows) - 1
    assert ledger.counts["jacobian"] == ledger.counts["factorization"] == steps
    assert ledger.counts["series_order"] == ledger.counts["triangular_solve"]
    outcome, ledger = run(flow, TRIANGLES.with_(products="jacobian"), Never(), start)
    assert ledger.counts["factorization"] == 1
    assert ledger.counts["jacobian"] == len(outcome.rows)  # one a step, and that by triangles
    assert ledger.counts["matrix_product"] == ledger.counts["triangular_solve"]


def test_operators_by_triangles_are_built_once_for_a_cloud(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stages of the continuation and the case's own solve share them."""
    built: list[int] = []
    whole = LinearTriangles.operators

    def counted(self: LinearTriangles, cloud: Any, volumetric: bool) -> Any:
        built.append(len(cloud.nodes))
        return whole(self, cloud, volumetric)

    monkeypatch.setattr(LinearTriangles, "operators", counted)
    start = Start(solver=TRIANGLES)
    parts = setup(StirringTool(nodes=Rings(spacing=0.5)), index=0.3, solver=TRIANGLES, start=start)
    row = run_case(parts).summary
    assert row["status"] == "converged"
    assert row["start_factorizations"] > 1
    assert len(built) == 1


# Where triangles have no say.


def test_a_system_has_no_triangles() -> None:
    row = run_case(SystemParts(Bratu(nodes=20), solver=TRIANGLES)).summary
    assert row["status"] == "not applicable"
    assert row["message"].endswith(
        'newton-krylov has preconditioner = "triangles", and no discretizer has made these equations: '
        'set it to "operator", its default'
    )
    assert row["factorizations"] == 0


def test_triangles_and_another_operator_are_one_too_many() -> None:
    flow, ledger = spin(MovingLeastSquares(), Rings(spacing=0.75)), Ledger()
    operator = checked(Diagonal())
    problem: NonlinearProblem = CountedProblem(flow, ledger, operator)
    steps = TRIANGLES.steps(problem, Tangent(PLAIN, None, ledger, operator=operator), near(flow, 0.52))
    with pytest.raises(SolveError, match='the case has an operator of its own: set it to "operator", its default'):
        list(steps)
