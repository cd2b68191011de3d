"""The median of rounds, its interval, and when a comparison needs no further round."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from nlsolve.results.frames import Part
from nlsolve.running.timing.rounds import (
    CONFIDENCE,
    FEWEST,
    comparisons,
    has_rounds,
    interval,
    is_compared,
    is_over,
    median,
    rounds_of,
    span_of,
    with_round,
    without_rounds,
)
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing

EXCLUSIVE = Timing(lane="exclusive")

RANKS = {
    6: (1, 6),
    8: (1, 8),
    9: (2, 8),
    11: (2, 10),
    12: (3, 10),
    15: (4, 12),
    17: (5, 13),
    20: (6, 15),
    25: (8, 18),
    30: (10, 21),
    50: (18, 33),
    100: (40, 61),
}
"""n -> ranks of the interval of the median at 95 %, as tables of the sign test have them."""


def row(rounds: int = 10, half_width: float = 0.01, seconds: float = 1.0, **columns: Any) -> dict[str, Any]:
    low, high = (seconds * (1.0 + sign * half_width) for sign in (-1, 1))
    measured = {"seconds": seconds, "seconds_low": low, "seconds_high": high, "seconds_all": 2.0 * seconds}
    told = {"status": "converged", "clock": "processor", "lane": "exclusive", "rounds": rounds}
    return {**told, **measured, **columns}


def part(seconds: float, load: float = 0.0, **columns: Any) -> Part:
    """The part of one run in the exclusive lane."""
    measured = {"seconds": seconds, "seconds_jacobian": seconds / 2, "load": load}
    run = {"status": "converged", "clock": "processor", "lane": "exclusive", "rounds": 1, **measured, **columns}
    return Part(run, pd.DataFrame(), pd.DataFrame(), rounds=(measured,))


@pytest.mark.parametrize("n", RANKS)
def test_the_interval_is_that_of_the_tables(n: int) -> None:
    seconds = np.random.default_rng(n).permutation(np.arange(1.0, n + 1.0))
    assert interval(seconds.tolist()) == RANKS[n]


def test_there_is_no_interval_of_too_few_rounds() -> None:
    assert all(math.isnan(end) for n in range(1, FEWEST) for end in interval([1.0] * n))
    assert interval([1.0] * FEWEST) == (1.0, 1.0)


@pytest.mark.parametrize("n", [6, 9, 17, 30])
@pytest.mark.parametrize("draw", ["lognormal", "exponential", "standard_cauchy"])
def test_the_interval_holds_the_median_as_often_as_it_says(n: int, draw: str) -> None:
    """Whatever the distribution; 3 standard deviations of the count are allowed."""
    times = 4000
    samples = getattr(np.random.default_rng(7), draw)(size=(times, n))
    middle = {"lognormal": 1.0, "exponential": math.log(2.0), "standard_cauchy": 0.0}[draw]
    held = sum(low <= middle <= high for low, high in map(interval, samples.tolist()))
    assert held / times > CONFIDENCE - 3.0 * math.sqrt(CONFIDENCE * (1.0 - CONFIDENCE) / times)


@pytest.mark.parametrize("deviation", [0.01, 0.03, 0.06])
def test_rounds_that_end_when_the_interval_is_narrow_cost_it_little(deviation: float) -> None:
    """An interval looked at after each round holds the median less often than one of a number set before."""
    times, held, random = 1000, 0, np.random.default_rng(1)
    for _ in range(times):
        seconds: list[float] = []
        low = high = math.nan
        while len(seconds) < EXCLUSIVE.most_rounds and not (high - low) / 2.0 <= EXCLUSIVE.precision:
            seconds.append(float(random.lognormal(0.0, deviation)))
            low, high = interval(seconds)
        held += low <= 1.0 <= high
    assert held / times > 0.93


def test_the_seconds_are_those_of_the_round_in_the_middle() -> None:
    rounds = [{"seconds": s, "seconds_own": 10 * s, "load": load} for s, load in ((3.0, 0.0), (1.0, 0.5), (2.0, 0.2))]
    found = median(rounds)
    assert (found["seconds"], found["seconds_own"], found["seconds_most"]) == (2.0, 20.0, 3.0)
    assert (found["rounds"], found["load"]) == (3, 0.2)
    assert math.isnan(found["seconds_low"])
    even = median([*rounds, {"seconds": 4.0, "seconds_own": 40.0, "load": 0.3}])
    assert (even["seconds"], even["seconds_own"]) == (2.0, 20.0), "the lower of the two in the middle"
    many = median([{"seconds": float(s), "load": 0.0} for s in range(9, 0, -1)])
    assert (many["seconds_low"], many["seconds"], many["seconds_high"]) == (2.0, 5.0, 8.0)


def test_rounds_are_put_together_one_by_one() -> None:
    found = with_round(None, part(2.0), EXCLUSIVE)
    for seconds in (4.0, 1.0, 3.0, 5.0, 6.0):
        found = with_round(found, part(seconds, tangents=int(seconds)), EXCLUSIVE)
    assert [measured["seconds"] for measured in found.rounds] == [2.0, 4.0, 1.0, 3.0, 5.0, 6.0]
    run = found.run
    assert (run["seconds"], run["seconds_jacobian"], run["rounds"]) == (3.0, 1.5, 6)
    assert (run["seconds_low"], run["seconds_high"], run["seconds_most"]) == (1.0, 6.0, 6.0)
    assert run["tangents"] == 6, "all else is of the last round"
    assert with_round(without_rounds(found), part(7.0), EXCLUSIVE).run["rounds"] == 1


@pytest.mark.parametrize("columns", [{"status": "crashed"}, {"status": "diverged"}, {"lane": "alone"}])
def test_a_run_that_cannot_be_timed_stands_as_it_is(columns: dict[str, Any]) -> None:
    before, again = with_round(None, part(2.0), EXCLUSIVE), part(1.0, **columns)
    assert with_round(before, again, EXCLUSIVE) is again
    assert with_round(again, part(3.0), EXCLUSIVE).run["rounds"] == 1, "nor does it count later"


def test_which_rounds_count() -> None:
    assert rounds_of(row(rounds=7), EXCLUSIVE) == 7
    assert rounds_of(row(lane="alone"), EXCLUSIVE) == 0
    assert rounds_of(row(clock="wall"), EXCLUSIVE) == 0
    assert rounds_of(row(), Timing(lane="exclusive", calibrate=True)) == 0
    assert rounds_of(row(lane="shared", rounds=2), Timing(rounds=5)) == 2
    assert rounds_of(row(rounds=2), Timing(rounds=5)) == 5, "better than asked for"
    assert rounds_of({"status": "crashed"}, EXCLUSIVE) == 0


def test_only_a_case_that_has_arrived_is_timed() -> None:
    assert is_compared(row(), EXCLUSIVE)
    assert not is_compared(row(status="budget spent"), EXCLUSIVE)
    assert has_rounds(row(status="budget spent", lane="shared"), EXCLUSIVE)
    assert not has_rounds(row(lane="shared"), EXCLUSIVE)
    assert not has_rounds(row(rounds=3), Timing(lane="exclusive", rounds=4))
    assert has_rounds(row(status="timed out"), Timing(rounds=4))


def test_a_comparison_is_over_when_all_of_it_is_certain() -> None:
    assert is_over([], EXCLUSIVE)
    assert is_over([row(), row(half_width=0.029)], EXCLUSIVE)
    assert not is_over([row(), row(half_width=0.031)], EXCLUSIVE)
    assert not is_over([row(half_width=math.nan)], EXCLUSIVE)
    assert not is_over([row(), row(rounds=11)], EXCLUSIVE), "both have the same rounds"
    assert not is_over([row()], Timing(lane="exclusive", rounds=11))


def test_a_comparison_is_over_when_its_budget_is_spent() -> None:
    wide = [row(half_width=0.5), row(half_width=0.5)]
    assert not is_over(wide, Timing(lane="exclusive", most_rounds=11, seconds=41.0))
    assert is_over(wide, Timing(lane="exclusive", most_rounds=10))
    assert is_over(wide, Timing(lane="exclusive", seconds=40.0)), "10 rounds of two cases of 2 s"
    assert not is_over(wide, Timing(lane="exclusive", seconds=40.0, rounds=11)), "the fewest rounds come first"


def test_the_span_of_a_comparison() -> None:
    assert span_of(2.0, EXCLUSIVE) == (14.0, 62.0), "6 rounds or 30, and one that warms"
    assert span_of(2.0, Timing(lane="exclusive", seconds=20.0)) == (14.0, 24.0)
    assert span_of(200.0, Timing(lane="exclusive", seconds=20.0)) == (420.0, 420.0), "one round, and one more begins"
    assert span_of(1.0, Timing(lane="exclusive", rounds=40, most_rounds=40)) == (41.0, 41.0)


def test_cases_that_differ_in_method_only_are_compared() -> None:
    study = Study.from_dict(
        {
            "question": "?",
            "scene": {"kind": "published", "problem": "powell-singular"},
            "sweep": [
                {"grid": {"scene.problem": ["powell-singular", "extended-rosenbrock"]}},
                {"grid": {"solver.kind": ["newton", "broyden"]}},
            ],
        }
    )
    found = [[case.parameters["solver.kind"] for case in members] for members in comparisons(study.cases)]
    assert found == [["newton", "broyden"]] * 2
