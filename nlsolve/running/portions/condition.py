"""The conditions of --only and --skip: `solver.kind=anm and solver.order=2*`, a status, or the id of a case."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from nlsolve.contracts.status import Status
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.columns import no_such_column
from nlsolve.results.selection import same
from nlsolve.study.case import Case

AND = " and "
"""Joins conditions that must all hold."""

STATUS, CASE = "status", "case"
"""Names in a condition that are no parameters."""

LEFT = "left"
"""The status of a case that has not ended yet."""

ENDINGS = (LEFT, *(status.word for status in Status))
"""What `status` can be."""

FEWEST_LETTERS = 4
"""Letters of an id that stand for the whole of it."""


@dataclass(frozen=True)
class Condition:
    """NAME=VALUE, where the value is a word, a number or a pattern with * and ?.

    name : `status`, `case`, or a parameter as the cases have it.
    """

    name: str
    wanted: str

    def holds(self, case: Case, ending: str) -> bool:
        """Whether it holds for a case that has ended so. ending : one of `ENDINGS`."""
        if self.name == STATUS:
            return fnmatchcase(ending, self.wanted)
        if self.name == CASE:
            return fnmatchcase(case.id, self.wanted) or (
                len(self.wanted) >= FEWEST_LETTERS and case.id.startswith(self.wanted)
            )
        return self.name in case.parameters and is_like(case.parameters[self.name], self.wanted)


Expression = tuple[Condition, ...]
"""Conditions that must all hold."""


def is_like(value: Any, wanted: str) -> bool:
    """Whether a parameter equals a word or a number that spells it, or fits a pattern."""
    return same(wanted, value) or any(fnmatchcase(text, wanted) for text in (str(value), json.dumps(value)))


def expression_of(option: str, text: str, cases: Iterable[Case]) -> Expression:
    """The conditions of an expression. Raises StudyError where no case of the study could ever meet one of them.

    option : the argument that has the expression, for the sentence.
    """
    known = list(cases)
    return tuple(_condition(option, text, piece.strip(), known) for piece in text.split(AND))


def _condition(option: str, text: str, piece: str, cases: list[Case]) -> Condition:
    name, equals, wanted = (part.strip() for part in piece.partition("="))
    told = f"{option} = {text!r}"
    if not equals:
        if piece in ENDINGS:
            return Condition(STATUS, piece)
        by_id = Condition(CASE, piece)
        if piece and any(by_id.holds(case, LEFT) for case in cases):
            return by_id
        raise StudyError(
            f"{told}: {piece!r} is no status and the id of no case: write NAME=VALUE, such as solver.kind=anm, or "
            f"choose a status; {did_you_mean(piece, ENDINGS)}"
        )
    found = Condition(name, wanted)
    if name == STATUS:
        if not any(fnmatchcase(word, wanted) for word in ENDINGS):
            raise StudyError(f"{told}: no such status; {did_you_mean(wanted, ENDINGS)}")
        return found
    if any(found.holds(case, LEFT) for case in cases):
        return found
    if name == CASE:
        raise StudyError(f"{told}: no case has this id; `nlsolve plan` lists the cases")
    held: Mapping[str, None] = dict.fromkeys(str(case.parameters[name]) for case in cases if name in case.parameters)
    if not held:
        columns = dict.fromkeys(name for case in cases for name in case.parameters)
        raise StudyError(f"{told}: {no_such_column(name, [STATUS, CASE, *columns])}")
    raise StudyError(f"{told}: no case has this {name}; {did_you_mean(wanted, held)}")
