"""Every contract ships its check: the conformance kit of nlsolve, for its own plugins and for strangers'.

    def test_my_law() -> None:
        check_law(MyLaw())

A check takes an instance, runs it through what its contract promises, and raises AssertionError with a sentence that
says which promise was broken and by how much. The numbers it draws are seeded: a check fails always or never.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp

from nlsolve.algebra import Algebraic
from nlsolve.discretizers import Discretizer, Operators
from nlsolve.driver import Budget, StoppingTest, solve
from nlsolve.flow import node_major
from nlsolve.globalization import Globalization
from nlsolve.laws import CONTRACTION, ConstitutiveLaw
from nlsolve.ledger import Ledger
from nlsolve.linear import LinearSolver
from nlsolve.predictors import Predictor
from nlsolve.problems import NonlinearProblem
from nlsolve.scenes import Cloud, Scene
from nlsolve.series import Array, Series
from nlsolve.small import DenseLU, SmallProblem
from nlsolve.solvers import Evidence, KeptTangent, NonlinearSolver, RefreshRule, Step
from nlsolve.status import SolveError, Status
from nlsolve.systems import System
from nlsolve.tangent import Tangent

ORDER = 4  # of the truncated sums that series are compared with
PARTS = 0.5 ** np.arange(2, 22)  # steps and path lengths tried; the best of them escapes truncation and rounding both


def _require(holds: Any, sentence: str) -> None:
    if not holds:
        raise AssertionError(sentence)


def _size(value: Any) -> float:
    return float(np.linalg.norm(np.ravel(value)))


def _same(found: Any, expected: Any, scale: float, what: str, tolerance: float = 1e-10) -> None:
    """Largest difference ≤ tolerance · scale."""
    off = float(np.max(np.abs(found - expected), initial=0.0))
    _require(off <= tolerance * scale, f"{what}: off by {off:.2e}, allowed {tolerance:g} of {scale:.2e}")


def _check_coefficients(f: Callable[[float], Array], coefficients: list[Array], what: str) -> None:
    """f(a) = Σ_j a^j f_j: at some small a the first j + 1 terms must leave less than 2 % of the last one."""
    values = {float(a): f(float(a)) for a in PARTS}
    for j in range(1, len(coefficients)):
        size = _size(coefficients[j]) or _size(coefficients[0])
        left = min(
            _size(y - sum(a**i * coefficients[i] for i in range(j + 1))) / (a**j * size) for a, y in values.items()
        )
        _require(left <= 0.02, f"{what}: coefficient {j} misses {left:.1%} of what it should be")


def check_law(law: ConstitutiveLaw, rates: Iterable[float] = tuple(10.0 ** np.arange(-1.0, 4.5, 0.5))) -> None:
    """μ(ε̄²) at the given ε̄ [1/s]: positive and finite; its derivative by seed against central differences to 1e-7; its
    Taylor coefficients along a path ε̄²(a) against μ on that path.
    """
    x = np.asarray(tuple(rates)) ** 2
    mu = np.asarray(law.viscosity(x))
    _require(mu.shape == x.shape, f"viscosity of shape {mu.shape} for rates of shape {x.shape}")
    bad = np.sqrt(x[~(np.isfinite(mu) & (mu > 0.0))])
    _require(not bad.size, f"the viscosity is not a positive finite number at the rates {bad} 1/s")
    seeded = law.viscosity(Series.seed(x))
    _require(isinstance(seeded, Series), "the viscosity of a series must be a series: use analytic operations only")
    _same(seeded.coefficient(0) / mu, 1.0, 1.0, "viscosity on a series over that on an array", 1e-14)
    slope, small = seeded.coefficient(1), 1e-4 * mu / x  # near a maximum of μ its slope vanishes
    differences = [(law.viscosity(x * (1 + h)) - law.viscosity(x * (1 - h))) / (2 * h * x) for h in PARTS]
    off = np.min([np.abs(slope - d) / np.maximum(np.abs(slope), small) for d in differences], axis=0)
    _require(off.max() <= 1e-7, f"μ′ by seed is off by {off.max():.1e} at {np.sqrt(x[off.argmax()]):.3g} 1/s")
    path = Series(x)
    values = law.viscosity(path)
    for j in range(1, ORDER + 1):
        path.append(x * np.cos(np.arange(len(x)) + j) / 2.0**j)
    coefficients = [values.coefficient(j) for j in range(ORDER + 1)]
    _check_coefficients(lambda a: law.viscosity(path.sum(a)), coefficients, "viscosity")


def check_discretizer(discretizer: Discretizer, cloud: Cloud, tolerance: float = 1e-10) -> None:
    """Shapes, and what a consistent scheme reproduces, to `tolerance` of the sizes summed: no strain of rigid motions,
    constant strain rate of linear velocities, no force of constant stress or pressure, values and gradients of linear
    fields. Besides, of a strong form the divergence of linear stress; of a conservative one that it is adjoint.
    """
    n, free, extent = len(cloud.nodes), cloud.interior, float(np.ptp(cloud.nodes, axis=0).max())
    plain, full = discretizer.operators(cloud, False), discretizer.operators(cloud, True)
    _require(plain.dilatation is None and plain.pressure_force is None, "volumetric operators nobody asked for")
    _require(full.dilatation is not None and full.volume_points is not None, "no volumetric operators")
    assert full.volume_points is not None
    m, count, f = len(full.strain_points), len(full.volume_points), len(free)
    shapes: dict[str, tuple[int, ...]] = {"strain": (3 * m, 2 * n), "force": (2 * f, 3 * m), "strain_points": (m, 2)}
    volumetric: dict[str, tuple[int, ...]] = {
        "dilatation": (count, 2 * n),
        "pressure_force": (2 * f, count),
        "volume_points": (count, 2),
    }
    conservative = full.node_areas is not None
    if conservative:
        shapes |= {"node_areas": (f,), "strain_areas": (m,)}
        volumetric |= {"volume_areas": (count,)}
    for operators, expected in ((plain, shapes), (full, shapes | volumetric)):
        for name, shape in expected.items():
            found = getattr(getattr(operators, name), "shape", None)
            _require(found == shape, f"{name} of shape {found}, not {shape}")

    def holds(what: str, matrix: Any, field: Array, expected: Any) -> None:
        size = float(abs(matrix).sum(axis=1).max() * np.abs(field).max())
        _same(matrix @ field.ravel(), expected, size, what, tolerance)

    x, points = cloud.nodes - cloud.nodes.mean(axis=0), full.strain_points - cloud.nodes.mean(axis=0)
    for name, gradient in {
        "translation": np.zeros((2, 2)),
        "rotation": np.array([[0.0, -1.0], [1.0, 0.0]]),
        "linear velocity": np.array([[0.7, -0.3], [1.1, 0.4]]),
    }.items():
        velocity = x @ gradient.T + [1.0, -2.0]
        rate = [gradient[0, 0], gradient[1, 1], 0.5 * (gradient[0, 1] + gradient[1, 0])]
        holds(f"strain rate of a {name}", full.strain, velocity, np.repeat(rate, m))
        holds(f"dilatation of a {name}", full.dilatation, velocity, np.trace(gradient))
    holds("force of a constant stress", full.force, np.repeat([1.0, -2.0, 0.5], m), 0.0)
    holds("force of a constant pressure", full.pressure_force, np.ones(count), 0.0)
    if conservative:
        _check_adjoint(full, node_major(free))
    else:
        slopes = np.array([[0.3, -1.0], [0.8, 0.2], [-0.6, 0.9]])  # of xx, yy, xy along x and y
        divergence = np.tile([slopes[0, 0] + slopes[2, 1], slopes[2, 0] + slopes[1, 1]], f)
        holds("force of a linear stress", full.force, slopes @ points.T, divergence)
    for axis, derivative in zip("xy", discretizer.gradient(cloud), strict=True):
        _require(derivative.shape == (n, n), f"∂/∂{axis} of shape {derivative.shape}, not {(n, n)}")
        holds(f"∂/∂{axis} of a linear field", derivative, x @ [2.0, -3.0], {"x": 2.0, "y": -3.0}[axis])
    values = discretizer.values(full.strain_points, cloud.nodes[free])
    _require(values.shape == (f, m), f"values of shape {values.shape}, not {(f, m)}")
    holds("values of a linear field", values, extent + points @ [2.0, -3.0], extent + x[free] @ [2.0, -3.0])


def _check_adjoint(operators: Operators, free: Array) -> None:
    """S + Bᵀ A = 0 and S_θ + B_θᵀ A_θ = 0 on the unknowns; no area is negative, and nodes have some."""
    assert operators.strain_areas is not None
    assert operators.volume_areas is not None
    assert operators.node_areas is not None
    weighed = np.outer(CONTRACTION, operators.strain_areas).ravel()
    for name, force, rate, areas in (
        ("S = −Bᵀ A", operators.force, operators.strain, weighed),
        ("S_θ = −B_θᵀ A_θ", operators.pressure_force, operators.dilatation, operators.volume_areas),
    ):
        expected = -(rate[:, free].T @ sp.diags_array(areas))
        _same(abs(force - expected).max(), 0.0, float(abs(expected).max()), name, 1e-13)
        _require(np.min(areas) >= 0.0, f"{name}: an area is negative")
    _require(np.min(operators.node_areas, initial=1.0) > 0.0, "the material around an interior node has no area")


def check_scene(scene: Scene, law: ConstitutiveLaw) -> None:
    """A cloud with an inside and boundary groups that share no node; boundary nodes that start where they are; shapes;
    an exact velocity, where there is one, that agrees with the prescribed one.
    """
    cloud = scene.cloud(law)  # raises for coincident nodes
    members = np.concatenate([np.asarray(group) for group in cloud.boundaries.values()])
    _require(len(np.unique(members)) == len(members), "a node belongs to two boundary groups")
    _require(((members >= 0) & (members < len(cloud.nodes))).all(), "a boundary group names a node that does not exist")
    _require(len(cloud.interior), "no node lies inside")
    held = cloud.nodes[cloud.boundary]
    _same(scene.boundary_position(cloud, 0.0), held, float(np.ptp(cloud.nodes)), "boundary_position at t = 0", 1e-14)
    velocity = scene.boundary_velocity(cloud, law, 0.0)
    _require(velocity.shape == held.shape, f"boundary_velocity of shape {velocity.shape}, not {held.shape}")
    _require(np.isfinite(velocity).all(), "boundary_velocity is not finite")
    _require(
        np.isfinite(scene.reference_rate) and scene.reference_rate > 0, "reference_rate must be positive and finite"
    )
    inside = cloud.nodes[cloud.interior]
    force = scene.body_force(inside, law)
    _require(force is None or force.shape == inside.shape, "body_force must have the shape of its points")
    contour = scene.contour()
    _require(contour is None or (contour.ndim == 2 and contour.shape[1] == 2), "contour() must be a polygon (C, 2)")
    exact = scene.exact(law, cloud.nodes, 0.0)
    if exact is not None:
        _require(exact.velocity.shape == cloud.nodes.shape, f"an exact velocity of shape {exact.velocity.shape}")
        size = float(np.abs(exact.velocity).max())
        _same(
            exact.velocity[cloud.boundary], velocity, size, "exact against prescribed velocity on the boundary", 1e-12
        )


def check_linear_solver(linear: LinearSolver) -> None:
    """A x = b to 1e-10 with factors of the same matrix, of a like one and of another pattern lent, and none; on a
    symmetric matrix, and on one with zeros on its diagonal; the factors lent stay good. A named ordering and a fill;
    the work of a solve is owned up to, also in the ledger. A matrix that is singular or not finite ends in SolveError.
    """
    random = np.random.default_rng(0)
    matrix = sp.random_array((60, 60), density=0.1, rng=random, format="csr")
    matrix = (matrix + sp.diags_array(1.0 + abs(matrix).sum(axis=1))).tocsr()
    like = matrix.copy()
    like.data *= 1.0 + 0.5 * random.random(like.nnz)
    rhs = random.standard_normal(60)
    kept = rhs.copy()
    factors, last = None, matrix
    for A in (matrix, like, matrix, (matrix + matrix.T).tocsr(), matrix[random.permutation(60)], matrix):
        lent, factors = factors, linear.factorize(A, factors)
        _same(A @ factors.solve(rhs), kept, 1.0, "A x against b")
        if lent is not None:
            _same(last @ lent.solve(rhs), kept, 1.0, "A x against b, by factors that were lent since")
        _require(np.array_equal(rhs, kept), "solve changed its right-hand side")
        _require(factors.ordering not in ("", "none"), "the ordering of the factors has no name")
        _require(factors.fill > 0, "fill must tell how many entries the factors hold")
        _require(factors.attempts >= 1, "attempts must count every factorisation carried out")
        _require(factors.solves >= 1, "solves must count every pair of triangular solves carried out")
        _require(factors.products >= factors.solves - 1, "each further solve of an iteration follows a product")
        _require(not factors.solve(np.zeros(60)).any(), "A x = 0 was not solved by x = 0")
        last = A
    _check_refused(linear, matrix)


def _check_refused(linear: LinearSolver, matrix: Any) -> None:
    """What has no solution, or is no matrix, is refused in words."""
    row, column, not_finite = matrix.toarray(), matrix.toarray(), matrix.copy()
    row[7] = 0.0
    column[:, 7] = 0.0
    for what, dense in (("row", row), ("column", column)):
        try:
            linear.factorize(sp.csr_array(dense)).solve(np.ones(60))
        except SolveError as error:
            refused = error.status in (Status.SINGULAR_TANGENT, Status.UNSOLVED_TANGENT)
            _require(refused, f"a singular matrix ended as {error.status.word!r}")
        else:
            raise AssertionError(
                f"a matrix with a {what} of zeros was factorised and solved with without a word: "
                "raise SolveError(Status.SINGULAR_TANGENT)"
            )
    for value in (np.nan, np.inf):
        not_finite.data[5] = value
        try:
            linear.factorize(not_finite)
        except SolveError as error:
            _require(error.status is Status.NON_FINITE, f"a matrix with {value} ended as {error.status.word!r}")
        else:
            raise AssertionError(f"a matrix with {value} was factorised: raise SolveError(Status.NON_FINITE)")


def check_problem(problem: NonlinearProblem, u: Array, tolerance: float = 1e-6) -> None:
    """J d against central differences of R along random d, to `tolerance`; R_j along a path against R on that path."""
    random = np.random.default_rng(0)
    size = _size(u) / np.sqrt(len(u)) or 1.0
    jacobian = problem.jacobian(u)
    for _ in range(3):
        d = random.standard_normal(len(u)) * size
        product = jacobian @ d
        steps = [(problem.residual(u + h * d) - problem.residual(u - h * d)) / (2.0 * h) for h in PARTS]
        off = min(_size(product - difference) for difference in steps) / _size(product)
        _require(off <= tolerance, f"the Jacobian is off by {off:.1e} from central differences, allowed {tolerance:g}")
    expansion = problem.expand(u)
    path = Series(u)
    for j in range(1, ORDER + 1):
        path.append(random.standard_normal(len(u)) * size / 4.0**j)
        remainder = expansion.remainder(j).copy()
        expansion.append(path.coefficient(j))
        product, found = jacobian @ path.coefficient(j), expansion.coefficient(j) - remainder
        _same(found, product, _size(product), f"R_{j} less its remainder against J u_{j}", 1e-9)
    _same(expansion.path(0.5), path.sum(0.5), size, "path(a) against the sum of what was appended", 1e-12)
    coefficients = [expansion.coefficient(j) for j in range(ORDER + 1)]
    start = problem.residual(u)
    _same(coefficients[0], start, _size(start) or problem.scale(u), "R_0 against R(u)", 1e-12)
    _check_coefficients(lambda a: problem.residual(path.sum(a)), coefficients, "residual along a path")


def check_system(system: System, tolerance: float = 1e-6) -> None:
    """A finite start; a formula that treats columns one by one; a pattern that covers the Jacobian; `check_problem`
    beside the start; and known roots to 1e-12: F is zero to rounding there and, unless the system says that its roots
    are singular, a Newton step in extended precision stays.
    """
    start = system.start()
    _require(start.ndim == 1 and np.isfinite(start).all(), f"the start should be a finite (U,) array, not {start}")
    random = np.random.default_rng(0)
    states = start[:, None] + 0.1 * (np.abs(start).max() or 1.0) * random.standard_normal((len(start), 3))
    together = system.formula(states)
    _require(together.shape == states.shape, f"F of shape {together.shape} for states of shape {states.shape}")
    for column, state in zip(together.T, states.T, strict=True):
        _same(column, system.formula(state), _size(column) or 1.0, "F of several columns against F of each", 1e-12)
    problem = Algebraic(system)
    check_problem(problem, states[:, 0], tolerance)
    pattern = system.pattern()
    if pattern is not None:
        path = Series(np.repeat(states[:, :1], len(start), axis=1))
        path.append(np.eye(len(start)))
        full = system.formula(path).coefficient(1)
        size = np.abs(full).max()
        _same(problem.jacobian(states[:, 0]).toarray(), full, size, "J by groups of columns against J column by column")
    roots = system.roots()
    for root in () if roots is None else roots:
        _require(root.shape == start.shape, f"a root of shape {root.shape} of a system of shape {start.shape}")
        jacobian = problem.jacobian(root).toarray()
        exact = np.asarray(system.formula(root.astype(np.longdouble)))
        allowed = 1e-15 * (np.abs(jacobian) @ np.abs(root)) + 1e-15
        _require((np.abs(exact) <= 100.0 * allowed).all(), f"F is {np.abs(exact).max():.1e} at the root {root}")
        if not system.singular:
            step = _size(np.linalg.solve(jacobian, exact.astype(float)))
            _require(step <= 1e-12 * (_size(root) or 1.0), f"a Newton step moves the root {root} by {step:.1e}")


def check_refresh_rule(rule: RefreshRule) -> None:
    """A plain answer to any evidence, the same each time, be it not yet observed (None) or not a number."""
    for seen in (None, 0.0, 0.5, 1.0, 1e9, np.nan):
        for evidence in (Evidence(1, seen), Evidence(1, None, seen), Evidence(99, seen, seen)):
            first, again = rule.due(evidence), rule.due(evidence)
            _require(isinstance(first, (bool, np.bool_)), f"due({evidence}) is {first!r}, not True or False")
            _require(first == again, f"due({evidence}) changed its mind: a rule may look at the evidence only")


def check_globalization(globalization: Globalization) -> None:
    """On a small problem with a potential: a positive length, the residual of the state it leads to, nothing changed in
    what was handed over; near the solution Newton's full step; no memory from one solve to the next.
    """
    problem = SmallProblem()
    problem.is_gradient = True  # A is symmetric

    def first(far: float) -> float:
        state = SmallProblem.solution + far * np.cos(np.arange(12.0))
        residual = problem.residual(state)
        direction = -np.linalg.solve(problem.jacobian(state).toarray(), residual)
        given = [state.copy(), residual.copy(), direction.copy()]
        length, found = globalization.search(problem).length(problem, state, residual, direction)
        _require(length > 0.0, f"a step length of {length}")
        expected = problem.residual(state + length * direction)
        _same(found, expected, _size(expected), "the residual at the end of the step")
        unchanged = all(map(np.array_equal, given, (state, residual, direction)))
        _require(unchanged, "the search changed the state, the residual or the direction it was given")
        return length

    _require(first(0.01) == 1.0, "a full step of Newton near the solution was not taken")
    for far in (0.5, 5.0):
        _require(
            first(far) == first(far), "the first length of a second solve is another: what is kept is of one solve"
        )


def check_predictor(predictor: Predictor) -> None:
    """A flow that stays as it is goes on as it is, to 1e-12, however few increments are known; a guess has the shape of
    the velocities, leaves them as they were, and is the same each time.
    """
    _require(predictor.depth >= 1, f"a depth of {predictor.depth}: at least the last increment is looked at")
    steady = np.random.default_rng(0).standard_normal((7, 2))
    for known in range(1, predictor.depth + 1):
        past = [steady.copy() for _ in range(known)]
        guess = predictor.guess(past)
        _require(guess.shape == steady.shape, f"a guess of shape {guess.shape} for velocities of {steady.shape}")
        _same(guess, steady, 1.0, f"the guess of a steady flow from {known} increments", 1e-12)
        _require(all(np.array_equal(v, steady) for v in past), "the predictor changed the velocities it looked at")
        _require(np.array_equal(predictor.guess(past), guess), "guess changed its mind: it may look at the past only")


def check_solver(solver: NonlinearSolver, rule: RefreshRule | None = None) -> None:
    """The start comes first and is left as it was, like every state after it; a small problem is solved to 1e-10 under
    the driver; what linear solver and problem were asked for is in the ledger.
    """
    problem, ledger, asked_before = SmallProblem(), Ledger(), DenseLU.asked.copy()
    tangent = Tangent(DenseLU(), rule, ledger)
    start = SmallProblem.solution + 0.5 * np.cos(np.arange(12.0))
    kept = start.copy()
    seen: list[tuple[Array, Array]] = []

    class Watched(NonlinearSolver):
        def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: Array) -> Iterator[Step]:
            for step in solver.steps(problem, tangent, start):
                seen.append((step.state, step.state.copy()))
                yield step

    outcome = solve(problem, Watched(), tangent, start, StoppingTest(tolerance=1e-11), Budget(), ledger)
    _require(outcome.status is Status.CONVERGED, f"a small convex problem was not solved: {outcome.detail}")
    _same(outcome.state, SmallProblem.solution, 1.0, "the solution of the small problem")
    _require(np.array_equal(seen[0][1], kept), "the first state yielded must be the start itself")
    _require(np.array_equal(start, kept), "the method changed the array it was given as its start")
    _require(all(np.array_equal(a, b) for a, b in seen), "the method changed a state after it had yielded it")
    counts = ledger.counts
    _require(counts["triangular_solve"] > 0, "the method never used K*: tangent.solve is where its work shows")
    _require(counts["residual"] + counts["series_order"] > 0, "the method asked for no residual and no coefficient")
    for kind, asked in (DenseLU.asked - asked_before).items():
        _require(counts[kind] == asked, f"{asked} of kind {kind} were asked for and {counts[kind]} are in the ledger")
