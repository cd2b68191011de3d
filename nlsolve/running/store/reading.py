"""A results folder read without running anything: the study it was last used for, and whatever is finished of it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from pyarrow import ArrowException
from pydantic import TypeAdapter, ValidationError

from nlsolve.contracts.status import STOPPED, Status
from nlsolve.results.costs.cost_prediction import with_predictions
from nlsolve.results.costs.lanes import EXCLUSIVE
from nlsolve.results.frames import Frames, Part
from nlsolve.results.parameters import names_settings
from nlsolve.results.reference_error import with_reference_errors
from nlsolve.results.verdicts import status_of
from nlsolve.running.store.claims import claimed
from nlsolve.running.store.identity import Identity, case_of
from nlsolve.running.store.parts import CASES, Entry, Parts, StoreError, merge, output_path
from nlsolve.running.store.sources import fingerprint, source_of
from nlsolve.show.figures import BaseFigure, FigureSpec
from nlsolve.show.tables import TableSpec
from nlsolve.study.case import Case
from nlsolve.study.study import Study

STUDY, SHOWN = "study.json", "shown.json"
"""Names of the files that describe the study which a folder was last used for, and what was shown of it."""

FIGURES: TypeAdapter[tuple[BaseFigure, ...]] = TypeAdapter(tuple[FigureSpec, ...], config={"defer_build": True})

VIEWS = ("results", "show")
"""What of nlsolve makes tables, figures and the report."""


@dataclass(frozen=True)
class Planned:
    """A case of a plan: the name of its part, the names of its settings, and its reference case."""

    key: str
    names: Mapping[str, str]
    reference: str


@dataclass(frozen=True)
class Description:
    """The study which a folder was last used for."""

    name: str
    question: str
    cases: tuple[Planned, ...]
    tables: tuple[TableSpec, ...]
    figures: tuple[BaseFigure, ...] = ()
    command: str = ""

    def study(self) -> Study:
        """The study with its tables and figures, without its cases."""
        return Study(self.name, self.question, (), self.tables, self.figures, command=self.command)


def describe(study: Study, identities: Mapping[str, Identity]) -> dict[str, Any]:
    """A study as its folder describes it, in JSON values; parts are named where their identities are given."""
    return {
        "name": study.name,
        "question": study.question,
        "command": study.command,
        "cases": [
            {
                "key": identities[case.id].key if case.id in identities else case.id,
                "names": names_in(case),
                "reference": case.reference,
            }
            for case in study.cases
        ],
        "tables": [table.model_dump(mode="json") for table in study.tables],
        "figures": [figure.model_dump(mode="json") for figure in study.figures],
    }


def names_in(case: Case) -> dict[str, str]:
    """The names of a case's settings, by the column that holds them."""
    return {name: word for name, word in case.parameters.items() if names_settings(name)}


def description_of(folder: Path) -> Description | None:
    """The study which a folder was last used for; None when its description is missing or damaged."""
    try:
        document = json.loads((folder / STUDY).read_text(encoding="utf-8"))
        cases = tuple(Planned(**case) for case in document["cases"])
        tables = tuple(TableSpec.model_validate(table) for table in document["tables"])
        figures = FIGURES.validate_python(document.get("figures", []))
        command = str(document.get("command", ""))
        return Description(document["name"], document["question"], cases, tables, figures, command)
    except (OSError, ValueError, TypeError, KeyError, ValidationError):
        return None


def something_else(folder: Path) -> bool:
    """Whether a folder without parts has a description that another program must have written."""
    try:
        return not (folder / CASES).exists() and not isinstance(json.loads((folder / STUDY).read_text("utf-8")), dict)
    except ValueError:
        return True
    except OSError:
        return False


def of_one_source(folder: Path) -> tuple[Planned, ...]:
    """The parts of a folder whose study is not known, under the names they were run by: those that agree with all
    later ones on the source of every package and the contents of every file.
    """
    parts = Parts(folder)
    entries = [entry for key in parts.names() if (entry := parts.entry(key)) is not None]
    known: dict[str, str] = {}
    found: list[Planned] = []
    for entry in sorted(entries, key=lambda entry: entry.written, reverse=True):
        needs = {**entry.identity.code, **entry.identity.files}
        if all(known.setdefault(name, content) == content for name, content in needs.items()):
            names = {name: str(word) for name, word in entry.parameters.items() if names_settings(name)}
            found.append(Planned(entry.identity.key, names, ""))
    return tuple(reversed(found))


def output_file(folder: Path, case: str) -> Path | None:
    """The file that holds what a case of the folder's study has printed; None when it has printed nothing."""
    described = description_of(folder)
    keys = [planned.key for planned in described.cases if case_of(planned.key) == case] if described else []
    return next((path for key in keys if (path := output_path(folder, key)).exists()), None)


def iterates_in(folder: Path, case: str) -> pd.DataFrame:
    """The iterates of a case of the folder's study; no rows where they were not recorded."""
    described = description_of(folder)
    keys = [planned.key for planned in described.cases if case_of(planned.key) == case] if described else []
    parts = Parts(folder)
    found = (parts.iterates(entry) for key in keys if (entry := parts.entry(key)) is not None)
    return next(found, pd.DataFrame())


