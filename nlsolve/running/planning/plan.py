"""What a run of a study would do with a results folder: which cases it would compute, why, and how long they take."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.results.verdicts import status_of
from nlsolve.running.engines.choice import jobs_here
from nlsolve.running.forecast import ASSUMPTION, forecast, span_in_lane
from nlsolve.running.planning.outlook import Outlook, outlook_of
from nlsolve.running.portions.condition import LEFT
from nlsolve.running.portions.portion import portion_of
from nlsolve.running.store.parts import Entry, Parts
from nlsolve.running.store.standing import KEPT, Standings
from nlsolve.study.case import Case
from nlsolve.study.study import Study


@dataclass(frozen=True)
class Plan:
    """What a run would do.

    cases : one row for each case that the run is for: its word in `plan` (kept, new, …), its swept parameters, its
        sizes and unit costs, and `seconds_expected`, from its start until it is written [s].
    seconds : how long those to be computed take [s], `jobs` at a time, with the start of a process; in the exclusive
        lane, whose number of rounds is not known before, at least.
    seconds_least, seconds_most : the interval that is to hold it with a probability of nine tenths, NaN where fewer
        than three cases are known; in the exclusive lane at least and at most.
    basis : what the seconds rest on, in words.
    """

    cases: pd.DataFrame
    seconds: float
    seconds_least: float
    seconds_most: float
    jobs: int
    basis: str

    @property
    def left(self) -> pd.DataFrame:
        """The cases that would be computed."""
        return self.cases[self.cases["plan"] != KEPT]


def plan_of(
    study: Study,
    folder: Path,
    retry: Collection[Status] = (),
    only: str | Collection[str] = (),
    skip: str | Collection[str] = (),
    failed: bool = False,
    shard: str | None = None,
    jobs: int | None = None,
) -> Plan:
    """What `run` would do with the same arguments. The folder need not exist, and is not written.

    Raises StudyError as `run` does.
    """
    portion = portion_of(study, only, skip, failed, shard)
    standings = Standings(Parts(folder), study.timing, {*retry, *portion.retry})
    found = {case.id: standings.of(case) for case in study.cases}
    last = {case: standing.last for case, standing in found.items() if standing.last is not None}

    def ending(case: Case) -> str:
        return status_of(last[case.id].measured).word if case.id in last else LEFT

    chosen = study.cases if portion.is_whole else portion.cases(study, ending)
    words = {case: standing.word for case, standing in standings.compared(chosen, found).items()}
    frame = forecast(study)
    outlook = outlook_of(study, frame, last)
    frame["seconds_expected"] = frame["case"].map(outlook.seconds) * study.timing.rounds
    frame.insert(1, "plan", frame["case"].map(words))
    frame = frame[frame["case"].isin(words)].reset_index(drop=True)
    left = list(frame.loc[frame["plan"] != KEPT, "case"])
    at_a_time = min(jobs_here(study.timing, jobs), max(1, len(left)))
    if study.timing.is_exclusive:
        least, most = span_in_lane(study, {case: outlook.seconds(case) for case in left})
        counting = outlook.span(left, at_a_time)[0] if at_a_time > 1 else 0.0
        return Plan(frame, counting + least, counting + least, counting + most, at_a_time, _basis(outlook, last))
    expected, least, most = (study.timing.rounds * seconds for seconds in outlook.span(left, at_a_time))
    return Plan(frame, expected, least, most, at_a_time, _basis(outlook, last))


def _basis(outlook: Outlook, last: Mapping[str, Entry]) -> str:
    """What the seconds of a plan rest on."""
    known = sum(math.isfinite(entry.elapsed) for entry in last.values())
    if not known:
        return ASSUMPTION
    cases = f"{known} case{'' if known == 1 else 's'}"
    spread = f", each within a factor {math.exp(outlook.own.spread):.2g}" if math.isfinite(outlook.own.spread) else ""
    return f"forecast: from the seconds of {cases} of this study in the folder, by what is swept{spread}"
