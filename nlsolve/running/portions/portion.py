"""Which cases of a study one run is for, and their shards for batch arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass

from nlsolve.contracts.status import STOPPED, Status
from nlsolve.registry.problems import StudyError
from nlsolve.running.portions.condition import LEFT, STATUS, Expression, expression_of
from nlsolve.study.case import Case
from nlsolve.study.study import Study

FAILED = frozenset({Status.CRASHED, *STOPPED})
"""Statuses of cases that have failed."""

SHARD = re.compile(r"\s*(\d{1,9})\s*/\s*(\d{1,9})\s*")

Ending = Callable[[Case], str]
"""How a case ended last: the word of a status, or `LEFT`."""


@dataclass(frozen=True)
class Portion:
    """The cases that a run is for: those of its shard that meet one of `only`, if there are any, and none of `skip`.

    failed : whether only those that have failed are chosen; they are then run again.
    shard : (i, n) for the cases i, i + n, i + 2n, … of the study's order, counted from 1.
    """

    only: tuple[Expression, ...] = ()
    skip: tuple[Expression, ...] = ()
    failed: bool = False
    shard: tuple[int, int] = (1, 1)

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole study."""
        return self == Portion()

    @property
    def retry(self) -> frozenset[Status]:
        """Statuses that are run again because of what is asked for."""
        return FAILED if self.failed else frozenset()

    def cases(self, study: Study, ending: Ending | None) -> list[Case]:
        """The cases of a study that are chosen, in its order.

        ending : None where no folder tells how cases have ended. Raises StudyError when that is asked for.
        """
        asked = self.failed or any(part.name == STATUS for each in (*self.only, *self.skip) for part in each)
        if asked and ending is None:
            raise StudyError("how cases have ended is told by their results folder, and there is none: give out")
        first, step = self.shard
        return [
            case
            for case in study.cases[first - 1 :: step]
            if self._has(case, ending(case) if asked and ending is not None else LEFT)
        ]

    def _has(self, case: Case, word: str) -> bool:
        if self.failed and word not in {status.word for status in FAILED}:
            return False
        chosen, left_out = (
            any(all(part.holds(case, word) for part in each) for each in expressions)
            for expressions in (self.only, self.skip)
        )
        return (chosen or not self.only) and not left_out


def portion_of(
    study: Study, only: str | Collection[str], skip: str | Collection[str], failed: bool, shard: str | None
) -> Portion:
    """The portion of a study that these wishes describe. Raises StudyError for one that no case could ever meet."""
    chosen, left_out = (
        tuple(expression_of(option, text, study.cases) for text in ([given] if isinstance(given, str) else given))
        for option, given in (("only", only), ("skip", skip))
    )
    return Portion(chosen, left_out, failed, (1, 1) if shard is None else _shard(shard))


def _shard(text: str) -> tuple[int, int]:
    found = SHARD.fullmatch(text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise StudyError(f"shard = {text!r}: expected i/n with i from 1 to n, such as 1/3 for the first of three")
    return int(found[1]), int(found[2])
