"""Study -> results: an engine runs every case once, and every ending becomes a row."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from nlsolve.contracts.status import STOPPED, Status
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.costs.cost_prediction import UNITS, with_predictions
from nlsolve.results.frames import Frames, Part
from nlsolve.results.reference_error import with_reference_errors
from nlsolve.results.verdicts import number
from nlsolve.running.engines.choice import engine_for
from nlsolve.running.engines.engine import Event, Listener, Turn
from nlsolve.running.engines.execution import Debugger
from nlsolve.running.retry import is_final, is_tried_again
from nlsolve.running.store import Store, merge
from nlsolve.show.figures import FigureError, draw, save
from nlsolve.show.report import write_report
from nlsolve.show.tables import Table, build
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing

SECONDS_BETWEEN_FRAMES = 10.0
"""Least time between two writings of the merged frames [s]; the part of a case is saved as soon as the case ends."""


@dataclass(frozen=True)
class Results:
    """The results of a study.

    runs, steps, fields : tidy frames; `nlsolve.results.columns` says what every column means.
    folder : the results folder; None if the results are in memory only.
    notes : one sentence for each table or figure that could not be shown, with the reason, and for each thing that was
        done otherwise than asked.
    """

    study: Study
    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame
    folder: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def crashed(self) -> int:
        """How many cases stopped on an error in the program or in a plugin, or were stopped at a limit."""
        return int(self.runs["status"].isin([status.word for status in (Status.CRASHED, *STOPPED)]).sum())

    def tables(self) -> list[Table]:
        """The declared tables that these runs can fill; the others are in `notes`."""
        return _tables(self.study, self.runs)[0]

    def table(self, name: str) -> pd.DataFrame:
        """The cells of a declared table. Raises StudyError if no table has this name or these runs cannot fill it."""
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
    isolation: str | None = None,
    jobs: int | None = None,
    retry: Collection[Status] = (),
    debugger: Debugger | None = None,
) -> Results:
    """Run every case of a study that has not been run before, and keep the results in `out` (None: in memory).

    listen : is called with each `Event`.
    isolation : "process": every case in a worker process, within its limits (the default); "none": in this process.
    jobs : cases at a time; by default as many as there are physical cores, but one if the study says how it is timed.
    retry : statuses of cases that are run again. Cases with an error of the program or of a plugin, and those whose
        method did not apply, always are, and those stopped at a limit when it has been raised.
    debugger : is called with an error before it becomes a row; the cases then run in this process.

    An interruption loses only the cases that are running; the same call later runs those that are left.

    Raises StudyError for a study that is not valid and for settings that do not go together, StoreError for a folder
    that cannot hold its results.
    """
    study = study_of(study, overrides, quick)
    engine = engine_for(study.timing, isolation, jobs, debugger)
    store = None if out is None else Store(Path(out), study)
    tell = listen or (lambda event: None)
    parts = _finished(study, store, retry)
    written = time.monotonic()
    try:
        with closing(engine.parts(_turns(study, parts, tell), study.timing, tell)) as ended:
            for turn, again in ended:
                case = turn.case.id
                parts[case] = _fastest(parts.get(case), again, study.timing)
                if store is not None:
                    store.save(parts[case])
                    if time.monotonic() - written > SECONDS_BETWEEN_FRAMES:
                        store.write_frames(_merged(study, parts))
                        written = time.monotonic()
                tell(turn.event(run=parts[case].run))
    finally:
        if store is not None:
            store.write_frames(_merged(study, parts))
    frames, notes = _merged(study, parts), tuple(engine.notes)
    if store is None:
        return Results(study, frames.runs, frames.steps, frames.fields, notes=notes)
    shown = _show(store, study, frames)
    return Results(study, frames.runs, frames.steps, frames.fields, store.folder, (*notes, *shown))


def _turns(study: Study, parts: Mapping[str, Part], tell: Listener) -> Iterator[Turn]:
    """The turns that are left, round after round; `parts` are those that have ended when the next turn is asked for."""
    everything = [(turn, case) for turn in range(1, study.timing.rounds + 1) for case in study.cases]
    for position, (turn, case) in enumerate(everything, 1):
        part = parts.get(case.id)
        if part is not None and (_rounds(part, study.timing) >= turn or is_final(part.run)):
            tell(Event(case, position, len(everything), run=part.run, resumed=True))
        else:
            yield Turn(case, position, len(everything))


def _rounds(part: Part, timing: Timing) -> int:
    """Number of rounds in which a case has been timed as the study asks; 0 for a case that crashed."""
    known, units = number(part.run.get("rounds")), UNITS[0] in part.run or not timing.calibrate
    return int(known) if known > 0 and units and part.run.get("clock") == timing.clock else 0


def _fastest(before: Part | None, again: Part, timing: Timing) -> Part:
    """The fastest timing round of a case. Its row also has the slowest round's seconds and the number of rounds."""
    if before is None or not _rounds(before, timing) or not _rounds(again, timing):
        return again
    best = min(before, again, key=lambda part: part.run["seconds"])
    most = max(part.run["seconds_most"] for part in (before, again))
    rounds = _rounds(before, timing) + 1
    return replace(best, run={**best.run, "seconds_most": most, "rounds": rounds})


def study_of(study: Study | str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None, quick: bool) -> Study:
    """`study` itself, or the study in a dictionary or a TOML file.

    Raises StudyError for a study that is not valid, and for a `Study` given together with `overrides` or `quick`.
    """
    if isinstance(study, Study):
        if overrides or quick:
            raise StudyError(f"{study.name}: overrides and quick are applied when a study is read, not when it is run")
        return study
    if isinstance(study, Mapping):
        return Study.from_dict(study, overrides, quick)
    return Study.from_toml(study, overrides, quick)


def _finished(study: Study, store: Store | None, retry: Collection[Status]) -> dict[str, Part]:
    """The parts in the folder of the cases that are not to be run again."""
    if store is None:
        return {}
    loaded = [(case, store.load(case.id)) for case in study.cases]
    return {
        case.id: part
        for case, part in loaded
        if part is not None and not is_tried_again(part.run, case.parts.limits, retry)
    }


def _merged(study: Study, parts: Mapping[str, Part]) -> Frames:
    frames = merge([parts[case.id] for case in study.cases if case.id in parts])
    references = {case.id: case.reference for case in study.cases if case.reference}
    frames = with_reference_errors(frames, references)
    return replace(frames, runs=with_predictions(frames.runs))


def _tables(study: Study, runs: pd.DataFrame) -> tuple[list[Table], list[str]]:
    tables, notes = [], []
    for spec in study.tables:
        try:
            tables.append(build(spec, runs))
        except StudyError as error:
            notes.append(str(error))
    return tables, notes


def _show(store: Store, study: Study, frames: Frames) -> tuple[str, ...]:
    """Write tables, figures and the report. Returns a sentence for each that cannot be shown; the results stay."""
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
