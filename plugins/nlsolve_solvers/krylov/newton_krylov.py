"""‖R(u) + J(u) w‖ ≤ η ‖R(u)‖,  u ← u + t w : inexact Newton by GMRES, preconditioned with the kept K*."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, TypeAdapter

from nlsolve.plugin import (
    AnyDiscretizer,
    Discretizer,
    Globalized,
    KeptTangent,
    NonlinearProblem,
    NonlinearSolver,
    SolveError,
    Status,
    Step,
    cached_jacobian,
    norm,
)
from nlsolve_solvers.krylov.forcing import next_forcing
from nlsolve_solvers.krylov.gmres import gmres

SMALLEST_FORCING = 1e-6  # below it lies what the next residual will correct anyway

TRIANGLES: TypeAdapter[Discretizer] = TypeAdapter(AnyDiscretizer)
"""Looks up the discretizer of linear triangles, `delaunay`, when a solve begins."""


class NewtonKrylov(NonlinearSolver):
    """Dembo, Eisenstat & Steihaug (1982); forcing terms η of Eisenstat & Walker (1996), and t from a globalisation,
    which is told that the decrease predicted along w is 1 − ‖R + J w‖/‖R‖ only.

    J w comes from the assembled Jacobian, or without one from the residual's own series: [R(u + a w)]_1. The refresh
    rule is told the contraction per inner iteration, which is what K* decides.

    J has the support of the case's discretizer, K* need not: with triangles it is the tangent of the same equations by
    linear finite elements on the same nodes, which is spectrally near J and has about a sixth of its factors' entries.
    """

    kind: Literal["newton-krylov"] = "newton-krylov"
    forcing: Literal["linear-model", "ratio", "constant"] = Field(
        "ratio", description="η: choice 1 or choice 2 of Eisenstat and Walker, or the first η throughout"
    )
    first_forcing: float = Field(0.1, gt=0, lt=1, description="η of the first iteration")
    products: Literal["auto", "jacobian", "series"] = Field(
        "auto",
        description="J w by a Jacobian assembled once an iteration, or each by a series of order 1; auto: by series "
        "where the problem has one",
    )
    preconditioner: Literal["operator", "triangles"] = Field(
        "operator",
        description="K*: the case's operator, which is J unless [operator] says otherwise, or the tangent of the same "
        "equations by linear triangles on the same nodes, for flows",
    )
    dimension: int = Field(40, gt=0, description="largest dimension of the Krylov space")
    globalization: Globalized = Field(  # type: ignore[assignment]
        {"kind": "backtracking"}, description="how the step length t is found"
    )
    default_refresh: ClassVar = {"kind": "poor-contraction"}
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The iterates u_0, u_1, …"""
        jacobian, search = cached_jacobian(problem), self.globalization.search(problem)
        kept = self.assembly(problem, jacobian.operator)
        state, eta = start, self.first_forcing
        by_series = self.products == "series" or (self.products == "auto" and problem.has_series)
        residual = problem.residual(state)
        yield Step(state)
        while True:
            size = norm(residual)
            tangent.refresh_if_due(lambda: kept(state))
            if size == 0.0:
                yield Step(state)
                continue
            product = along(problem, state) if by_series else jacobian(state).__matmul__
            found = gmres(product, tangent.solve, -residual, eta * size, self.dimension)
            length, residual = search.length(problem, state, residual, found.solution, 1.0 - found.left / size)
            state = state + length * found.solution
            contraction = (found.left / size) ** (1.0 / found.count)
            tangent.observe(contraction=contraction)
            yield Step(state, notes={"length": length, "contraction": contraction})
            size_now = norm(residual)
            eta = max(next_forcing(self.forcing, eta, size_now, size, found.left), SMALLEST_FORCING)

    def assembly(self, problem: NonlinearProblem, operator: Callable[[np.ndarray], Any]) -> Callable[[np.ndarray], Any]:
        """u ↦ the matrix that K* is made of, sparse (U, U).

        operator : the same by the case's operator. Raises SolveError (not applicable) where triangles have no say.
        """
        if self.preconditioner == "operator":
            return operator
        asked, way_out = 'newton-krylov has preconditioner = "triangles"', 'set it to "operator", its default'
        if not problem.has_other_discretizations:
            raise SolveError(Status.NOT_APPLICABLE, f"{asked}, and no discretizer has made these equations: {way_out}")
        if not problem.operator_is_jacobian:
            raise SolveError(Status.NOT_APPLICABLE, f"{asked}, and the case has an operator of its own: {way_out}")
        triangles = TRIANGLES.validate_python({"kind": "delaunay"})
        return lambda u: problem.jacobian_by(triangles, u)


def along(problem: NonlinearProblem, state: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """w ↦ J w = [R(u + a w)]_1."""

    def product(w: np.ndarray) -> np.ndarray:
        expansion = problem.expand(state)
        expansion.append(w)
        return expansion.coefficient(1)

    return product
