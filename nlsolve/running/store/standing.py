"""What a results folder has of each case of a study, and why a case is to be run: new, changed, retried, kept."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from nlsolve.contracts.status import Status
from nlsolve.results.verdicts import status_of
from nlsolve.running.retry import is_tried_again
from nlsolve.running.store.identity import Identity, case_of, identity_of
from nlsolve.running.store.parts import Entry, Parts
from nlsolve.running.timing.rounds import comparisons, has_rounds, is_compared, is_over
from nlsolve.study.case import Case
from nlsolve.study.timing import Timing

KEPT, NEW, DAMAGED, TIMED = "kept", "new", "damaged", "timed again"
"""Words for a case: its part is kept, there is none, it cannot be read, or its seconds were taken in another way."""

WITHOUT_ITERATES = "without iterates"
"""The word for a case whose part has no iterates, which the study asks for now."""

ITERATES = "record.iterates"


@dataclass(frozen=True)
class Standing:
    """What a folder has of one case.

    word : KEPT, NEW, DAMAGED, TIMED, WITHOUT_ITERATES, "retried (crashed)", or what has changed: "changed plugin honey
        1.0 -> 1.1".
    entry : the part that stands, if its case is kept or timed again.
    last : how the case ended last, even if its source or a file has changed since; None when nothing is known of it.
    """

    identity: Identity
    word: str
    entry: Entry | None = None
    last: Entry | None = None


class Standings:
    """What a folder has of cases, looked up one by one; the folder need not exist, and is not written.

    retry : see `is_tried_again`.

    A part that was written since counts whatever its status: another run has just tried the case.
    """

    def __init__(self, parts: Parts, timing: Timing, retry: Collection[Status] = ()) -> None:
        self.parts, self.timing, self.retry = parts, timing, retry
        self.begun = time.time()
        self._keys: defaultdict[str, list[str]] = defaultdict(list)
        for key in parts.names():
            self._keys[case_of(key)].append(key)

    def of(self, case: Case) -> Standing:
        """What the folder has of a case as it would be run now."""
        identity = identity_of(case)
        entry = self.parts.entry(identity.key)
        if entry is None:
            last = self._latest(self._keys.get(case.id, []))
            return Standing(identity, self._why(identity, last), last=last)
        run = {**entry.measured, **entry.parameters}
        if is_tried_again(run, case.parts.limits, self.retry) and entry.written < self.begun:
            return Standing(identity, f"retried ({status_of(entry.measured).word})", last=entry)
        if case.parts.record.iterates and not entry.parameters.get(ITERATES):
            return Standing(identity, WITHOUT_ITERATES, last=entry)
        return Standing(identity, KEPT if has_rounds(entry.measured, self.timing) else TIMED, entry, entry)

    def of_all(self, cases: Sequence[Case]) -> dict[str, Standing]:
        """What the folder has of each case, as `compared` has it."""
        return self.compared(cases, {case.id: self.of(case) for case in cases})

    def compared(self, cases: Sequence[Case], found: Mapping[str, Standing]) -> dict[str, Standing]:
        """What the folder has of each of these cases; in the exclusive lane the cases of a comparison are timed again
        together.

        They are while one of them has no part that stands, or too few rounds. found : what `of` tells of each.
        """
        standing = {case.id: found[case.id] for case in cases}
        for members in comparisons(cases) if self.timing.is_exclusive else ():
            entries = {case.id: found[case.id].entry for case in members}
            timed = {
                case: entry.measured
                for case, entry in entries.items()
                if entry is not None and is_compared(entry.measured, self.timing)
            }
            kept = all(found[case].word == KEPT for case in entries)
            if not kept or not is_over(list(timed.values()), self.timing):
                standing |= {case: replace(found[case], word=TIMED) for case in timed if found[case].word == KEPT}
        return standing

    def _why(self, identity: Identity, last: Entry | None) -> str:
        """Why no part stands for an identity: what has changed since the last part of its case, if there is one."""
        keys = self._keys.get(identity.case, [])
        if identity.key in keys:
            return DAMAGED
        if last is None:
            return DAMAGED if keys else NEW
        return ", ".join(identity.changes_since(last.identity))

    def _latest(self, keys: Iterable[str]) -> Entry | None:
        found = [entry for entry in map(self.parts.entry, keys) if entry is not None]
        return max(found, key=lambda entry: entry.written, default=None)
