"""(JᵀJ + μ D) w = −Jᵀ R(u),  u ← u + w where ‖R‖ falls : Levenberg and Marquardt's method, in the end Newton's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from pydantic import Field
from scipy.sparse.linalg import norm as sparse_norm

from nlsolve.plugin import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step, norm, unit

ACCEPTED = 1e-4  # gain over the one predicted from which a step is taken
LARGEST_SHIFT = 1e12  # μ: shorter steps are lost in the rounding of u
STATIONARY = 1e-8  # ‖Jᵀ R‖ over ‖J‖ ‖R‖, of Frobenius
WAY_OUT = "where no step of this method leads on: begin elsewhere, or choose robust"


class LevenbergMarquardt(NonlinearSolver):
    """Levenberg (1944), Marquardt (1963), with D = diag(JᵀJ) (Moré 1978) and the damping μ of Nielsen (1999):

        ρ = (‖R(u)‖² − ‖R(u + w)‖²)/(‖R(u)‖² − ‖R(u) + J w‖²)
        ρ > 0 : the step is taken,  μ ← μ max(1/3, 1 − (2 ρ − 1)³),  ν ← 2;      else  μ ← μ ν,  ν ← 2 ν.

    What is factorised, and kept as long as the refresh rule says, is (I, J; Jᵀ, −μ D), with the J and the μ of that
    moment; J of a kept one is the model that ρ is measured against. A step that is refused is told to the rule as a
    contraction above 1, and needs a new matrix: where the rule would rather keep the old one, the method has stagnated.
    """

    kind: Literal["levenberg-marquardt"] = "levenberg-marquardt"
    shift: float = Field(1e-3, gt=0, description="μ of the first step")

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …; raises SolveError (stagnated) as above."""
        state, shift, growth, refused = start, self.shift, 2.0, False
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = norm(residual)
            renewed = tangent.refresh_if_due(lambda: augmented(problem.jacobian(state), shift))
            if refused and (shift > LARGEST_SHIFT or not renewed):
                why = f"with a damping of {shift:.1e}" if renewed else "and the refresh rule keeps its matrix"
                if is_stationary(problem.jacobian(state), residual):
                    why += f"; Jᵀ R = 0 here: the least or another stationary point of ‖R‖, {WAY_OUT}"
                raise SolveError(Status.STAGNATED, f"a step was refused because ‖R‖ does not fall, {why}")
            both = tangent.solve(np.concatenate([-residual, np.zeros_like(state)]))
            left, step = np.split(both, 2)
            trial = problem.residual(state + step)
            trial_size, scale = norm(trial), unit(residual)  # a power of two, which keeps squares finite
            predicted = (size / scale) ** 2 - float((left / scale) @ (left / scale))
            fallen = (size / scale) ** 2 - (trial_size / scale) ** 2
            gain = fallen / predicted if predicted > 0.0 else float(size == 0.0)
            refused = not gain > ACCEPTED
            if refused:
                tangent.observe(contraction=max(trial_size / size, 1.0))
                if renewed:  # a kept matrix has the model of an older J, which may be at fault
                    shift, growth = shift * growth, 2.0 * growth
                continue
            shift, growth = shift * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), 2.0
            state, residual = state + step, trial
            yield Step(state)


def augmented(jacobian: Any, shift: float) -> Any:
    """(I, J; Jᵀ/α, −μ D/α) of shape (2 U, 2 U) with D = diag(‖J e_j‖²), α = min_j ‖J e_j‖.

    (I, J; Jᵀ/α, −μ D/α) (r; w) = (b; 0) has w = argmin ‖b − J w‖² + μ ‖D^½ w‖² and r = b − J w: the normal equations
    without JᵀJ, whose condition is the square of J's (Björck 1996, 1.6). α makes rows of one size. For a column of
    zeros, by which w cannot be told, ‖J e_j‖ is the largest there is, or 1: its w_j is zero.
    """
    matrix = jacobian.tocsr()
    columns = lengths_of_columns(matrix)
    columns = np.where(columns > 0.0, columns, columns.max() or 1.0)
    alpha = float(columns.min())
    damping = shift * columns * (columns / alpha)
    rows = [[sp.eye_array(matrix.shape[0]), matrix], [matrix.T / alpha, -sp.diags_array(damping)]]
    return sp.block_array(rows, format="csr")


def lengths_of_columns(matrix: Any) -> np.ndarray:
    """‖J e_j‖, (U,), of a sparse matrix (U, U)."""
    scale = unit(matrix.data)
    return scale * sparse_norm(matrix / scale, axis=0)


def is_stationary(jacobian: Any, residual: np.ndarray) -> bool:
    """Whether the gradient Jᵀ R of ½ ‖R‖² vanishes beside ‖J‖ ‖R‖."""
    matrix = jacobian.tocsr()
    gradient = norm(matrix.T @ (residual / unit(residual)))
    return gradient <= STATIONARY * norm(matrix.data) * norm(residual / unit(residual))
