"""What building operators costs: against the number of nodes, one factorisation, numpy alone, and other libraries.

    python benchmarks/operators.py [repeats]

Prints what the operators of a cloud cost whose nodes have moved a little, each built alone and each from the one
before, and the latter with numpy alone, all until they have multiplied once; the same for ∂/∂x and ∂/∂y at the stress
points of such clouds beside pycompadre and treverhines-rbf, where these are installed, from as many neighbours with
polynomials of the same degree; median seconds of B and S on graded rings of 2 000 to 100 000 nodes with the exponent of
their growth, and the share of triangulation and neighbour search; and on the 2015 paper's 1780 nodes the ratio to one
factorisation. What numba compiles is compiled, or loaded, before anything is timed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from nlsolve_discretizers.collocation import GRADIENT, Collocation
from nlsolve_discretizers.kernels.machine_code import numpy_alone
from nlsolve_discretizers.weights.assembly import Gradient
from nlsolve_discretizers.weights.neighbours import Neighbours
from nlsolve_discretizers.weights.triangles import Triangles
from other_libraries import PACKAGES, Weights, installed
from steps_cost import median_seconds
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.momentum import Flow
from nlsolve.flow.motion.moving_nodes import MovingNodes
from nlsolve.plugin import Cloud, NodeMotion, Operators

ABSENT = "numba is not installed (pip install 'nlsolve[numba]')"
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


def preparation(discretizer: Any, cloud: Cloud) -> None:
    """Triangulation and neighbour searches: what comes before the weights of B and S."""
    points = Triangles.of(cloud).midpoints()
    if isinstance(discretizer, Collocation):
        discretizer.supports(cloud.nodes, points, "strain", cloud)
        discretizer.supports(points, cloud.nodes[cloud.interior], "force", cloud)


def anew(cloud: Cloud) -> Cloud:
    """The same nodes, of which nothing has been found yet: a cloud keeps its triangulation. What the scene has told of
    their triangles stays.
    """
    return replace(cloud)


def stirred(case: Any, increments: int) -> Iterator[Cloud]:
    """The cloud of a scene, and after each increment: nodes follow the exact velocity of the spin at their places."""
    cloud = case.scene.cloud(case.law)
    moving = MovingNodes(case.scene, NodeMotion(nodes="lagrangian"), case.time.increment, case.discretizer, cloud)
    yield cloud
    for k in range(1, increments + 1):
        velocity = case.scene.exact(case.law, cloud.nodes, 0.0).velocity
        cloud, _ = moving.move(cloud, velocity, None, k * case.time.increment)
        yield cloud


def multiplied(operators: Operators) -> Operators:
    """The operators after one product of each, by when all is made that a product needs."""
    for pair in (operators.strain, operators.volumetric):
        for operator in () if pair is None else (pair.rate, pair.force):
            operator @ np.ones(operator.shape[1])
    return operators


def of_moved_clouds(increments: int) -> None:
    """Print median seconds of the operators of the clouds of a march, each built alone and each from the one before."""
    print(f"compiled by {setup('mls', PAPER).discretizer.compiled_by() or 'nothing: ' + ABSENT}\n")
    print("moved clouds     nodes       alone   from the one before   ratio   by numpy alone   ratio   the very same")
    for nodes in (PAPER, {"kind": "graded-rings", "first": 0.08, "growth": 0.1, "spacing": 0.12}):
        for kind in KINDS:
            case = setup(kind, nodes)
            discretizer = case.discretizer.for_law(case.law, case.scene.reference_rate)
            clouds = stirred(case, increments)
            cloud = next(clouds)
            before = plain = discretizer.operators(cloud, True)
            seconds, same = [], 0
            for cloud in clouds:
                begun = time.process_time()
                fresh = multiplied(discretizer.operators(cloud, True))
                built = time.process_time()
                before = multiplied(discretizer.renewed(before, cloud))
                renewed = time.process_time()
                with numpy_alone():
                    plain = multiplied(discretizer.renewed(plain, cloud))
                seconds.append((built - begun, renewed - built, time.process_time() - renewed))
                pairs = zip(_matrices(before), _matrices(fresh), strict=True)
                same += all((one != other).nnz == 0 for one, other in pairs)
            alone, renewed, by_numpy = np.median(seconds, axis=0)
            print(
                f"  {kind:9s} {len(cloud.nodes):10d} {1e3 * alone:8.1f} ms {1e3 * renewed:18.1f} ms "
                f"{alone / renewed:7.2f} {1e3 * by_numpy:13.1f} ms {by_numpy / renewed:7.2f} {same:8d} of {increments}",
                flush=True,
            )


def _matrices(operators: Operators) -> tuple[Any, Any]:
    return operators.strain.rate.tocsr(), operators.strain.force.tocsr()


def growth(repeats: int) -> None:
    """Print seconds of the operators against the number of nodes."""
    for kind in KINDS:
        counts, seconds = [], []
        print(f"\n{kind:9s}  nodes    seconds   µs a node   of it triangulation and search")
        for s in SCALES:
            case = setup(kind, {"kind": "graded-rings", "first": 0.1 * s, "growth": 0.12 * s, "spacing": 0.25 * s})
            cloud, discretizer = case.scene.cloud(case.law), case.discretizer
            whole = median_seconds(lambda c=cloud, d=discretizer: multiplied(d.operators(anew(c), False)), repeats)
            before = median_seconds(lambda c=cloud, d=discretizer: preparation(d, anew(c)), repeats)
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
            build = median_seconds(lambda k=case, c=cloud: multiplied(k.discretizer.operators(anew(c), False)), repeats)
            factorize = median_seconds(lambda k=case, m=matrix, f=factors: k.linear.factorize(m, f), repeats)
            print(f"  {kind:9s}{form:14s} {1e3 * build:12.1f} ms {1e3 * factorize:12.1f} ms {build / factorize:7.2f}")


def against_other_libraries(increments: int) -> None:
    """Print median seconds of ∂/∂x and ∂/∂y at the same points of moved clouds, from as many neighbours each: ours from
    the cloud before, and those of other libraries with their ratios to ours.
    """
    libraries = installed()
    for name in sorted(PACKAGES.keys() - libraries):
        print(f"\n{name} is not installed, which would be compared with (pip install {name}).")
    if not libraries:
        return
    heading = "".join(f"{name:>21s}  ratio" for name in ("numpy alone", *libraries))
    for kind, method in (("mls", "moving least squares"), ("rbf", "r³")):
        print(f"\nfirst derivatives, our {method:24s}       ours{heading}")
        for nodes in (PAPER, {"kind": "graded-rings", "first": 0.08, "growth": 0.1, "spacing": 0.12}):
            for degree, support in ((2, 12), (3, 20)):
                case = setup(kind, nodes, degree=degree, support=support, balanced=False)
                seconds = np.median(list(_of_derivatives(case, libraries, increments)), axis=0)
                cells = "".join(f"{1e3 * value:18.1f} ms {value / seconds[0]:6.2f}" for value in seconds[1:])
                points = len(case.discretizer.operators(case.scene.cloud(case.law), False).strain.points)
                print(
                    f"  {points:6d} points, degree {degree}, {support} nodes {1e3 * seconds[0]:14.1f} ms{cells}",
                    flush=True,
                )


def _of_derivatives(case: Any, libraries: dict[str, Weights], increments: int) -> Iterator[list[float]]:
    """Seconds for each cloud of a march: ours, ours by numpy alone, and of each library."""
    discretizer, clouds = case.discretizer, stirred(case, increments)
    known = [discretizer.operators(next(clouds), False).neighbours] * 2
    for cloud in clouds:
        known = [near.renewed(cloud, lambda triangles: triangles.inner_edges) for near in known]
        nodes, points = cloud.nodes, known[0].triangles.midpoints()
        ours = seconds_of(lambda: derivatives(discretizer, nodes, points, known[0]))
        with numpy_alone():
            plain = seconds_of(lambda: derivatives(discretizer, nodes, points, known[1]))
        given = nodes, points, discretizer.degree, discretizer.support
        yield [ours, plain, *(seconds_of(lambda: weights(*given)) for weights in libraries.values())]


def derivatives(discretizer: Collocation, nodes: np.ndarray, points: np.ndarray, near: Neighbours) -> Any:
    """∂/∂x and ∂/∂y at `points` (T, 2) from `nodes` (N, 2) [mm], sparse (T, N) each."""
    supports, both = discretizer.weights(nodes, points, "strain", GRADIENT, near=near)
    return Gradient(supports.index, both).matrices(len(nodes))


def seconds_of(work: Callable[[], object]) -> float:
    """Processor time of a piece of work [s]."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with threadpool_limits(limits=1):
        of_moved_clouds(5 * count)
        against_other_libraries(3 * count)
        against_factorization(3 * count)
        growth(max(1, count // 3))
