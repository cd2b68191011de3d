"""R(u), J(u) and R_j : the check of nonlinear problems."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlsolve.contracts.problem import NonlinearProblem
from nlsolve.series import Array, Series
from nlsolve.testing.kit.verdicts import promise
from nlsolve.testing.promises import ORDER, PARTS, check_coefficients, norm, require, same


def check_problem(problem: NonlinearProblem, u: Array, tolerance: float = 1e-6) -> None:
    """Check J d against central differences of R along random d, to `tolerance`, at a state u (U,); for a problem that
    has series, R_j along a path against R on that path. Raises AssertionError.
    """
    random = np.random.default_rng(0)
    size = norm(u) / np.sqrt(len(u)) or 1.0
    with promise("jacobian", f"J d is that of central differences of R, to {tolerance:g}"):
        jacobian = problem.jacobian(u)
        for _ in range(3):
            d = random.standard_normal(len(u)) * size
            product = jacobian @ d
            steps = [(problem.residual(u + h * d) - problem.residual(u - h * d)) / (2.0 * h) for h in PARTS]
            off = min(norm(product - difference) for difference in steps) / norm(product)
            told = f"the Jacobian is off by {off:.1e} from central differences, allowed {tolerance:g}"
            require(off <= tolerance, told)
    if problem.has_series:
        with promise("expansion", f"R along a path has the first {ORDER} Taylor coefficients of its values"):
            _check_series(problem, u, jacobian, size, random)


def _check_series(problem: NonlinearProblem, u: Array, jacobian: Any, size: float, random: np.random.Generator) -> None:
    """Check R_j and Q_j along a random path that begins at u (U,)."""
    expansion = problem.expand(u)
    path = Series(u)
    for j in range(1, ORDER + 1):
        path.append(random.standard_normal(len(u)) * size / 4.0**j)
        remainder = expansion.remainder(j).copy()
        expansion.append(path.coefficient(j))
        product, found = jacobian @ path.coefficient(j), expansion.coefficient(j) - remainder
        same(found, product, norm(product), f"R_{j} less its remainder against J u_{j}", 1e-9)
    same(expansion.path(0.5), path.sum(0.5), size, "path(a) against the sum of what was appended", 1e-12)
    coefficients = [expansion.coefficient(j) for j in range(ORDER + 1)]
    start = problem.residual(u)
    same(coefficients[0], start, norm(start) or problem.scale(u), "R_0 against R(u)", 1e-12)
    check_coefficients(lambda a: problem.residual(path.sum(a)), coefficients, "residual along a path")
