"""The turns of the exclusive lane: all cases in turn, round after round, until the median of each is certain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from nlsolve.results.frames import Part
from nlsolve.results.verdicts import AT_A_SOLUTION, status_of
from nlsolve.running.engines.engine import Listener, Turn
from nlsolve.running.store.store import Store
from nlsolve.running.timing.rounds import comparisons, is_compared, is_over, rounds_of, with_round, without_rounds
from nlsolve.running.turns import Turns
from nlsolve.running.ways.ways import Ways
from nlsolve.study.case import Case
from nlsolve.study.study import Study


class CountingTurns(Turns):
    """Turns before those of the exclusive lane, side by side: how each case ends, its counts and its errors.

    The folder keeps no way to a first state of theirs, as its seconds are to come from the lane.
    """

    def __init__(self, study: Study, store: Store | None, chosen: Sequence[Case] | None = None) -> None:
        super().__init__(study, store, chosen)
        self.ways = Ways(study.cases, None)


class ExclusiveTurns(Turns):
    """Turns that are taken one at a time: the next is asked for when the last one has ended.

    counted : case -> its part from `CountingTurns`; those that have not arrived need no turn.

    Of two runs on one folder the second waits for the end of the first. A comparison goes on where it was stopped; one
    to which a case has been added begins anew, so that all its cases have the same rounds.
    """

    def __init__(
        self,
        study: Study,
        store: Store | None,
        chosen: Sequence[Case] | None = None,
        counted: Mapping[str, Part] | None = None,
    ) -> None:
        super().__init__(study, store, chosen)
        self.parts |= counted or {}
        self._counted = [case.id for case in self.cases if counted and case.id in counted]
        self._comparisons = comparisons(self.cases)
        self._run: set[str] = set()

    def each(self, tell: Listener) -> Iterator[Turn | None]:
        """The turns to be run, each with its case claimed.

        None while another run has the lane of the folder, or computes the case for a study without the lane.
        """
        if self.store is not None:
            while not self.store.begin_timing():
                yield None
            for case in self.cases:
                self._look_up(Turn(case, 0, 0))
        due = self._due()
        waiting = {case.id for case in due}
        told = {*waiting, *self._counted}
        number = len(self._counted)
        done = [case for case in self.cases if case.id not in told]
        for case in done:
            number += 1
            turn = Turn(case, number, len(self._counted) + len(done) + len(due))
            tell(replace(turn.event(run=self.parts[case.id].run), resumed=True))
        while due:
            of = number + len(due)
            for case in due:
                while not self._is_ours(case):
                    yield None
                number += 1
                self._run.add(case.id)
                yield self._on_its_way(Turn(case, number, of))
            due = self._due()

    def joined(self, before: Part | None, again: Part) -> Part:
        """The rounds of a case with one more."""
        return with_round(before, again, self.timing)

    def _is_ours(self, case: Case) -> bool:
        """Whether no other run solves the way to the case's first state, or computes the case."""
        return self.ways.is_open(case) and (self.store is None or self.store.begin(case))

    def _due(self) -> list[Case]:
        """The cases of the next round, in the order of the study.

        The rounds of a comparison count no more when one of its cases is behind by several.
        """
        due: set[str] = set()
        for members in self._comparisons:
            counts = {case.id: self._rounds(case) for case in members if not self._is_settled(case)}
            if counts and max(counts.values()) - min(counts.values()) > 1:
                for case in counts:
                    if case in self.parts:
                        self.parts[case] = without_rounds(self.parts[case])
                counts = dict.fromkeys(counts, 0)
            least = min(counts.values(), default=0)
            if not least or not is_over([self.parts[case].run for case in counts], self.timing):
                due |= {case for case, count in counts.items() if count == least}
        return [case for case in self.cases if case.id in due]

    def _rounds(self, case: Case) -> int:
        part = self.parts.get(case.id)
        return 0 if part is None else rounds_of(part.run, self.timing)

    def _is_settled(self, case: Case) -> bool:
        """Whether a case needs no round: it has no solution to be timed, or its run here could not be timed."""
        part = self.parts.get(case.id)
        if part is None:
            return False
        arrived = status_of(part.run) in AT_A_SOLUTION
        return not arrived or (case.id in self._run and not is_compared(part.run, self.timing))
