"""The checks of scenes: of a flow's cloud and boundary, and of a system's formula and roots."""

from __future__ import annotations

import numpy as np

from nlsolve.algebra.system import System
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.continuum.terms import NodeMotion, Physics
from nlsolve.series import Series
from nlsolve.testing.problems import check_problem
from nlsolve.testing.promises import norm, require, same, shaped


def check_scene(scene: Geometry, law: ConstitutiveLaw) -> None:
    """Check the cloud of a flow, and what is prescribed on it.

    The cloud has interior nodes, and boundary groups that share no node; `boundary_position` at t = 0 gives the
    boundary nodes; velocities and forces have the shape of their points. An exact velocity, where there is one, agrees
    with the prescribed one on the boundary to 1e-12. Raises AssertionError.
    """
    cloud = scene.cloud(law)  # raises for coincident nodes
    members = np.concatenate([np.asarray(group) for group in cloud.boundaries.values()])
    require(len(np.unique(members)) == len(members), "a node belongs to two boundary groups")
    require(((members >= 0) & (members < len(cloud.nodes))).all(), "a boundary group names a node that does not exist")
    require(len(cloud.interior), "no node lies inside")
    held = cloud.nodes[cloud.boundary]
    same(scene.boundary_position(cloud, 0.0), held, float(np.ptp(cloud.nodes)), "boundary_position at t = 0", 1e-14)
    velocity = scene.boundary_velocity(cloud, law, 0.0)
    shaped(velocity, held.shape, "boundary_velocity")
    require(np.isfinite(velocity).all(), "boundary_velocity is not finite")
    require(
        np.isfinite(scene.reference_rate) and scene.reference_rate > 0, "reference_rate must be positive and finite"
    )
    inside = cloud.nodes[cloud.interior]
    force = scene.body_force(inside, law, Physics())
    require(force is None or force.shape == inside.shape, "body_force must have the shape of its points")
    wall, contour = scene.moving_wall, scene.contour(NodeMotion())
    require(wall is None or wall in cloud.boundaries, f"the moving wall {wall!r} is none of the boundary groups")
    require(contour is None or (contour.ndim == 2 and contour.shape[1] == 2), "contour() must be a polygon (C, 2)")
    exact = scene.exact(law, cloud.nodes, 0.0)
    if exact is not None:
        require(exact.velocity.shape == cloud.nodes.shape, f"an exact velocity of shape {exact.velocity.shape}")
        size = float(np.abs(exact.velocity).max())
        same(exact.velocity[cloud.boundary], velocity, size, "exact against prescribed velocity on the boundary", 1e-12)


def check_system(system: System, tolerance: float = 1e-6) -> None:
    """Check the start, the formula, the pattern and the roots of a system.

    The start is finite; the formula treats columns one by one; the pattern covers the Jacobian; `check_problem` holds
    at a state near the start. Known roots are exact to 1e-12: F is zero there to rounding and, unless the system
    declares its roots `singular`, a Newton step in extended precision stays there. Raises AssertionError.
    """
    start = system.start()
    require(start.ndim == 1 and np.isfinite(start).all(), f"the start should be a finite (U,) array, not {start}")
    random = np.random.default_rng(0)
    states = start[:, None] + 0.1 * (np.abs(start).max() or 1.0) * random.standard_normal((len(start), 3))
    together = system.formula(states)
    require(together.shape == states.shape, f"F of shape {together.shape} for states of shape {states.shape}")
    for column, state in zip(together.T, states.T, strict=True):
        same(column, system.formula(state), norm(column) or 1.0, "F of several columns against F of each", 1e-12)
    problem = system.equations()
    check_problem(problem, states[:, 0], tolerance)
    pattern = system.pattern()
    if pattern is not None:
        path = Series(np.repeat(states[:, :1], len(start), axis=1))
        path.append(np.eye(len(start)))
        full = system.formula(path).coefficient(1)
        size = np.abs(full).max()
        same(problem.jacobian(states[:, 0]).toarray(), full, size, "J by groups of columns against J column by column")
    roots = system.roots()
    for root in () if roots is None else roots:
        require(root.shape == start.shape, f"a root of shape {root.shape} of a system of shape {start.shape}")
        jacobian = problem.jacobian(root).toarray()
        exact = np.asarray(system.formula(root.astype(np.longdouble)))
        allowed = 1e-15 * (np.abs(jacobian) @ np.abs(root)) + 1e-15
        require((np.abs(exact) <= 100.0 * allowed).all(), f"F is {np.abs(exact).max():.1e} at the root {root}")
        if not system.singular:
            step = norm(np.linalg.solve(jacobian, exact.astype(float)))
            require(step <= 1e-12 * (norm(root) or 1.0), f"a Newton step moves the root {root} by {step:.1e}")