def is_results_folder(folder: Path) -> bool:
    """Whether a folder has parts, or a place for them."""
    return (folder / CASES).is_dir()


@dataclass(frozen=True)
class FolderStatus:
    """How far a folder is, told from its parts and claims alone.

    study : what it was last used for; None when that cannot be read, and then all parts count as planned.
    endings : status -> number of planned cases that ended so.
    failures : case -> message, of those that stopped on an error or at a limit.
    running : names of the parts that are being computed now.
    left : number of planned cases without a part that nobody is computing.
    others : number of parts of other studies, other settings or earlier sources.
    """

    study: Description | None
    planned: int
    endings: Mapping[str, int]
    failures: Mapping[str, str]
    running: tuple[str, ...]
    left: int
    others: int


def status_of_folder(folder: Path) -> FolderStatus:
    """How far a folder is. Raises StoreError when it is no results folder."""
    Parts(folder).refuse_old()
    if not is_results_folder(folder):
        raise StoreError(f"{folder}: not a results folder: it has no folder {CASES!r}")
    parts, described = Parts(folder), description_of(folder)
    names = parts.names()
    planned = [case.key for case in described.cases] if described is not None else names
    entries = [entry for key in planned if (entry := parts.entry(key)) is not None]
    running = tuple(key for key in claimed(folder) if key != EXCLUSIVE)
    done = {entry.identity.key for entry in entries}
    return FolderStatus(
        described,
        len(planned),
        _endings(entries),
        {
            entry.identity.case: str(entry.measured.get("message"))
            for entry in entries
            if status_of(entry.measured) in {Status.CRASHED, *STOPPED}
        },
        running,
        len(set(planned) - done - set(running)),
        len(set(names) - set(planned)),
    )


def _endings(entries: Sequence[Entry]) -> dict[str, int]:
    """How many cases have ended with which status, in the order of `Status`, then of the alphabet."""
    found = Counter(str(entry.measured["status"]) for entry in entries)
    known = [status.word for status in Status if status.word in found]
    return {word: found[word] for word in (*known, *sorted(found.keys() - known))}


def shown_of(study: Study, entries: Iterable[Entry]) -> str:
    """A digest of all that the tables, figures and report of a study are made from."""
    rows = [[entry.identity.key, entry.written] for entry in entries]
    told = [repr(thing) for thing in (*study.figures, *study.expectations, *study.excluded)]
    views = [describe(study, {}), told, rows, source_of(VIEWS)]
    return fingerprint(json.dumps(views).encode())


def read_shown(folder: Path, digest: str) -> tuple[Frames, tuple[str, ...]] | None:
    """The frames but `runs`, which the parts have, and the notes of a run after which `digest` was the same.

    None when it was not, or when a file that was written then is gone or damaged.
    """
    try:
        document = json.loads((folder / SHOWN).read_text(encoding="utf-8"))
        if document["digest"] != digest or not all((folder / name).is_file() for name in document["files"]):
            return None
        steps, fields = (pd.read_parquet(folder / f"{name}.parquet") for name in ("steps", "fields"))
        return Frames(pd.DataFrame(), steps, fields), tuple(document["notes"])
    except (OSError, ValueError, TypeError, KeyError, ArrowException):
        return None


def completed(frames: Frames, references: Mapping[str, str]) -> Frames:
    """Frames with the columns of `runs` that compare cases: distance from the reference, predicted seconds."""
    frames = with_reference_errors(frames, references)
    return replace(frames, runs=with_predictions(frames.runs))


def finished(folder: Path, cases: tuple[Planned, ...], with_frames: bool = True) -> Frames:
    """The frames of those cases that are finished; of `runs` alone unless other frames are asked for or needed."""
    parts = Parts(folder)
    references = {case_of(case.key): case.reference for case in cases if case.reference}
    nothing = pd.DataFrame()
    found = []
    for case in cases:
        entry = parts.entry(case.key)
        if entry is None:
            continue
        frames = parts.frames(entry) if with_frames or references else (nothing, nothing)
        if frames is not None:
            found.append(Part(entry.run(case.names), *frames))
    return completed(merge(found), references)


def environments_of(parts: Parts, runs: pd.DataFrame) -> dict[str, Mapping[str, str]]:
    """Name -> environment of every environment in which rows of `runs` were computed."""
    return {str(name): parts.environment(str(name)) for name in runs["environment"].dropna().unique()}


def read_tables(folder: Path) -> tuple[Description, pd.DataFrame]:
    """The study which a folder was last used for, and the runs of it that are finished.

    Raises StoreError if there is no such study, or nothing of it is finished.
    """
    Parts(folder).refuse_old()
    described = description_of(folder)
    if described is None and is_results_folder(folder):
        raise StoreError(
            f"{folder}: its {STUDY} cannot be read, which has the tables; no case is lost: run the study again with "
            f"--out {folder}"
        )
    if described is None:
        raise StoreError(f"{folder}: not a results folder: it has no readable {STUDY}")
    runs = finished(folder, described.cases, with_frames=False).runs
    if not len(runs):
        raise StoreError(f"{folder}: no finished cases can be read there: run the study again with --out {folder}")
    return described, runs
