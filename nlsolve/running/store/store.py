"""The results folder of a study that is run.

A folder remembers its cases by what determines their numbers (`nlsolve.running.store.identity`), so that a study which
grows or changes finds there whatever still applies.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.results.costs.lanes import EXCLUSIVE
from nlsolve.results.frames import Frames, Part
from nlsolve.results.verdicts import status_of
from nlsolve.running.portions.condition import LEFT
from nlsolve.running.store.claims import CLAIMS, Claims
from nlsolve.running.store.identity import Identity, identity_of
from nlsolve.running.store.parts import (
    CASES,
    ENVIRONMENTS,
    WAYS,
    Entry,
    Parts,
    StoreError,
    merge,
    write_frame,
    write_text,
    writing,
)
from nlsolve.running.store.reading import (
    SHOWN,
    STUDY,
    completed,
    describe,
    names_in,
    read_shown,
    shown_of,
    something_else,
)
from nlsolve.running.store.standing import KEPT, Standings
from nlsolve.study.case import Case
from nlsolve.study.study import Study


class Store:
    """The results folder of a study that is run. Raises StoreError when it cannot be used or written."""

    def __init__(self, folder: Path, study: Study, retry: Collection[Status] = ()) -> None:
        self.folder, self.study = folder, study
        self.parts = Parts(folder)
        self.parts.refuse_old()
        with self.writing():
            if something_else(folder):
                raise StoreError(f"{folder}: not a results folder: its {STUDY} was written by something else")
            (folder / CASES).mkdir(parents=True, exist_ok=True)
        self._claims = Claims(folder)
        self._standings = Standings(self.parts, study.timing, retry)
        self._started: dict[str, float] = {}
        self._arrived: dict[str, float] = {}
        self._begun: dict[str, Identity] = {case.id: identity_of(case) for case in study.cases}
        self.write_text(STUDY, json.dumps(describe(study, self._begun), ensure_ascii=False) + "\n")

    def load(self, case: Case) -> Part | None:
        """The part of a finished case, under this study's names of settings.

        None when there is none, it is damaged, something it depends on has changed, or the case is to be tried again.
        """
        standing = self._standings.of(case)
        self._begun[case.id] = standing.identity
        if standing.entry is None:
            return None
        frames = self.parts.frames(standing.entry)
        if frames is None:
            return None
        return _part(standing.entry, case, frames)

    def finished(self, case: Case) -> Part | None:
        """The part of a case as `load` gives it, also where it is to be tried again; None when there is none."""
        entry = self.parts.entry(identity_of(case).key)
        frames = None if entry is None else self.parts.frames(entry)
        return None if entry is None or frames is None else _part(entry, case, frames)

    def ending(self, case: Case) -> str:
        """The word of the status with which a case ended last, or `LEFT`."""
        last = self._standings.of(case).last
        return LEFT if last is None else status_of(last.measured).word

    def begin(self, case: Case) -> bool:
        """Claim a case, so that no other run computes it; False while another run has it."""
        with self.writing():
            taken = self._claims.take(identity_of(case).key)
        if taken:
            self._started[case.id] = time.monotonic()
        return taken

    def begin_timing(self) -> bool:
        """Claim the exclusive lane of the folder until the end of the run; False while another run has it."""
        with self.writing():
            return self._claims.take(EXCLUSIVE)

    def arrive(self, case: Case) -> None:
        """A case that has begun has solved the way to its first state."""
        self._arrived[case.id] = time.monotonic()

    def save(self, case: Case, part: Part) -> None:
        """Keep a part. It is not kept when a file that the case reads has changed since the case was looked up."""
        identity = identity_of(case)
        if identity == self._begun[case.id]:
            begun = self._started.get(case.id, math.nan) + part.startup
            way = self._arrived.pop(case.id, begun) - begun
            self.parts.save(identity, part, case.parameters, time.monotonic() - begun, way)

    def end(self, case: Case) -> None:
        """Give up the claim on a case."""
        self._claims.release(self._begun[case.id].key)

    def close(self) -> None:
        """Give up all claims."""
        self._claims.release_all()

    def unchanged(self) -> tuple[Frames, tuple[str, ...]] | None:
        """All frames and the notes of the last run, where nothing is left to run, to write or to show; else None."""
        found = list(self._standings.of_all(self.study.cases).values())
        entries = [standing.entry for standing in found if standing.entry is not None and standing.word == KEPT]
        if len(entries) < len(found):
            return None
        shown = read_shown(self.folder, shown_of(self.study, entries))
        if shown is None:
            return None
        pairs = zip(entries, self.study.cases, strict=True)
        nothing = pd.DataFrame()
        rows = [Part(entry.run(names_in(case)), nothing, nothing) for entry, case in pairs]
        frames, notes = shown
        references = {case.id: case.reference for case in self.study.cases if case.reference}
        return completed(replace(frames, runs=merge(rows).runs), references), notes

    def mark_shown(self, notes: Collection[str]) -> None:
        """Remember by what the tables, figures and report were made that are there now."""
        entries = [self.parts.entry(self._begun[case.id].key) for case in self.study.cases]
        files = [path.relative_to(self.folder) for path in self.folder.rglob("*") if path.is_file()]
        shown = [str(path) for path in files if path.parts[0] not in (CASES, ENVIRONMENTS, WAYS, CLAIMS, SHOWN)]
        digest = shown_of(self.study, [entry for entry in entries if entry is not None])
        document = {"digest": digest, "files": sorted(shown), "notes": list(notes)}
        self.write_text(SHOWN, json.dumps(document, ensure_ascii=False) + "\n")

    def write_frames(self, frames: Frames) -> None:
        """Write runs and steps as parquet and CSV, fields as parquet."""
        for name, frame in (("runs", frames.runs), ("steps", frames.steps)):
            write_frame(self.folder, self.folder / f"{name}.parquet", frame)
            self.write_text(f"{name}.csv", frame.to_csv(index=False))
        write_frame(self.folder, self.folder / "fields.parquet", frames.fields)

    def write_text(self, name: str, text: str) -> None:
        """Write a text file whole or not at all."""
        write_text(self.folder, self.folder / name, text)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn a failure of the file system into a StoreError."""
        with writing(self.folder):
            yield


def _part(entry: Entry, case: Case, frames: tuple[pd.DataFrame, pd.DataFrame]) -> Part:
    """A part as it was saved, under this study's names of settings."""
    return Part(entry.run(names_in(case)), *frames, rounds=tuple(entry.rounds))
