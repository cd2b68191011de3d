"""What building operators costs: against the number of nodes, one factorisation, and another library.

    python benchmarks/operators.py [repeats]

Prints what the operators of a cloud cost whose nodes have moved a little, each built alone and each from the one
before; median seconds of B and S on graded rings of 2 000 to 100 000 nodes with the exponent of their growth, and the
share of triangulation and neighbour search; on the 2015 paper's 1780 nodes the ratio to one factorisation; and, where
the library `rbf` is installed (pip install treverhines-rbf), seconds of both for the same first-derivative weights:
r³, degree 2 and 3, the same supports, targets between the same nodes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from nlsolve_discretizers.collocation import GRADIENT, Collocation
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.triangles import Triangles
from steps_cost import median_seconds
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.momentum import Flow
from nlsolve.flow.motion.moving_nodes import MovingNodes
from nlsolve.plugin import NodeMotion, Operators

try:
    from rbf.pde.fd import weight_matrix
except ImportError:
    weight_matrix = None

KINDS = ("mls", "rbf", "delaunay")
PAPER = {"kind": "rings"}
SCALES = (1.05, 0.6, 0.35, 0.22, 0.143)  # of all spacings: 2 000 to 100 000 nodes


def setup(kind: str, nodes: dict[str, Any], **fields: Any) -> Any:
    """The components of the steady spin with one discretizer."""
    study = {
        "question": "what do operators cost?",
        "scene": {"kind": "stirring-tool", "nodes": nodes},
        "law": {"kind": "power-law"},
        "discretizer": {"kind": kind, **fields},
        "solver": {"kind": "newton"},
    }
    return nlsolve.Study.from_dict(study).cases[0].parts


def preparation(discretizer: Any, cloud: nlsolve.Cloud) -> None:
    """Triangulation and neighbour searches: what comes before the weights of B and S."""
    points = Triangles.of(cloud).midpoints()
    if isinstance(discretizer, Collocation):
        discretizer.supports(cloud.nodes, points, "strain", cloud)
        discretizer.supports(points, cloud.nodes[cloud.interior], "force", cloud)


def stirred(case: Any, increments: int) -> Iterator[nlsolve.Cloud]:
    """The cloud of a scene, and after each increment: nodes follow the exact velocity of the spin at their places."""
    cloud = case.scene.cloud(case.law)
    moving = MovingNodes(case.scene, NodeMotion(nodes="lagrangian"), case.time.increment, case.discretizer, cloud)
    yield cloud
    for k in range(1, increments + 1):
        velocity = case.scene.exact(case.law, cloud.nodes, 0.0).velocity
        cloud, _ = moving.move(cloud, velocity, None, k * case.time.increment)
        yield cloud


def of_moved_clouds(increments: int) -> None:
    """Print median seconds of the operators of the clouds of a march, each built alone and each from the one before."""
    print("\nmoved clouds           nodes      alone   from the one before   ratio   the very same")
    for nodes in (PAPER, {"kind": "graded-rings", "first": 0.08, "growth": 0.1, "spacing": 0.12}):
        for kind in KINDS:
            case = setup(kind, nodes)
            discretizer = case.discretizer.for_law(case.law, case.scene.reference_rate)
            before, seconds, same = None, [], 0
            for cloud in stirred(case, increments):
                began = time.process_time()
                alone = discretizer.operators(cloud, True)
                built = time.process_time()
                if before is not None:
                    before = discretizer.renewed(before, cloud)
                    seconds.append((built - began, time.process_time() - built))
                    pairs = zip(_matrices(before), _matrices(alone), strict=True)
                    same += all((one != other).nnz == 0 for one, other in pairs)
                before = before or alone
            anew, renewed = np.median(seconds, axis=0)
            print(
                f"  {kind:9s} {len(cloud.nodes):16d} {1e3 * anew:7.1f} ms {1e3 * renewed:18.1f} ms "
                f"{anew / renewed:7.2f} {same:8d} of {increments}",
                flush=True,
            )


def _matrices(operators: Operators) -> tuple[Any, Any]:
    return operators.strain.rate, operators.strain.force


def growth(repeats: int) -> None:
    """Print seconds of the operators against the number of nodes."""
    for kind in KINDS:
        counts, seconds = [], []
        print(f"\n{kind:9s}  nodes    seconds   µs a node   of it triangulation and search")
        for s in SCALES:
            case = setup(kind, {"kind": "graded-rings", "first": 0.1 * s, "growth": 0.12 * s, "spacing": 0.25 * s})
            cloud, discretizer = case.scene.cloud(case.law), case.discretizer
            whole = median_seconds(lambda c=cloud, d=discretizer: d.operators(c, False), repeats)
            before = median_seconds(lambda c=cloud, d=discretizer: preparation(d, c), repeats)
            counts.append(len(cloud.nodes))
            seconds.append(whole)
            print(
                f"  {counts[-1]:14d} {whole:10.3f} {1e6 * whole / counts[-1]:11.1f} {before / whole:12.0%}", flush=True
            )
        print(f"  seconds ~ nodes^{np.polyfit(np.log(counts), np.log(seconds), 1)[0]:.2f}  (aim: 1)")


def against_factorization(repeats: int) -> None:
    """Print the time of operators on the paper's cloud over that of one factorisation of their tangent."""
    print("\n1780 nodes:                     operators   factorisation   ratio")
    for kind in KINDS:
        for form in ("strong", "conservative") if kind != "delaunay" else ("",):
            case = setup(kind, PAPER, **({"form": form} if form else {}))
            cloud = case.scene.cloud(case.law)
            walls = case.scene.boundary_velocity(cloud, case.law, 0.0)
            flow = Flow(cloud, case.discretizer.operators(cloud, False), case.law, walls)
            exact = case.scene.exact(case.law, cloud.nodes, 0.0)
            matrix = flow.jacobian(flow.unknowns(exact.velocity))
            factors = case.linear.factorize(matrix)
            build = median_seconds(lambda k=case, c=cloud: k.discretizer.operators(c, False), repeats)
            factorize = median_seconds(lambda k=case, m=matrix, f=factors: k.linear.factorize(m, f), repeats)
            print(f"  {kind:9s}{form:14s} {1e3 * build:12.1f} ms {1e3 * factorize:12.1f} ms {build / factorize:7.2f}")


