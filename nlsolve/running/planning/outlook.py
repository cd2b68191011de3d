"""How long what is left of a study takes: the cases themselves, the ways that they share, and the start of a process.

A case that has been run tells how long it took from its start until it was written. What it waited for its process,
and the way to its first state where others take it, come once a run and are told apart. The first case of a process
also pays for what is loaded when it is first used; that belongs to the start.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import pandas as pd

from nlsolve.results.verdicts import number
from nlsolve.running.planning.experience import OVERHEAD, Expectation, expectation
from nlsolve.running.store.parts import Entry
from nlsolve.study.study import Study

STARTUP = 1.2
"""Seconds until a worker process is ready, where none has been started yet [s]."""


@dataclass(frozen=True)
class Outlook:
    """What is expected of the cases of a study.

    own : without the ways to their first states.
    ways : case -> seconds of the way that it solves for others too [s].
    startup : seconds until a process is ready [s].
    """

    own: Expectation
    ways: Mapping[str, float]
    startup: float

    def seconds(self, case: str) -> float:
        """From the start of a case until it is written [s]."""
        return self.own.seconds[case] + self.ways.get(case, 0.0)

    def span(self, cases: Collection[str], jobs: int) -> tuple[float, float, float]:
        """How long cases take, `jobs` at a time: expected, at least, and at most, with the confidence that the factor
        of `Expectation` has [s]; the two are NaN where too few cases are known."""
        if not cases:
            return 0.0, 0.0, 0.0
        longest = max(self.seconds(case) for case in cases)
        work = max(sum(self.seconds(case) for case in cases) / jobs, longest)
        return self.startup + work, self.startup + work / self.own.factor, self.startup + work * self.own.factor


def outlook_of(study: Study, costs: pd.DataFrame, last: Mapping[str, Entry]) -> Outlook:
    """What is expected of the cases of a study.

    costs : the forecast from unit costs; see `nlsolve.running.forecast`.
    last : case -> how it ended last, of those that have been run.
    """
    count = Counter(case.way_id for case in study.cases if case.way_id)
    shared = {case.id: case.way_id for case in study.cases if count[case.way_id] > 1}
    way_costs: Mapping[str, float] = dict(zip(costs["case"], costs["seconds_start"], strict=True))
    work = {
        case: whole - (way_costs[case] if case in shared else 0.0)
        for case, whole in zip(costs["case"], costs["seconds_all"], strict=True)
    }
    timed = {case: entry for case, entry in last.items() if math.isfinite(entry.elapsed)}
    taken = {case: _own(entry, case in shared) for case, entry in timed.items()}
    later = {case: seconds for case, seconds in taken.items() if not timed[case].startup}
    own = expectation(study.cases, work, later or taken)
    return Outlook(own, _ways_left(study, shared, way_costs, timed), _startup(own, shared, timed))


def _own(entry: Entry, shares: bool) -> float:
    """Seconds of a case for itself; of the first of a process those of its work, without what it has loaded [s]."""
    own = entry.elapsed - (entry.way if shares else 0.0)
    work = number(entry.measured.get("seconds_all"))
    if shares:
        work -= max(0.0, number(entry.measured.get("seconds_start")))
    return min(own, work + OVERHEAD) if entry.startup and math.isfinite(work) else own


def _ways_left(
    study: Study, shared: Mapping[str, str], costs: Mapping[str, float], timed: Mapping[str, Entry]
) -> dict[str, float]:
    """Case -> seconds of the way that it will solve [s]: the first of those that share one that no known case has."""
    solved = [case for case in timed if case in shared and timed[case].way > 0.0 and costs[case] > 0.0]
    ratio = sum(timed[case].way for case in solved) / sum(costs[case] for case in solved) if solved else 1.0
    done = {shared[case] for case in timed if case in shared}
    found: dict[str, float] = {}
    for case in study.cases:
        if case.id in shared and case.way_id not in done:
            found[case.id] = ratio * costs[case.id]
            done.add(case.way_id)
    return found


def _startup(own: Expectation, shared: Collection[str], timed: Mapping[str, Entry]) -> float:
    """Seconds until a process is ready, with what its first case took longer than is expected of it [s]."""
    first = [case for case, entry in timed.items() if entry.startup]
    if not first:
        return 0.0 if timed else STARTUP
    whole = 0.0
    for case in first:
        entry = timed[case]
        loading = entry.elapsed - (entry.way if case in shared else 0.0) - own.seconds[case]
        whole += entry.startup + max(loading, 0.0)
    return whole / len(first)
