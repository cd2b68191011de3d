"""(1 − a) K* W + a G(W) = 0, a: 0 → 1, W(a) = a W_1 + … + a^p W_p : the asymptotic numerical method with a kept K*.

Timesli, Braikat, Lahmam, Zahrouni (2015), after Jamal, Braikat, Boutmir, Damil, Potier-Ferry (2002).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import (
    Component,
    Expansion,
    KeptTangent,
    NonlinearProblem,
    NonlinearSolver,
    SolveError,
    Status,
    Step,
    hookimpl,
)

ROUNDING = 1e-10  # W_2 below this part of W_1 is rounding: K* is the tangent
SHORTEST_RANGE = 1e-6  # a series that advances less than this part of its path is exhausted


class AsymptoticNumericalMethod(NonlinearSolver):
    """Order by order,

        K* W_1 = −G(0),     K* W_{j+1} = K* W_j − [G(W(a))]_j,

    with [.]_j the Taylor coefficient in a, so that one K* serves all orders; K* W_j is the right-hand side before. The
    range keeps the last terms below η:

        a_max = min over j = p − 1, p of (η ‖W_1‖ / ‖W_j‖)^(1/(j−1)).

    The 2015 paper takes j = p alone; W_2 vanishes when K* is the tangent at W = 0, hence the larger of two terms.
    a_max ≥ 1: W(1) is the solution and K* is kept. a_max < 1: the refresh rule may renew K* here and the series is
    computed again; with a K* that is already new, the state advances to W(a_max) and a branch begins there.
    """

    kind: Literal["anm"] = "anm"
    order: int = Field(20, ge=2, description="p, order of the series")
    tolerance: float = Field(1e-6, gt=0, description="η, part of the first term the last ones may reach")
    default_refresh: ClassVar = {"kind": "range-under-one"}
    claims: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The ends of the branches."""
        state, size = start, None
        yield Step(state)
        while True:
            fresh = tangent.refresh_if_due(problem, state)
            series, reach = self._series(problem, tangent, state)
            tangent.observe(range=reach)
            if reach < 1.0 and not fresh and tangent.refresh_if_due(problem, state):
                series, reach = self._series(problem, tangent, state)
                tangent.observe(range=reach)
            length = min(1.0, reach)
            if not length > SHORTEST_RANGE:
                raise SolveError(Status.RANGE_EXHAUSTED, f"a_max = {reach:.1e} for a series of order {self.order}")
            size_before, size = size, float(np.linalg.norm(series.coefficient(0)))
            notes = {"range": reach, "length": length}
            if size_before:
                notes["contraction"] = size / size_before
                tangent.observe(contraction=size / size_before)
            state = series.path(length)
            yield Step(state, claim=length == 1.0, notes=notes)

    def _series(self, problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> tuple[Expansion, float]:
        """W_1 … W_p around `state`, and a_max."""
        series = problem.expand(state)
        rhs = -series.coefficient(0)
        sizes = [0.0]
        for j in range(1, self.order + 1):
            if j > 1:
                rhs = rhs - series.coefficient(j - 1)
            w_j = tangent.solve(rhs)
            series.append(w_j)
            sizes.append(float(np.linalg.norm(w_j)))
        if sizes[1] == 0.0:
            return series, np.inf
        if self.order == 2 and sizes[2] <= ROUNDING * sizes[1]:
            raise SolveError(
                Status.RANGE_EXHAUSTED,
                "W_2 vanishes because K* is the tangent here, so a series of order 2 has no range: use order 3 or more",
            )
        last = [j for j in (self.order - 1, self.order) if j > 1 and sizes[j] > 0.0]
        ranges = [(self.tolerance * sizes[1] / sizes[j]) ** (1.0 / (j - 1)) for j in last]
        return series, min(ranges, default=np.inf)


@hookimpl
def nlsolve_components() -> Iterable[type[Component]]:
    return [AsymptoticNumericalMethod]
