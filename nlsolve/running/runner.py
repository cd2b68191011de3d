"""Study -> results: an engine runs every case once, and every ending becomes a row."""

from __future__ import annotations

import shlex
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.registry.plugin_files import Plugin, with_plugins
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import load_registry
from nlsolve.results.frames import Frames, Part, rows_of
from nlsolve.running.engines.choice import counter_for, engine_for
from nlsolve.running.engines.engine import Engine, Event, Listener
from nlsolve.running.engines.execution import Debugger
from nlsolve.running.portions.portion import portion_of
from nlsolve.running.results import Results
from nlsolve.running.store.parts import Parts, StoreError, merge
from nlsolve.running.store.reading import completed, description_of, environments_of, finished, of_one_source
from nlsolve.running.store.store import Store
from nlsolve.running.timing.exclusive import CountingTurns, ExclusiveTurns
from nlsolve.running.turns import Turns
from nlsolve.show.figures import FigureError, write
from nlsolve.show.provenance import Provenance
from nlsolve.show.tables import PREAMBLE, PREAMBLE_FILE, built
from nlsolve.study.study import Study
from nlsolve.study.timing import Timing

SECONDS_BETWEEN_FRAMES = 10.0
"""Least time between two writings of the merged frames [s]; the part of a case is saved as soon as the case ends."""


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
    engine: str | None = None,
    scheduler: str | None = None,
    only: str | Collection[str] = (),
    skip: str | Collection[str] = (),
    failed: bool = False,
    shard: str | None = None,
    plugins: Iterable[Plugin] = (),
) -> Results:
    """Run every case of a study that has not been run before, and keep the results in `out` (None: in memory).

    listen : is called with each `Event`.
    isolation : "process": every case in a worker process, within its limits (the default); "none": in this process.
    jobs : cases at a time; by default as many as there are physical cores, or threads of the cluster, but one if the
        study says how it is timed.
    retry : statuses of cases that are run again. Cases with an error of the program or of a plugin, and those whose
        method did not apply, always are, and those stopped at a limit when it has been raised.
    debugger : is called with an error before it becomes a row; the cases then run in this process.
    engine : "local": worker processes on this machine (the default); "dask": on a cluster of dask.distributed.
    scheduler : the address of that cluster's scheduler; absent: a cluster of this machine.
    only, skip : run the cases that fit one of `only`, and none that fits one of `skip`: "solver.kind=anm", a value or a
        pattern, several joined by " and "; a status ("timed out"; "left" for no ending yet); or the id of a case.
    failed : run only the cases that crashed or were stopped at a limit when they were run last, again.
    shard : "i/n": run every n-th case of the study's order, from the i-th on. n shards have all cases.
    plugins : component classes, and paths of files with such, whose kinds the study may name.

    The results have whatever is finished of the study, and a note says how much of it that is.
    An interruption loses only the cases that are running; the same call later runs those that are left.

    Raises StudyError for a study that is not valid and for settings that do not go together, StoreError for a folder
    that cannot hold its results.
    """
    study = study_of(study, overrides, quick, plugins)
    chosen_engine = engine_for(study.timing, isolation, jobs, debugger, engine, scheduler)
    portion = portion_of(study, only, skip, failed, shard)
    counter, counting = counter_for(study.timing, jobs), replace(study, timing=Timing(clock=study.timing.clock))
    again = {*retry, *portion.retry}
    early = None if out is None or counter is None else Store(Path(out), counting, again)
    store = None if out is None else Store(Path(out), study, again)
    chosen = None if portion.is_whole else portion.cases(study, None if store is None else store.ending)
    tell = listen or (lambda event: None)
    if store is not None and (unchanged := store.unchanged()) is not None:
        frames, notes = unchanged
        for number, (case, row) in enumerate(zip(study.cases, rows_of(frames.runs), strict=True), 1):
            tell(Event(case, number, len(study.cases), run=row, resumed=True))
        return Results(study, frames.runs, frames.steps, frames.fields, store.folder, notes)
    if study.timing.is_exclusive:
        counted = {} if counter is None else _taken(CountingTurns(counting, early, chosen), counter, tell)
        turns: Turns = ExclusiveTurns(study, store, chosen, counted)
    else:
        turns = Turns(study, store, chosen)
    parts = _taken(turns, chosen_engine, tell)
    frames = _merged(study, parts)
    told = (*(counter.notes if counter is not None else ()), *chosen_engine.notes)
    notes = (*told, *_unfinished(len(frames.runs), len(study.cases), bool(study.expectations)))
    if store is None:
        recorded = {case: part.iterates for case, part in parts.items() if len(part.iterates)}
        return Results(study, frames.runs, frames.steps, frames.fields, None, notes, recorded)
    notes += _show(store, study, frames, notes)
    store.mark_shown(notes)
    return Results(study, frames.runs, frames.steps, frames.fields, store.folder, notes)


