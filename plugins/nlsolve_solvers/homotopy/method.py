"""W(a) = a W_1 + … + a^p W_p along a homotopy from a solved problem to G(W) = 0 : the asymptotic numerical method.

Timesli, Braikat, Lahmam, Zahrouni (2015), after Jamal, Braikat, Boutmir, Damil, Potier-Ferry (2002).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from nlsolve.plugin import (
    AnyForm,
    AnyRange,
    KeptTangent,
    NonlinearProblem,
    NonlinearSolver,
    Range,
    SolveError,
    Status,
    Step,
)
from nlsolve_solvers.homotopy.branch import Branch, BranchView

ROUNDING = 1e-10  # W_2 below this part of W_1 is rounding: K* is the tangent
SHORTEST_RANGE = 1e-6  # a series that advances no more than this part of its path is exhausted
LOOSEST = 0.1  # η where little residual is left: a series must still gain a digit
END = "end of path"
FIRST_CHECK = 3  # terms before an adaptive series asks for its range: W_2 may vanish


class AsymptoticNumericalMethod(NonlinearSolver):
    """K* W_j = r_j for j = 1 … p, one kept K* for all orders; then a state W(a), a ≤ min(1, a_max).

    Choices, each independent of the others: the form of the homotopy (and so of r_j), how W(a) is made of the W_j, the
    rule for its range a_max, whether p is a number or found as the series goes, whether η is a number or what a wanted
    residual asks for, and Newton corrections at the end of the path.
    a_max ≥ 1: W(1) is the solution and K* is kept. a_max < 1 is a choice, `short_range`:

        renew     the refresh rule may renew K* here, and the series is computed again; where K* is new already, or is
                  kept, the state advances to W(a_max) and a branch begins there
        advance   the state advances to W(a_max) with the K* there is, and a branch begins there, where the refresh rule
                  may renew K*
        accept    the state is W(1) and claimed to be the solution all the same; the refresh rule may renew K* at the
                  next increment, or where the next branch begins if the stopping test does not take the claim

    The wording of the 2015 paper allows `advance` and `accept`. A series without any range is never used: the refresh
    rule may renew K* at once, whatever the choice. Each branch that is used says what limited its range (`limited_by`
    in `steps`), and by which quantity and threshold its range rule decided (`range_quantity`, `range_threshold`).
    The defaults are the method of the 2015 paper, but its range looks at two terms (`ratio`) instead of one
    (`last-term`), and a range below 1 renews K* at once.

    An adaptive series stops at the first order with a_max ≥ 1, or where one more order costs more, by the range it
    adds, than a new branch does: in units of one order a branch of p orders costs c + p and advances a_max, so where

        a_max(p)/a_max(p − 1) < 1 + 1/(c + p)          (the mean growth over the last two orders)

    the least cost of a unit of path, (c + p)/a_max(p), has been passed.
    """

    kind: Literal["anm"] = "anm"
    order: int = Field(20, ge=2, description="p, order of the series; the highest one where it is adaptive")
    tolerance: float = Field(
        1e-6,
        gt=0,
        description="η: last term over the first (ratio, last-term), residual left over the first (residual rules), "
        "difference over the value (pade-pair), (1/ρ)^p with ρ the nearest pole",
    )
    form: AnyForm = Field(  # type: ignore[assignment]
        {"kind": "fixed-point"},
        description="(1 − a) K* W + a G(W) = 0 (fixed-point), or G(W) = (1 − a) (G(0) + (J − K*) W) (newton)",
    )
    extrapolation: Literal["series", "pade", "gram-schmidt-pade"] = Field(
        "series", description="how W(a) is made of its Taylor coefficients"
    )
    range: AnyRange = Field(  # type: ignore[assignment]
        {"kind": "ratio"}, description="what limits a_max: a range rule"
    )
    short_range: Literal["renew", "advance", "accept"] = Field(
        "renew", description="a_max < 1: renew K* and compute the series again, go on from W(a_max), or accept W(1)"
    )
    adaptive: bool = Field(
        False, description="stop adding orders, from the third on, as soon as a_max ≥ 1 or a new branch is cheaper"
    )
    branch_cost: float = Field(
        40.0, ge=0, description="c, cost of a new K* over that of an order of an adaptive series: factor_solve_ratio"
    )
    residual: float | None = Field(
        None, gt=0, description="relative residual wanted at the end of a path; it sets η in the place of `tolerance`"
    )
    corrections: int = Field(0, ge=0, description="Newton corrections with K* at the end of a path")
    default_refresh: ClassVar = {"kind": "range-under-one"}
    claims: ClassVar[bool] = True
    uses_operator: ClassVar[bool] = True

    def steps(self, problem: NonlinearProblem, tangent: KeptTangent, start: np.ndarray) -> Iterator[Step]:
        """The start, the ends of the branches, and their corrections. Raises SolveError (range exhausted)."""
        state = start
        goal = None if self.residual is None else self.residual * problem.scale(start)
        yield Step(state)
        while True:
            fresh = tangent.refresh_if_due(lambda: problem.operator(state))
            branch, found, limit = self._branch(problem, tangent, state, goal)
            is_short = not (found.a_max >= 1.0 if self.short_range == "renew" else found.a_max > SHORTEST_RANGE)
            if is_short and not fresh and tangent.refresh_if_due(lambda: problem.operator(state)):
                branch, found, limit = self._branch(problem, tangent, state, goal)
            if not found.a_max > SHORTEST_RANGE:
                raise self._exhausted(branch, found)
            length = 1.0 if self.short_range == "accept" else min(1.0, found.a_max)
            notes: dict[str, float | str] = {
                "range": found.a_max,
                "range_quantity": found.quantity,
                "range_threshold": found.threshold,
                "length": length,
                "limited_by": limit,
                "singularity": branch.singularity,
                "contraction": branch.contraction,
            }
            state = state + branch.increment(length)
            yield Step(state, claim=length == 1.0, notes=notes)
            for _ in range(self.corrections if length == 1.0 else 0):
                state = state - tangent.solve(problem.residual(state))
                yield Step(state, claim=True)

    def _branch(
        self, problem: NonlinearProblem, tangent: KeptTangent, state: np.ndarray, goal: float | None
    ) -> tuple[Branch, Range, str]:
        """W_1 … W_p around `state`, a_max, and what limited it. The refresh rule is told a_max, and the contraction per
        order, which is what K* decides.
        """
        branch = Branch(problem, state, self.form, self.extrapolation)
        view, ranges = BranchView(branch), list[Range]()
        limit = self.range.kind_name()
        for j in range(1, self.order + 1):
            rhs = branch.recurrence.right_hand_side()
            branch.append(rhs, tangent.solve(rhs))
            if branch.sizes[0] == 0.0:
                ranges.append(Range(np.inf))
                break
            if self.adaptive and FIRST_CHECK <= j < self.order:
                ranges.append(self.range.limit(view, self._tolerance(branch, goal), False))
                if ranges[-1].a_max >= 1.0:
                    break
                if self._is_dear([one.a_max for one in ranges], j):
                    limit = "cost"
                    break
        if not (ranges and ranges[-1].a_max >= 1.0):
            if self.order == 2 and branch.sizes[1] <= ROUNDING * branch.sizes[0]:
                raise SolveError(
                    Status.RANGE_EXHAUSTED,
                    "W_2 vanishes because K* is the tangent here, so a series of order 2 has no range: "
                    "use order 3 or more",
                )
            ranges.append(self.range.limit(view, self._tolerance(branch, goal), True))
        found = ranges[-1]
        tangent.observe(range=found.a_max if found.a_max >= 0.0 else 0.0, contraction=branch.contraction)
        if found.a_max >= 1.0:
            return branch, found, END
        if self.adaptive and branch.order == self.order:
            limit = "order"
        return branch, found, "pole" if branch.has_pole() else limit

    def _exhausted(self, branch: Branch, found: Range) -> SolveError:
        """The error of a series that has no range, or of a rule whose answer is no range."""
        if found.a_max >= 0.0:
            nearest = f"its nearest singularity is about {branch.singularity:.1e} of the path away"
            sentence = f"a_max = {found.a_max:.1e} for a series of order {branch.order}; {nearest}"
        else:
            sentence = (
                f"the range rule {self.range.kind_name()!r} gave a_max = {found.a_max:.1e} for a series of order "
                f"{branch.order}, where a range is positive or infinite: correct the rule "
                "(nlsolve.testing.check_range_rule), choose another, or lower the order if its terms overflow"
            )
        return SolveError(Status.RANGE_EXHAUSTED, sentence)

    def _tolerance(self, branch: Branch, goal: float | None) -> float:
        """η: as given, or the part of ‖G(0)‖ that a wanted residual leaves."""
        if goal is None:
            return self.tolerance
        return goal / branch.residual if goal < LOOSEST * branch.residual else LOOSEST

    def _is_dear(self, reaches: list[float], p: int) -> bool:
        """Whether the order p added less range than a new branch of p orders would, at the price of an order."""
        if len(reaches) < 3 or not reaches[-3] > 0.0:
            return False
        growth = np.sqrt(reaches[-1] / reaches[-3])
        return bool(growth < 1.0 + 1.0 / (self.branch_cost + p))
