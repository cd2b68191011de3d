"""The seam of all engines: turns go in, ended turns come out, in any order."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from nlsolve.results.frames import Part
from nlsolve.solving.simulate import Progress
from nlsolve.solving.way import Way
from nlsolve.study.case import Case
from nlsolve.study.timing import Timing


@dataclass(frozen=True)
class Event:
    """What a listener is told: a case begins (no `progress`, no `run`), advances (`progress`), or has ended (`run`).

    number, cases : which case this is, from 1, and how many there are; with several timing rounds every round counts.
    run : the row of `runs` of the case.
    resumed : whether that row was read from the results folder instead of computed.
    """

    case: Case
    number: int
    cases: int
    progress: Progress | None = None
    run: Mapping[str, Any] | None = None
    resumed: bool = False


Listener = Callable[[Event], None]


def _keep_to_itself(way: Way) -> None:
    """Nobody waits for this way."""


@dataclass(frozen=True)
class Turn:
    """One run of one case.

    number, cases : as in an `Event`.
    way : the way to its first state, where another case has solved it.
    share : is to be called with that way when this case has solved it, not from another thread.
    """

    case: Case
    number: int
    cases: int
    way: Way | None = None
    share: Callable[[Way], None] = field(default=_keep_to_itself, compare=False)

    def event(self, progress: Progress | None = None, run: Mapping[str, Any] | None = None) -> Event:
        """What a listener is told of this turn."""
        return Event(self.case, self.number, self.cases, progress, run)


Turns = Iterator[Turn | None]
"""The turns that are left; None: there are some, but all are held by others at present."""

SECONDS_BETWEEN_LOOKS = 0.1
"""How soon an engine with nothing to do asks again for a turn that is held by others [s]."""


class Engine(ABC):
    """Runs cases.

    lane : where the seconds of its cases come from.
    notes : one sentence for each thing that was done otherwise than asked.
    """

    def __init__(self, lane: str) -> None:
        self.lane = lane
        self.notes: list[str] = []

    @abstractmethod
    def parts(self, turns: Turns, timing: Timing, tell: Listener) -> Generator[tuple[Turn, Part], None, None]:
        """Yields each turn with its part as soon as it has ended; what a case does is a row, not an error.

        turns : asked for the next turn when there is room for it, so that a turn may depend on those that have ended.
        tell : is called when a turn begins and when it advances, never from another thread.

        Closing the generator stops the cases that are running. May raise KeyboardInterrupt.
        """

    def note(self, sentence: str) -> None:
        """Keep a sentence for `notes`, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)