def derivatives(discretizer: Collocation, nodes: np.ndarray, points: np.ndarray) -> Any:
    """∂/∂x and ∂/∂y at `points` (T, 2) from `nodes` (N, 2) [mm], sparse (T, N) each."""
    supports, (dx, dy) = discretizer.weights(nodes, points, "value", GRADIENT)
    return Gradient(supports.index, dx, dy).matrices(len(nodes))


def against_another_library(repeats: int) -> None:
    """Print the time of ∂/∂x and ∂/∂y at the same points from the same nodes, as sparse matrices of either library."""
    if weight_matrix is None:
        print("\nThe library rbf is not installed (pip install treverhines-rbf): nothing to compare with.")
        return
    print("\nfirst derivatives, r³           ours       rbf, one call   rbf, two calls   ratios")
    for nodes in (PAPER, {"kind": "graded-rings", "first": 0.04, "growth": 0.05, "spacing": 0.1}):
        for degree, support in ((2, 12), (3, 20)):
            case = setup("rbf", nodes, degree=degree, support=support, balanced=False)
            cloud, ours = case.scene.cloud(case.law), case.discretizer
            points = ours.operators(cloud, False).strain.points
            options = {"n": support, "phi": "phs3", "order": degree}
            seconds = [
                median_seconds(work, repeats)
                for work in (
                    lambda o=ours, c=cloud, p=points: derivatives(o, c.nodes, p),
                    lambda c=cloud, p=points, k=options: weight_matrix(
                        p, c.nodes, diffs=[[1, 0], [0, 1]], sum_terms=False, **k
                    ),
                    lambda c=cloud, p=points, k=options: [
                        weight_matrix(p, c.nodes, diffs=d, **k) for d in ([1, 0], [0, 1])
                    ],
                )
            ]
            cells = "".join(f"{1e3 * value:13.1f} ms" for value in seconds)
            ratios = "".join(f"{value / seconds[0]:8.2f}" for value in seconds[1:])
            print(f"  {len(points):6d} points, degree {degree}{cells}{ratios}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with threadpool_limits(limits=1):
        of_moved_clouds(5 * count)
        against_another_library(3 * count)
        against_factorization(3 * count)
        growth(max(1, count // 3))
