"""The turns of a run: every case in every timing round, but for what is known, or what another run computes."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass

from nlsolve.results.frames import Part
from nlsolve.results.verdicts import status_of
from nlsolve.running.store import TRIED_AGAIN, Store, rounds_of
from nlsolve.study.case import Case
from nlsolve.study.study import Study

SECONDS_BETWEEN_LOOKS = 0.1
"""Time to wait while all that is left is held by other runs [s]."""


@dataclass(frozen=True)
class Turn:
    """One case in one timing round.

    number, cases : which turn this is, from 1, in the order of the study, and how many there are.
    """

    case: Case
    number: int
    cases: int
    round: int


class Turns:
    """What is left of a run. Two runs on one folder take different cases, and each reads what the other has computed.

    parts : case -> its part so far; a turn that another run has done puts its part there.
    """

    def __init__(self, study: Study, store: Store | None) -> None:
        self.timing, self.store = study.timing, store
        self.parts: dict[str, Part] = {}
        pairs = [(case, turn) for turn in range(1, study.timing.rounds + 1) for case in study.cases]
        self._waiting = deque(Turn(case, number, len(pairs), turn) for number, (case, turn) in enumerate(pairs, 1))
        self._failed_elsewhere: set[str] = set()
        self._taken: Counter[str] = Counter()
        for case in study.cases if store is not None else ():
            self._look_up(case)

    @property
    def left(self) -> int:
        """Number of turns not taken yet."""
        return len(self._waiting)

    def take(self) -> Turn | None:
        """The next turn, with its case claimed unless the turn is done; None while other runs hold all that is left."""
        for _ in range(len(self._waiting)):
            turn = self._waiting.popleft()
            if self._is_next(turn) and (self.is_done(turn) or self._claimed(turn)):
                self._taken[turn.case.id] += 1
                return turn
            self._waiting.append(turn)
        return None

    def is_done(self, turn: Turn) -> bool:
        """Whether the part of the case holds this round."""
        part = self.parts.get(turn.case.id)
        if part is None:
            return False
        return turn.case.id in self._failed_elsewhere or rounds_of(part.run, self.timing) >= turn.round

    def _is_next(self, turn: Turn) -> bool:
        """Whether the earlier rounds of the case have been taken."""
        return self._taken[turn.case.id] == turn.round - 1

    def _claimed(self, turn: Turn) -> bool:
        """Claim the case of a turn, and look it up once more: another run may have done it since."""
        if self.store is None:
            return True
        if not self.store.begin(turn.case):
            return False
        self._look_up(turn.case)
        part = self.parts.get(turn.case.id)
        if part is not None and status_of(part.run) in TRIED_AGAIN:
            self._failed_elsewhere.add(turn.case.id)
        if self.is_done(turn):
            self.store.end(turn.case)
        return True

    def _look_up(self, case: Case) -> None:
        assert self.store is not None
        part = self.store.load(case)
        if part is not None:
            self.parts[case.id] = part
