"""Cases that a study leaves out, each with a reason."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlsolve.registry.problems import ABSENT, Problem
from nlsolve.results.columns import no_such_column
from nlsolve.results.selection import Where, fits


class Exclude(BaseModel):
    """Which cases are left out, and why; a case that would not be valid may be among them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    where: Where = Field(min_length=1, description="parameter -> value, or list of values, of the cases left out")
    reason: str = Field(min_length=1, description="why they are left out, in a sentence")


@dataclass(frozen=True)
class Excluded:
    """A case that is left out: its swept values as text for people, and the reason."""

    label: str
    reason: str


class Exclusions:
    """The rules of a study, and the cases that they leave out."""

    def __init__(self, rules: Sequence[Exclude]) -> None:
        self.rules = rules
        self.found: list[Excluded] = []
        self._used: set[int] = set()

    def hit(self, parameters: Mapping[str, Any], label: str) -> bool:
        """Whether a case is left out, which is then remembered."""
        for number, rule in enumerate(self.rules):
            if fits(parameters, rule.where):
                self._used.add(number)
                self.found.append(Excluded(label, rule.reason))
                return True
        return False

    def idle(self, known: Iterable[str]) -> list[Problem]:
        """A problem for each rule that leaves out no case. known : names of the parameters of all cases."""
        known = list(known)
        problems = []
        for number, rule in enumerate(self.rules):
            if number in self._used:
                continue
            place = ("exclude", number, "where")
            strange = [name for name in rule.where if name not in known]
            problems += [Problem((*place, name), ABSENT, no_such_column(name, known)) for name in strange]
            if not strange:
                problems.append(Problem(place, ABSENT, "no case has these values, or an earlier rule leaves it out"))
        return problems
