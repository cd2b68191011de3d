"""Which cases of a run share the way to their first state; one of them solves it, and the others wait for that."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from nlsolve.running.store.claims import Claims
from nlsolve.running.store.identity import way_of
from nlsolve.running.store.parts import WAYS
from nlsolve.running.ways.files import read_way, write_way
from nlsolve.solving.way import Way
from nlsolve.study.case import Case


class Ways:
    """The ways of a study's cases, in memory and in its results folder (None: in memory only).

    A way that one case alone has is solved by that case, in each of its timing rounds.
    """

    def __init__(self, cases: Sequence[Case], folder: Path | None) -> None:
        count = Counter(case.way_id for case in cases)
        self._names = {case.id: way_of(case) for case in cases if case.way and count[case.way_id] > 1}
        self._folder = folder
        self._claims = None if folder is None else Claims(folder / WAYS)
        self._known: dict[str, Way] = {}
        self._solving: dict[str, str] = {}

    def is_open(self, case: Case) -> bool:
        """Whether a case may begin: its way is known, it has none to share, or nobody else is solving it."""
        name = self._names.get(case.id, "")
        if not name or self._look_up(name) is not None:
            return True
        if name in self._solving:
            return self._solving[name] == case.id
        return self._claims is None or self._claims.take(name)

    def begin(self, case: Case) -> Way | None:
        """A case that may begin begins: its way if it is known; else the case is the one that solves it."""
        name = self._names.get(case.id, "")
        known = self._known.get(name)
        if name and known is None:
            self._solving[name] = case.id
        return known

    def keep(self, case: Case, way: Way) -> None:
        """A case has solved its way."""
        name = self._names.get(case.id, "")
        if name:
            self._known[name] = way
            if self._folder is not None:
                write_way(self._folder, name, way)
            self._leave(name)

    def end(self, case: Case) -> None:
        """A case has ended; where it has not come to the end of its way, another one may try."""
        name = self._names.get(case.id, "")
        if name and self._solving.get(name) == case.id:
            self._leave(name)

    def close(self) -> None:
        """Give up all claims."""
        if self._claims is not None:
            self._claims.release_all()

    def _look_up(self, name: str) -> Way | None:
        if name not in self._known and self._folder is not None and (found := read_way(self._folder, name)) is not None:
            self._known[name] = found
        return self._known.get(name)

    def _leave(self, name: str) -> None:
        self._solving.pop(name, None)
        if self._claims is not None:
            self._claims.release(name)
