"""F(u) = 0 and its known roots: the check of systems of equations."""

from __future__ import annotations

import numpy as np

from nlsolve.algebra import Algebraic
from nlsolve.series import Series
from nlsolve.systems import System
from nlsolve.testing.problems import check_problem
from nlsolve.testing.promises import norm, require, same


def check_system(system: System, tolerance: float = 1e-6) -> None:
    """A finite start; a formula that treats columns one by one; a pattern that covers the Jacobian; `check_problem`
    beside the start; and known roots to 1e-12: F is zero to rounding there and, unless the system says that its roots
    are singular, a Newton step in extended precision stays.
    """
    start = system.start()
    require(start.ndim == 1 and np.isfinite(start).all(), f"the start should be a finite (U,) array, not {start}")
    random = np.random.default_rng(0)
    states = start[:, None] + 0.1 * (np.abs(start).max() or 1.0) * random.standard_normal((len(start), 3))
    together = system.formula(states)
    require(together.shape == states.shape, f"F of shape {together.shape} for states of shape {states.shape}")
    for column, state in zip(together.T, states.T, strict=True):
        same(column, system.formula(state), norm(column) or 1.0, "F of several columns against F of each", 1e-12)
    problem = Algebraic(system)
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
