"""The turns of a run: every case in every timing round, but for what is known, or what another run computes."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import replace

from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import Listener, Turn
from nlsolve.running.retry import is_final, lacks_something
from nlsolve.running.store.identity import way_of
from nlsolve.running.store.store import Store
from nlsolve.running.timing.rounds import rounds_of
from nlsolve.running.ways.ways import Ways
from nlsolve.solving.way import Way
from nlsolve.study.case import Case
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing


class Turns:
    """What is left of a run. Two runs on one folder take different cases, and each reads what the other has computed.

    chosen : the cases that the run is for; absent: all.
    parts : case -> its part so far, whoever has computed it.
    """

    def __init__(self, study: Study, store: Store | None, chosen: Sequence[Case] | None = None) -> None:
        self.study, self.timing, self.store = study, study.timing, store
        self.ways = Ways(study.cases, None if store is None else store.folder)
        self.parts: dict[str, Part] = {}
        self.cases = cases = study.cases if chosen is None else chosen
        ours = {case.id for case in cases}
        self._others = [case for case in study.cases if case.id not in ours]
        pairs = [(turn, case) for turn in range(1, study.timing.rounds + 1) for case in cases]
        turns = [(turn, Turn(case, number, len(pairs))) for number, (turn, case) in enumerate(pairs, 1)]
        self._waiting = deque(turns)
        self._failed_elsewhere: set[str] = set()
        self._ended: Counter[str] = Counter()
        for case in cases if store is not None else ():
            self._look_up(Turn(case, 0, 0))

    def each(self, tell: Listener) -> Iterator[Turn | None]:
        """The turns to be run, each with its case claimed; None while all that are left are running, here or elsewhere.

        tell : is told of the turns that are done already.
        """
        while self._waiting:
            found = self._next()
            if found is not None and self._is_done(*found):
                _, turn = found
                self._ended[turn.case.id] += 1
                if self.store is not None:
                    self.store.end(turn.case)
                tell(replace(turn.event(run=self.parts[turn.case.id].run), resumed=True))
            else:
                yield found and self._on_its_way(found[1])

    def gather(self) -> dict[str, Part]:
        """The parts so far, and what the folder has by now of the cases that this run is not for."""
        if self.store is not None:
            for case in self._others:
                if case.id not in self.parts and (found := self.store.finished(case)) is not None:
                    self.parts[case.id] = found
        return self.parts

    def end(self, turn: Turn, again: Part) -> Part:
        """Keep the part of a turn that has ended, and give up the claim; returns the part of its case."""
        case = turn.case
        if case.way and not lacks_something(again.run):
            again = replace(again, run={**again.run, "start_way": way_of(case)})
        part = self.parts[case.id] = self.joined(self.parts.get(case.id), again)
        self._ended[case.id] += 1
        self.ways.end(case)
        if self.store is not None:
            self.store.save(case, part)
            self.store.end(case)
        return part

    def joined(self, before: Part | None, again: Part) -> Part:
        """The part of a case that has been run once more."""
        return _fastest(before, again, self.timing)

    def close(self) -> None:
        """Give up what this run has claimed."""
        self.ways.close()
        if self.store is not None:
            self.store.close()

    def _on_its_way(self, turn: Turn) -> Turn:
        """A turn that begins, with the way to its first state where that is known."""
        case = turn.case
        return replace(turn, way=self.ways.begin(case), share=lambda way: self._share(case, way))

    def _share(self, case: Case, way: Way) -> None:
        """A case has solved the way to its first state."""
        self.ways.keep(case, way)
        if self.store is not None:
            self.store.arrive(case)

    def _next(self) -> tuple[int, Turn] | None:
        for _ in range(len(self._waiting)):
            number, turn = self._waiting.popleft()
            is_next = self._ended[turn.case.id] == number - 1
            if is_next and (self._is_done(number, turn) or (self.ways.is_open(turn.case) and self._claimed(turn))):
                return number, turn
            self._waiting.append((number, turn))
        return None

    def _is_done(self, number: int, turn: Turn) -> bool:
        """Whether the part of the case holds this round."""
        part = self.parts.get(turn.case.id)
        if part is None:
            return False
        over = turn.case.id in self._failed_elsewhere or is_final(part.run)
        return over or rounds_of(part.run, self.timing) >= number

    def _claimed(self, turn: Turn) -> bool:
        """Claim the case of a turn, and look it up once more: another run may have done it since."""
        if self.store is None:
            return True
        if not self.store.begin(turn.case):
            return False
        found = self._look_up(turn)
        if found is not None and lacks_something(found.run):
            self._failed_elsewhere.add(turn.case.id)
        return True

    def _look_up(self, turn: Turn) -> Part | None:
        assert self.store is not None
        part = self.store.load(turn.case)
        if part is not None:
            self.parts[turn.case.id] = part
        return part


def _fastest(before: Part | None, again: Part, timing: Timing) -> Part:
    """The fastest timing round of a case. Its row also has the slowest round's seconds and the number of rounds."""
    if before is None or not rounds_of(before.run, timing) or not rounds_of(again.run, timing):
        return again
    best = min(before, again, key=lambda part: part.run["seconds"])
    most = max(part.run["seconds_most"] for part in (before, again))
    rounds = rounds_of(before.run, timing) + 1
    return replace(best, run={**best.run, "seconds_most": most, "rounds": rounds})
