"""The checks of scenes: a flow's cloud and boundary, a system's formula and roots, and what any scene builds."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np

from nlsolve.algebra.formula import FormulaProblem
from nlsolve.algebra.system import System
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.continuum.terms import NodeMotion, Physics
from nlsolve.contracts.recording import SystemStart
from nlsolve.contracts.scene import Scene, Simulation
from nlsolve.series import Array, Series
from nlsolve.testing.kit.exact import check_exact
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.problems import check_problem
from nlsolve.testing.promises import norm, require, same, shaped
from nlsolve.testing.toy_problem import DenseLU


def check_scene(scene: Geometry, law: ConstitutiveLaw) -> None:
    """Check the cloud of a flow, and what is prescribed on it.

    The cloud has interior nodes, and boundary groups that share no node; `boundary_position` at t = 0 gives the
    boundary nodes; velocities and forces have the shape of their points. An exact velocity, where there is one, agrees
    with the prescribed one on the boundary to 1e-12, and leaves nothing in the curl of the balance of momentum under
    refinement (`nlsolve.testing.kit.exact`). Raises AssertionError.
    """
    with promise("reference rate", "reference_rate is a property, a positive finite number"):
        rate: Any = scene.reference_rate
        require(not callable(rate), "reference_rate is a method: write @property above it, so that it is read")
        require(np.isfinite(rate) and rate > 0, "reference_rate must be positive and finite")
    with promise("cloud", "the cloud has interior nodes, and boundary groups that share no node"):
        cloud = scene.cloud(law)  # raises for coincident nodes
        members = np.concatenate([np.asarray(group) for group in cloud.boundaries.values()])
        require(len(np.unique(members)) == len(members), "a node belongs to two boundary groups")
        inside = (members >= 0) & (members < len(cloud.nodes))
        require(inside.all(), "a boundary group names a node that does not exist")
        require(len(cloud.interior), "no node lies inside")
    with promise("boundary position", "boundary_position at t = 0 gives the boundary nodes, in their order"):
        held = cloud.nodes[cloud.boundary]
        extent = float(np.ptp(cloud.nodes))
        same(scene.boundary_position(cloud, 0.0), held, extent, "boundary_position at t = 0", 1e-14)
    with promise("boundary velocity", "boundary_velocity is real and finite, two numbers a boundary node"):
        velocity = scene.boundary_velocity(cloud, law, 0.0)
        shaped(velocity, held.shape, "boundary_velocity")
        require(velocity.dtype.kind in "fiu", f"boundary_velocity of {velocity.dtype} numbers, which should be real")
        require(np.isfinite(velocity).all(), "boundary_velocity is not finite")
    with promise("body force", "body_force is None, or has the shape of its points"):
        places = cloud.nodes[cloud.interior]
        force = scene.body_force(places, law, Physics())
        require(force is None or force.shape == places.shape, "body_force must have the shape of its points")
    with promise("contour", "a moving wall is one of the boundary groups, and the contour a polygon"):
        wall, contour = scene.moving_wall, scene.contour(NodeMotion())
        require(wall is None or wall in cloud.boundaries, f"the moving wall {wall!r} is none of the boundary groups")
        polygon = contour is None or (contour.ndim == 2 and contour.shape[1] == 2)
        require(polygon, "contour() must be a polygon (C, 2)")
    exact = scene.exact(law, cloud.nodes, 0.0)
    with promise("exact boundary", "an exact velocity is the prescribed one on the boundary"):
        if exact is not None:
            require(exact.velocity.shape == cloud.nodes.shape, f"an exact velocity of shape {exact.velocity.shape}")
            size = float(np.abs(exact.velocity).max())
            told = "exact against prescribed velocity on the boundary"
            same(exact.velocity[cloud.boundary], velocity, size, told, 1e-12)
    with promise("exact solution", "an exact velocity solves the scene: what it leaves falls under refinement"):
        if exact is not None:
            check_exact(scene, law, cloud)
    with promise("determinism", "the cloud and the boundary velocity are the same each time"):
        alike = np.array_equal(scene.cloud(law).nodes, cloud.nodes)
        alike = alike and np.array_equal(scene.boundary_velocity(cloud, law, 0.0), velocity)
        require(alike, "the nodes or the boundary velocity are others when they are asked for again")


def check_system(system: System, tolerance: float = 1e-6) -> None:
    """Check the start, the formula, the pattern and the roots of a system.

    The start is finite; the formula treats columns one by one; the pattern covers the Jacobian; `check_problem` holds
    at a state near the start. Known roots are exact to 1e-12: F is zero there to rounding and, unless the system
    declares its roots `singular`, a Newton step in extended precision stays there. Raises AssertionError.
    """
    with promise("start", "the start is a finite real (U,) array"):
        start = system.start()
        require(start.ndim == 1 and np.isfinite(start).all(), f"the start should be a finite (U,) array, not {start}")
    random = np.random.default_rng(0)
    with promise("formula", "F of an array (U, K) is a real (U, K), each column that of the state alone"):
        states = start[:, None] + 0.1 * (np.abs(start).max() or 1.0) * random.standard_normal((len(start), 3))
        kept = states.copy()
        together = np.asarray(system.formula(states))
        require(together.shape == states.shape, f"F of shape {together.shape} for states of shape {states.shape}")
        require(together.dtype.kind in "fiu", f"F of {together.dtype} numbers, which should be real")
        for column, state in zip(together.T, states.T, strict=True):
            same(column, system.formula(state), norm(column) or 1.0, "F of several columns against F of each", 1e-12)
    with promise("no mutation", "the formula does not change its states, and gives the same each time"):
        again = system.formula(states)
        require(np.array_equal(states, kept), "the formula changed the states it was given")
        require(np.array_equal(again, together), "F is another when it is asked for again")
    problem = system.equations()
    check_problem(problem, states[:, 0], tolerance)
    with promise("pattern", "a pattern has an entry wherever the Jacobian may differ from zero"):
        if system.pattern() is not None:
            path = Series(np.repeat(states[:, :1], len(start), axis=1))
            path.append(np.eye(len(start)))
            full = system.formula(path).coefficient(1)
            size, told = np.abs(full).max(), "J by groups of columns against J column by column"
            same(problem.jacobian(states[:, 0]).toarray(), full, size, told)
    with promise("roots", "known roots are exact to 1e-12"):
        roots = system.roots()
        for root in () if roots is None else roots:
            _check_root(system, problem, root, start)


def _check_root(system: System, problem: FormulaProblem, root: Array, start: Array) -> None:
    require(root.shape == start.shape, f"a root of shape {root.shape} of a system of shape {start.shape}")
    jacobian = problem.jacobian(root).toarray()
    exact = np.asarray(system.formula(root.astype(np.longdouble)))
    require(exact.dtype.kind == "f", f"F of {exact.dtype} numbers at the root {root}")
    allowed = 1e-15 * (np.abs(jacobian) @ np.abs(root)) + 1e-15
    require((np.abs(exact) <= 100.0 * allowed).all(), f"F is {np.abs(exact).max():.1e} at the root {root}")
    if not system.singular:
        step = norm(np.linalg.solve(jacobian, exact.astype(float)))
        require(step <= 1e-12 * (norm(root) or 1.0), f"a Newton step moves the root {root} by {step:.1e}")


def check_simulation(scene: Scene, parts: Any = None) -> None:
    """Check that a scene builds its simulation, and that the problem of its sample has its Jacobian and series.

    parts : the components of its sections; without them it gets a linear solver, and the start of a system.
    """
    with promise("simulation", "the scene builds a Simulation"):
        given = SimpleNamespace(scene=scene, linear=DenseLU(), start=SystemStart()) if parts is None else parts
        simulation = scene.simulation(given, lambda kind: nullcontext())
        told = f"simulation() gave a {type(simulation).__name__}, not a Simulation"
        require(isinstance(simulation, Simulation), told)
    with promise("sample", "its sample is a problem and a state (U,) of it"):
        problem, state = simulation.sample()
        residual = problem.residual(state)
        require(residual.shape == state.shape, f"R of shape {residual.shape} at a state of shape {state.shape}")
    check_problem(problem, state)
