"""‖δ‖₂/‖v‖₂ with J′(v) δ = −R′(v) : how far a solved velocity is from that of another discretisation, R′.

Both discretise the same flow on the same nodes; where their errors have little in common, δ is the larger of the two
in the main. One Newton step tells, as in defect correction (Stetter 1978; Skeel 1986): R′ is never solved.
"""

from __future__ import annotations

import numpy as np

from nlsolve.flow import Flow
from nlsolve.linear import LinearSolver
from nlsolve.series import Array
from nlsolve.status import SolveError, Status


def discretization_error(other: Flow, velocity: Array, linear: LinearSolver) -> float:
    """‖δ‖₂/‖v‖₂ over the interior nodes for the `velocity` (N, 2) of a flow that `other` discretises otherwise.

    Raises SolveError when `other` has no finite residual there or a singular tangent.
    """
    u = other.unknowns(velocity)
    residual = other.residual(u)
    if not np.isfinite(residual).all():
        raise SolveError(Status.NON_FINITE, "the residual of the other discretisation is not finite")
    change = linear.factorize(other.jacobian(u)).solve(residual)
    return float(np.linalg.norm(change) / np.linalg.norm(u))