def _taken(turns: Turns, engine: Engine, tell: Listener) -> dict[str, Part]:
    """The parts of a study when all turns have been taken; its folder has the frames also where a run is ended."""
    written = time.monotonic()
    try:
        with closing(engine.parts(turns.each(tell), turns.timing, tell)) as ended:
            for turn, again in ended:
                part = turns.end(turn, again)
                if turns.store is not None and time.monotonic() - written > SECONDS_BETWEEN_FRAMES:
                    turns.store.write_frames(_merged(turns.study, turns.gather()))
                    written = time.monotonic()
                tell(turn.event(run=part.run))
    finally:
        parts = turns.gather()
        turns.close()
        if turns.store is not None:
            turns.store.write_frames(_merged(turns.study, parts))
    return parts


def load(folder: str | Path) -> Results:
    """The results in a folder, of whatever is finished of the study that it was last used for.

    No study file is needed: the `study` of the results has tables and figures, but no cases. Where the folder's
    description of its study is damaged, all its cases are given that one source has computed.

    Raises StoreError when there are none.
    """
    place = Path(folder)
    Parts(place).refuse_old()
    described = description_of(place)
    planned = described.cases if described is not None else of_one_source(place)
    frames = finished(place, planned)
    if not len(frames.runs):
        raise StoreError(f"{folder}: no finished cases can be read there")
    study = Study(place.name, "", ()) if described is None else described.study()
    notes = _unfinished(len(frames.runs), len(planned))
    return Results(study, frames.runs, frames.steps, frames.fields, place, notes)


def study_of(
    study: Study | str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None,
    quick: bool,
    plugins: Iterable[Plugin] = (),
) -> Study:
    """`study` itself, or the study in a dictionary or a TOML file.

    Raises StudyError for a study or a plugin that is not valid, and for a `Study` given together with `overrides`,
    `quick` or `plugins`.
    """
    brought = tuple(plugins)
    if isinstance(study, Study):
        if overrides or quick or brought:
            sentence = "overrides, quick and plugins are applied when a study is read, not when it is run"
            raise StudyError(f"{study.name}: {sentence}")
        return study
    registry = with_plugins(load_registry(), brought) if brought else None
    if isinstance(study, Mapping):
        return Study.from_dict(study, overrides, quick, registry)
    return Study.from_toml(study, overrides, quick, registry)


def _merged(study: Study, parts: Mapping[str, Part]) -> Frames:
    frames = merge([parts[case.id] for case in study.cases if case.id in parts])
    references = {case.id: case.reference for case in study.cases if case.reference}
    return completed(frames, references)


def _unfinished(finished: int, planned: int, judges: bool = False) -> tuple[str, ...]:
    """A sentence on how much of a study is finished; none when all of it is. judges : whether it expects a finding."""
    later = "; what the study expects is judged when all are" if judges else ""
    return (f"{finished} of {planned} cases are finished{later}",) if finished < planned else ()


def provenance_of(study: Study, folder: Path) -> Provenance:
    """Where what is shown of a study comes from, whose results are in this folder."""
    return Provenance.today(study.name, f"{study.command} --out {shlex.quote(str(folder))}" if study.command else "")


def _show(store: Store, study: Study, frames: Frames, remarks: Sequence[str]) -> tuple[str, ...]:
    """Write tables, figures and the report. Returns a sentence for each that cannot be shown; the results stay.

    remarks : what is said of the results as a whole.
    """
    report = import_module("nlsolve.show.report")  # loads jinja2, which a run with nothing to show does without
    tables, notes = built(study.tables, frames.runs)
    provenance = provenance_of(study, store.folder)
    if tables:
        store.write_text(f"tables/{PREAMBLE_FILE}", PREAMBLE)
    shown: dict[str, pd.DataFrame] = {}
    beneath: dict[str, tuple[str, ...]] = {}
    for table in tables:
        for ending, text in table.files(provenance).items():
            store.write_text(f"tables/{table.spec.name}{ending}", text)
        frames_shown = {
            title if title not in shown else f"{title} ({table.spec.name})": frame
            for title, frame in table.flat().items()
        }
        shown |= frames_shown
        beneath[list(frames_shown)[-1]] = table.notes
    pictures: list[Any] = []
    with store.writing():
        for spec in study.figures:
            caption = spec.caption or spec.name
            try:
                written = write(spec, frames, store.folder / "figures", provenance)
            except FigureError as error:
                notes.append(str(error))
                pictures.append(report.Picture(spec.name, caption))
                continue
            notes += written.notes
            caption = " ".join((caption, *spec.on_seconds(frames.runs)))
            files = tuple(f"figures/{path.name}" for path in written.paths)
            pictures.append(report.Picture(spec.name, caption, written.png, written.inches, written.moving, files))
        environments = environments_of(store.parts, frames.runs)
        left_out = [(excluded.label, excluded.reason) for excluded in study.excluded]
        findings = Results(study, frames.runs, frames.steps, frames.fields).findings
        report.write_report(
            store.folder,
            study.question,
            shown,
            pictures,
            frames.runs,
            environments,
            findings,
            left_out,
            beneath,
            provenance,
            (*remarks, *notes),
            list(dict.fromkeys(name for case in study.cases for name in case.swept)),
        )
    return tuple(notes)
