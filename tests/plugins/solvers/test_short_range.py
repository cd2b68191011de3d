"""a_max < 1: the homotopy renews K* at once, goes on from W(a_max), or accepts W(1) all the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import setup
from nlsolve_rules.refresh import Never, RangeUnderOne
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers.homotopy import AsymptoticNumericalMethod
from pydantic import ValidationError

from nlsolve import Outcome, Status
from nlsolve.plugin import NodeMotion, RefreshRule, TimeSteps
from nlsolve.solving.driver import solve
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.tangent import Tangent
from nlsolve.solving.work.ledger import Ledger
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

Method = AsymptoticNumericalMethod
CHOICES = ("renew", "advance", "accept")
START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
RESIDUAL, CLAIM = StoppingTest(tolerance=1e-9), StoppingTest(kind="claim")


def from_an_old_tangent(
    choice: Any, stop: StoppingTest, rule: RefreshRule | None = None, tolerance: float = 1e-4
) -> tuple[Outcome, list[tuple[int, float, float]], int]:
    """The toy problem with a K* of another state: its outcome; tangents so far, a_max and length of each branch that
    was used; and the series that were computed.
    """
    problem, ledger = ToyProblem(), Ledger()
    tangent = Tangent(DenseLU(), rule or RangeUnderOne(), ledger)
    tangent.refresh_if_due(lambda: problem.jacobian(START - 1.0))
    solver = Method(order=6, tolerance=tolerance, short_range=choice)
    outcome = solve(problem, solver, tangent, START, stop, Budget(), ledger)
    branches = [(row["tangents"], row["range"], row["length"]) for row in outcome.rows[1:]]
    return outcome, branches, ledger.counts["triangular_solve"] // 6


def test_renewing_throws_the_series_of_the_old_tangent_away() -> None:
    outcome, branches, series = from_an_old_tangent("renew", RESIDUAL)
    assert outcome.status is Status.CONVERGED
    assert [tangents for tangents, _, _ in branches] == [2, 3, 4, 5, 6, 6]
    assert series == len(branches) + 1
    assert all(length == min(1.0, reach) for _, reach, length in branches)


def test_advancing_uses_it_and_the_rule_renews_at_the_next_branch() -> None:
    outcome, branches, series = from_an_old_tangent("advance", RESIDUAL)
    assert outcome.status is Status.CONVERGED
    assert [tangents for tangents, _, _ in branches] == [1, 2, 3, 4, 5, 5]
    assert series == len(branches)
    assert all(length == min(1.0, reach) for _, reach, length in branches)
    assert branches[0][1] < 1.0


def test_advancing_keeps_a_tangent_that_the_rule_does_not_renew() -> None:
    _, branches, _ = from_an_old_tangent("advance", StoppingTest(tolerance=1e-3), Never())
    assert {tangents for tangents, _, _ in branches} == {1}
    assert all(length == reach < 1.0 for _, reach, length in branches)


def test_accepting_ends_the_path_at_its_first_series_and_is_caught_when_that_is_wrong() -> None:
    """A test that takes the claim ends there, at a residual of 0.13; a test of residuals goes on, with a new K*."""
    outcome, branches, series = from_an_old_tangent("accept", CLAIM)
    assert outcome.status is Status.CONVERGED
    assert outcome.claimed_wrongly
    assert outcome.residual_norm > 0.1
    assert len(branches) == series == 1
    tangents, reach, length = branches[0]
    assert tangents == length == 1
    assert reach < 1.0
    outcome, branches, _ = from_an_old_tangent("accept", RESIDUAL)
    assert outcome.claimed_wrongly
    assert outcome.residual_norm <= 1e-9
    assert [tangents for tangents, _, _ in branches] == [1, 2, 2]
    assert outcome.rows[1]["limited_by"] == "ratio"


@pytest.mark.parametrize("choice", CHOICES)
def test_a_series_without_any_range_is_not_used(choice: Any) -> None:
    """With an old K* it is renewed once; with a new one the solve ends."""
    outcome, branches, series = from_an_old_tangent(choice, CLAIM, tolerance=1e-60)
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert branches == []
    assert series == 2
    np.testing.assert_array_equal(outcome.state, START)


@pytest.mark.parametrize("choice", CHOICES)
def test_a_march_by_each_choice(choice: Any) -> None:
    """Three increments of 4e-3 s of the spin at n = 0.1324, too long for one series each: what is counted, and where it
    ends. Only `accept` claims states that are no solutions, and each such increment is counted.
    """
    time = TimeSteps(horizon=12e-3, increment=4e-3)
    case = setup(
        StirringTool(nodes=Rings(spacing=0.5)),
        0.1324,
        time=time,
        motion=NodeMotion(nodes="lagrangian"),
        solver=Method(order=8, short_range=choice),
        refresh=RangeUnderOne(),
        stop=CLAIM,
    )
    row = march(case).summary
    assert row["status"] == "converged"
    assert row["increments"] == 3
    used, series = row["iterations"], row["triangular_solves"] // 8
    if choice == "renew":  # a series that is thrown away is counted, and is no iteration
        assert series > used
        assert row["tangents"] == used
    elif choice == "advance":
        assert series == used
        assert row["tangents"] < used
    else:
        assert series == used == 3  # one series an increment, whatever its range
        assert row["tangents"] == 3
    assert row["false_convergence"] == (3 if choice == "accept" else 0)
    assert (row["residual_norm"] > 1e-6) == (choice == "accept")


def test_another_choice_is_refused() -> None:
    with pytest.raises(ValidationError, match="short_range"):
        Method(short_range="halve")  # type: ignore[arg-type]
