"""Study -> results: every case marched once, under one thread, and every ending a row."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from nlsolve.algebra import solve_system
from nlsolve.errors import StudyError, did_you_mean
from nlsolve.figures import FigureError, Frames, draw, save
from nlsolve.march import Progress, Setup, march
from nlsolve.references import with_reference_errors
from nlsolve.report import write_report
from nlsolve.status import Status
from nlsolve.store import Part, Store, merge
from nlsolve.studies import Case, Study
from nlsolve.tables import Table, build


@dataclass(frozen=True)
class Event:
    """What a listener is told: a case begins (no progress, no run), advances (progress), or has ended (its run).

    number : of the case, from 1.
    resumed : the run was read from the results folder instead of computed.
    """

    case: Case
    number: int
    cases: int
    progress: Progress | None = None
    run: Mapping[str, Any] | None = None
    resumed: bool = False


SECONDS_BETWEEN_FRAMES = 10.0
"""The parts of finished cases are kept one by one; together they are written now and then, and at the end."""

Listener = Callable[[Event], None]


@dataclass(frozen=True)
class Results:
    """What a study has found.

    runs, steps, fields : tidy frames; `nlsolve.columns` says what every column means.
    folder : where they are kept; None in memory only.
    notes : what could not be shown, and why, a sentence each.
    """

    study: Study
    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame
    folder: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def crashed(self) -> int:
        """How many cases stopped on an error in the program or in a plugin."""
        return int((self.runs["status"] == Status.CRASHED.word).sum())

    def tables(self) -> list[Table]:
        """The declared tables that these runs can fill; the others are in `notes`."""
        return _tables(self.study, self.runs)[0]

    def table(self, name: str) -> pd.DataFrame:
        """The cells of a declared table."""
        for spec in self.study.tables:
            if spec.name == name:
                return build(spec, self.runs).cells
        names = [spec.name for spec in self.study.tables]
        raise StudyError(f"{self.study.name}: the study declares no table {name!r}; {did_you_mean(name, names)}")


def run(
    study: Study | str | Path | Mapping[str, Any],
    out: str | Path | None = None,
    *,
    overrides: Mapping[str, Any] | None = None,
    quick: bool = False,
    listen: Listener | None = None,
) -> Results:
    """Run every case of a study that has not been run before, and keep the results in `out` (None: in memory).

    An interruption loses the running case only; the same call again does the rest. Cases that crashed, or whose method
    did not apply, are tried again.
    """
    study = _study(study, overrides, quick)
    store = None if out is None else Store(Path(out), study)
    tell = listen or (lambda event: None)
    parts = _finished(study, store)
    written = time.monotonic()
    try:
        for number, case in enumerate(study.cases, 1):
            begun = Event(case, number, len(study.cases))
            resumed = case.id in parts
            if not resumed:
                tell(begun)
                parts[case.id] = execute(case, number, len(study.cases), tell)
                if store is not None:
                    store.save(parts[case.id])
                    if time.monotonic() - written > SECONDS_BETWEEN_FRAMES:
                        store.write_frames(_merged(study, parts))
                        written = time.monotonic()
            tell(Event(case, number, len(study.cases), run=parts[case.id].run, resumed=resumed))
    finally:
        if store is not None:
            store.write_frames(_merged(study, parts))
    frames = _merged(study, parts)
    if store is None:
        return Results(study, frames.runs, frames.steps, frames.fields)
    return Results(study, frames.runs, frames.steps, frames.fields, store.folder, _show(store, study, frames))


def execute(case: Case, number: int, cases: int, tell: Listener) -> Part:
    """March one case, or solve its system. Whatever it raises, an interruption excepted, becomes a row that says so."""
    try:
        with threadpool_limits(limits=1):
            setup, listen = case.setup, lambda progress: tell(Event(case, number, cases, progress=progress))
            record = march(setup, listen) if isinstance(setup, Setup) else solve_system(setup, listen)
    except Exception as error:  # the one boundary at which a crash turns into a result
        place = traceback.extract_tb(error.__traceback__)[-1]
        message = f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})"
        summary: dict[str, Any] = {"status": Status.CRASHED.word, "message": message}
        steps = fields = pd.DataFrame()
    else:
        summary, steps, fields = record.summary, record.steps, record.fields
    row = {"case": case.id, **summary, **case.parameters}
    return Part(row, _of_case(case.id, steps), _of_case(case.id, fields))


def _study(study: Study | str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None, quick: bool) -> Study:
    if isinstance(study, Study):
        if overrides or quick:
            raise StudyError(f"{study.name}: overrides and quick are applied when a study is read, not when it is run")
        return study
    if isinstance(study, Mapping):
        return Study.from_dict(study, overrides, quick)
    return Study.from_toml(study, overrides, quick)


def _finished(study: Study, store: Store | None) -> dict[str, Part]:
    if store is None:
        return {}
    loaded = {case.id: store.load(case.id) for case in study.cases}
    return {case: part for case, part in loaded.items() if part is not None}


def _merged(study: Study, parts: Mapping[str, Part]) -> Frames:
    frames = merge([parts[case.id] for case in study.cases if case.id in parts])
    return with_reference_errors(frames, {case.id: case.reference for case in study.cases if case.reference})


def _of_case(case: str, frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with the case's name in front."""
    if not len(frame):
        return pd.DataFrame()
    others = [name for name in frame.columns if name != "case"]
    return frame.assign(case=case)[["case", *others]]


def _tables(study: Study, runs: pd.DataFrame) -> tuple[list[Table], list[str]]:
    tables, notes = [], []
    for spec in study.tables:
        try:
            tables.append(build(spec, runs))
        except StudyError as error:
            notes.append(str(error))
    return tables, notes


def _show(store: Store, study: Study, frames: Frames) -> tuple[str, ...]:
    """Write tables, figures and the report; what cannot be shown is told in a sentence, and never costs the results."""
    tables, notes = _tables(study, frames.runs)
    shown: dict[str, pd.DataFrame] = {}
    for table in tables:
        for ending, text in table.files().items():
            store.write_text(f"tables/{table.spec.name}{ending}", text)
        shown |= table.frames()
    with store.writing():
        for spec in study.figures:
            try:
                save(draw(spec, frames.runs, frames.steps, frames.fields), store.folder / "figures", spec.name)
            except FigureError as error:
                notes.append(str(error))
        captions = [(spec.name, spec.caption) for spec in study.figures]
        write_report(store.folder, study.question, shown, captions, frames.runs)
    return tuple(notes)
