"""W(a) = a W_1 + … + a^p W_p along a homotopy from a solved problem to G(W) = 0 : the asymptotic numerical method.

Timesli, Braikat, Lahmam, Zahrouni (2015), after Jamal, Braikat, Boutmir, Damil, Potier-Ferry (2002).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve import KeptTangent, NonlinearProblem, NonlinearSolver, SolveError, Status, Step
from nlsolve_homotopy.branch import Branch
from nlsolve_homotopy.ranges import RULES

ROUNDING = 1e-10  # W_2 below this part of W_1 is rounding: K* is the tangent
SHORTEST_RANGE = 1e-6  # a series that advances less than this part of its path is exhausted
FIRST_CHECK = 3  # terms before an adaptive series asks for its range: W_2 may vanish


class AsymptoticNumericalMethod(NonlinearSolver):
    """K* W_j = r_j for j = 1 … p, one kept K* for all orders; then a state W(a), a ≤ min(1, a_max).

    Five choices, each alone: the form of the homotopy (and so of r_j), how W(a) is made of the W_j, the rule for its
    range a_max, whether p is a number or the most that may be needed, and Newton corrections at the end of the path.
    a_max ≥ 1: W(1) is the solution and K* is kept. a_max < 1: the refresh rule may renew K* here and the series is
    computed again; with a K* that is already new, the state advances to W(a_max) and a branch begins there.
    The defaults are the method of the 2015 paper, its range guarded.
    """

    kind: Literal["anm"] = "anm"
    order: int = Field(20, ge=2, description="p, order of the series; the highest one where it is adaptive")
    tolerance: float = Field(
        1e-6,
        gt=0,
        description="η: largest last term over the first (ratio), residual left over the first (residual rules), "
        "difference over the value (pade-pair), (1/ρ)^p with ρ the nearest pole",
    )
    form: Literal["fixed-point", "newton"] = Field(
        "fixed-point", description="(1 − a) K* W + a G(W) = 0, or G(W) = (1 − a) (G(0) + (J − K*) W)"
    )
    extrapolation: Literal["series", "pade", "gram-schmidt-pade"] = Field(
        "series", description="how W(a) is made of its Taylor coefficients"
    )
    range: Literal["ratio", "residual-coefficient", "true-residual", "pade-pair", "nearest-pole"] = Field(
        "ratio", description="what limits a_max"
    )
    adaptive: bool = Field(False, description="stop adding orders, from the third on, as soon as a_max ≥ 1")
    corrections: int = Field(0, ge=0, description="Newton corrections with K* at the end of a path")
    default_refresh: ClassVar = {"kind": "range-under-one"}
    claims: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The ends of the branches, and of their corrections."""
        state, size = start, 0.0
        yield Step(state)
        while True:
            fresh = tangent.refresh_if_due(problem, state)
            branch, reach = self._branch(problem, tangent, state)
            if reach < 1.0 and not fresh and tangent.refresh_if_due(problem, state):
                branch, reach = self._branch(problem, tangent, state)
            length = min(1.0, reach)
            if not length > SHORTEST_RANGE:
                raise SolveError(Status.RANGE_EXHAUSTED, f"a_max = {reach:.1e} for a series of order {branch.order}")
            notes = {"range": reach, "length": length}
            if size:
                notes["contraction"] = branch.residual / size
                tangent.observe(contraction=branch.residual / size)
            size = branch.residual
            state = state + branch.increment(length)
            yield Step(state, claim=length == 1.0, notes=notes)
            for _ in range(self.corrections if length == 1.0 else 0):
                state = state - tangent.solve(problem.residual(state))
                yield Step(state, claim=True)

    def _branch(self, problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray) -> tuple[Branch, float]:
        """W_1 … W_p around `state`, and a_max, which the refresh rule is told."""
        branch, rule = Branch(problem, state, self.form, self.extrapolation), RULES[self.range]
        reach = np.inf
        for j in range(1, self.order + 1):
            rhs = branch.recurrence.right_hand_side()
            branch.append(rhs, tangent.solve(rhs))
            if branch.sizes[0] == 0.0:
                break
            if (
                self.adaptive
                and FIRST_CHECK <= j < self.order
                and (reach := rule(branch, self.tolerance, False)) >= 1.0
            ):
                break
        else:
            if self.order == 2 and branch.sizes[1] <= ROUNDING * branch.sizes[0]:
                raise SolveError(
                    Status.RANGE_EXHAUSTED,
                    "W_2 vanishes because K* is the tangent here, so a series of order 2 has no range: "
                    "use order 3 or more",
                )
            reach = rule(branch, self.tolerance, True)
        reach = 0.0 if np.isnan(reach) else reach
        tangent.observe(range=reach)
        return branch, reach
