"""Study -> results: every case is run once, on one thread, and every ending becomes a row."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from nlsolve.contracts.linear_solver import LinearSolver
from nlsolve.contracts.status import SolveError, Status
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.costs.cost_prediction import UNITS, with_predictions
from nlsolve.results.frames import Frames
from nlsolve.results.reference_error import with_reference_errors
from nlsolve.results.verdicts import number
from nlsolve.running.store import Part, Store, merge
from nlsolve.running.timing import CLOCKS, measure
from nlsolve.show.expectations import Finding, judged
from nlsolve.show.figures import FigureError, draw, save
from nlsolve.show.report import write_report
from nlsolve.show.tables import Table, build
from nlsolve.solving.simulate import Progress, Record, crashed, run_case
from nlsolve.study.case import Case
from nlsolve.study.study import Study
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


SECONDS_BETWEEN_FRAMES = 10.0
"""Least time between two writings of the merged frames [s]; the part of a case is saved as soon as the case ends."""

Listener = Callable[[Event], None]


@dataclass(frozen=True)
class Results:
    """The results of a study.

    runs, steps, fields : tidy frames; `nlsolve.results.columns` says what every column means.
    folder : the results folder; None if the results are in memory only.
    notes : one sentence for each table or figure that could not be shown, with the reason.
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

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the study expects to find, and whether these runs bear it out."""
        return judged(self.study.expectations, self.study.tables, self.runs)

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
) -> Results:
    """Run every case of a study that has not been run before, and keep the results in `out` (None: in memory).

    An interruption loses only the case that is running; the same call later runs the cases that are left. Cases that
    crashed, or whose method did not apply, are run again. `listen` is called with each `Event`.

    Raises StudyError for a study that is not valid, StoreError for a folder that cannot hold its results.
    """
    study = study_of(study, overrides, quick)
    store = None if out is None else Store(Path(out), study)
    tell = listen or (lambda event: None)
    parts = _finished(study, store)
    turns = [(turn, case) for turn in range(1, study.timing.rounds + 1) for case in study.cases]
    written = time.monotonic()
    try:
        for position, (turn, case) in enumerate(turns, 1):
            begun = Event(case, position, len(turns))
            resumed = case.id in parts and _rounds(parts[case.id], study.timing) >= turn
            if not resumed:
                tell(begun)
                again = execute(case, position, len(turns), tell, study.timing)
                parts[case.id] = _fastest(parts.get(case.id), again, study.timing)
                if store is not None:
                    store.save(parts[case.id])
                    if time.monotonic() - written > SECONDS_BETWEEN_FRAMES:
                        store.write_frames(_merged(study, parts))
                        written = time.monotonic()
            tell(Event(case, position, len(turns), run=parts[case.id].run, resumed=resumed))
    finally:
        if store is not None:
            store.write_frames(_merged(study, parts))
    frames = _merged(study, parts)
    if store is None:
        return Results(study, frames.runs, frames.steps, frames.fields)
    return Results(study, frames.runs, frames.steps, frames.fields, store.folder, _show(store, study, frames))


def execute(case: Case, number: int, cases: int, tell: Listener, timing: Timing) -> Part:
    """Run one case. Every exception becomes a row that says so; an interruption (KeyboardInterrupt) is passed on."""
    try:
        with threadpool_limits(limits=1):
            clock = CLOCKS[timing.clock]

            def listen(progress: Progress) -> None:
                tell(Event(case, number, cases, progress=progress))

            record = run_case(case.parts, listen, clock)
            units = unit_costs(record, case.parts.linear, clock) if timing.calibrate else {}
    except Exception as error:  # the one boundary at which a crash turns into a result
        summary: dict[str, Any] = crashed(error)
        steps = fields = pd.DataFrame()
    else:
        timed = {"rounds": 1, "seconds_most": record.summary.get("seconds"), "clock": timing.clock}
        summary, steps, fields = {**record.summary, **timed, **units}, record.steps, record.fields
    row = {"case": case.id, **summary, **case.parameters}
    return Part(row, _of_case(case.id, steps), _of_case(case.id, fields))


def unit_costs(record: Record, linear: LinearSolver, clock: Callable[[], float]) -> dict[str, float]:
    """Unit costs of the work on a case's last problem, as columns of `runs`; NaN if they cannot be measured."""
    nothing = dict.fromkeys(UNITS, float("nan"))
    if record.problem is None or record.state is None:
        return nothing
    try:
        return measure(record.problem, linear, record.state, clock=clock).columns()
    except SolveError:  # the last tangent cannot be factorised, which the status of the case tells
        return nothing


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


def _finished(study: Study, store: Store | None) -> dict[str, Part]:
    if store is None:
        return {}
    loaded = {case.id: store.load(case.id) for case in study.cases}
    return {case: part for case, part in loaded.items() if part is not None}


def _merged(study: Study, parts: Mapping[str, Part]) -> Frames:
    frames = merge([parts[case.id] for case in study.cases if case.id in parts])
    references = {case.id: case.reference for case in study.cases if case.reference}
    frames = with_reference_errors(frames, references)
    return replace(frames, runs=with_predictions(frames.runs))


def _of_case(case: str, frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with a first column `case`; without rows, a frame without columns."""
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
