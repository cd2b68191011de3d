"""Rounds: how often a case has been timed, the median of its rounds, and when a comparison needs no further round.

Cases that differ in method only are compared, and a ratio of their seconds means something if both have met the same
conditions: they take part in the same rounds, and all of them drop out together.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy  # loads scipy.special when the first interval is asked for

from nlsolve.results.columns import is_timed
from nlsolve.results.costs.cost_prediction import UNITS
from nlsolve.results.costs.lanes import EXCLUSIVE, half_width
from nlsolve.results.frames import Part, Row
from nlsolve.results.verdicts import AT_A_SOLUTION, Run, number, status_of
from nlsolve.running.retry import is_final
from nlsolve.study.case import Case
from nlsolve.study.timing import Timing

CONFIDENCE = 0.95
"""Probability with which the interval of a median holds the median, at least."""

FEWEST = 6
"""Rounds from which on there is such an interval."""


def interval(seconds: Sequence[float]) -> tuple[float, float]:
    """P(x₍ₖ₎ ≤ m ≤ x₍ₙ₊₁₋ₖ₎) = 1 − 2 P(B < k) ≥ CONFIDENCE, B binomial (n, ½), with the largest such k.

    How many of n rounds lie below the median m is binomial whatever their distribution (David & Nagaraja 2003, section
    7.1). NaN for fewer than FEWEST rounds.
    """
    n, ordered = len(seconds), sorted(seconds)
    k = int(np.sum(2.0 * scipy.special.bdtr(np.arange(n), n, 0.5) <= 1.0 - CONFIDENCE))
    return (ordered[k - 1], ordered[n - k]) if k else (np.nan, np.nan)


def rounds_of(run: Run, timing: Timing) -> int:
    """Number of rounds in which a case has been timed as the study asks; 0 for a case that crashed.

    What the exclusive lane has timed counts for a study that does not ask for it too.
    """
    known, units = number(run.get("rounds")), UNITS[0] in run or not timing.calibrate
    if not (known > 0 and units and run.get("clock") == timing.clock):
        return 0
    if run.get("lane") == EXCLUSIVE:
        return int(known) if timing.is_exclusive else max(int(known), timing.rounds)
    return 0 if timing.is_exclusive else int(known)


def is_compared(run: Run, timing: Timing) -> bool:
    """Whether a case takes part in the rounds of its comparison: it has arrived, and has been timed so far as asked."""
    return status_of(run) in AT_A_SOLUTION and rounds_of(run, timing) > 0


def has_rounds(run: Run, timing: Timing) -> bool:
    """Whether a case has the rounds that the study asks for at least, or needs none."""
    needless = is_final(run) or (timing.is_exclusive and status_of(run) not in AT_A_SOLUTION)
    return needless or rounds_of(run, timing) >= timing.rounds


def is_over(runs: Sequence[Run], timing: Timing) -> bool:
    """Whether cases of one comparison, in the exclusive lane, need no further round.

    They have had the same rounds, and every interval is tight, or the budget of rounds or seconds (operators, start
    and method, by the study's clock) is spent.
    """
    counts = {rounds_of(run, timing) for run in runs}
    if not counts:
        return True
    rounds = min(counts)
    if len(counts) > 1 or rounds < timing.rounds:
        return False
    spent = rounds * sum(number(run.get("seconds_all")) for run in runs)
    tight = all(half_width(run) <= timing.precision for run in runs)
    return tight or rounds >= timing.most_rounds or spent >= timing.seconds


def comparisons(cases: Iterable[Case]) -> list[list[Case]]:
    """The cases that differ in method only, together."""
    found: dict[str, list[Case]] = {}
    for case in cases:
        found.setdefault(case.problem, []).append(case)
    return list(found.values())


def span_of(seconds: float, timing: Timing) -> tuple[float, float]:
    """How long a comparison takes in the exclusive lane, at least and at most, with the run that warms each case [s].

    seconds : of one round.
    """
    longest = max(timing.rounds * seconds, min(timing.most_rounds * seconds, timing.seconds + seconds))
    return min(max(timing.rounds, FEWEST) * seconds, longest) + seconds, longest + seconds


def measured_in(run: Run) -> Row:
    """What a round has measured: the columns of a row that were read from a clock, and the load."""
    return {name: value for name, value in run.items() if is_timed(name) or name == "load"}


def median(rounds: Sequence[Mapping[str, Any]]) -> Row:
    """Columns of `runs` for several rounds: those of the round of the (lower) median of `seconds`, and its interval."""
    seconds = [float(measured["seconds"]) for measured in rounds]
    low, high = interval(seconds)
    return {
        **rounds[seconds.index(statistics.median_low(seconds))],
        "seconds_low": low,
        "seconds_high": high,
        "seconds_most": max(seconds),
        "rounds": len(rounds),
        "load": float(np.median([number(measured["load"]) for measured in rounds])),
    }


def with_round(before: Part | None, again: Part, timing: Timing) -> Part:
    """The last round of a case with the medians of all; as it is if it does not count or is the first to count."""
    if not is_compared(again.run, timing):
        return again
    earlier = before.rounds if before is not None and is_compared(before.run, timing) else ()
    rounds = (*earlier, *again.rounds)
    return replace(again, run={**again.run, **median(rounds)}, rounds=rounds)


def without_rounds(part: Part) -> Part:
    """A part whose rounds do not count any more."""
    return replace(part, run={**part.run, "rounds": 0}, rounds=())
