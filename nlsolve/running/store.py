"""A results folder: the part of every finished case, the frames of all cases, and the description of the study."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_object_dtype
from pyarrow import ArrowException

from nlsolve.contracts.status import InputError
from nlsolve.results.columns import FIELDS, RUNS, STEPS
from nlsolve.results.frames import Frames, Part, rows_of
from nlsolve.running.retry import lacks_something
from nlsolve.show.tables import TableSpec
from nlsolve.study.limits import Limits
from nlsolve.study.study import Study

STUDY, CASES = "study.json", "cases"
"""Names of the file that describes the study, and of the folder of parts."""


class StoreError(InputError):
    """A results folder cannot be used; the sentence says why, and what to do."""


def output_file(folder: Path, case: str) -> Path:
    """The file of a results folder that holds what a case has printed; it is there when there is something."""
    return folder / CASES / f"{case}.txt"


def merge(parts: list[Part]) -> Frames:
    """The frames of several cases; `runs` has the documented columns first, then the parameters."""
    names = list(dict.fromkeys([*RUNS, *(name for part in parts for name in part.run)]))
    runs = pd.DataFrame([part.run for part in parts], columns=names)
    steps, fields = _stacked([part.steps for part in parts], STEPS), _stacked([part.fields for part in parts], FIELDS)
    return Frames(runs, steps, fields)


class Store:
    """The results folder of one study. Raises StoreError when it belongs to another study or cannot be written."""

    def __init__(self, folder: Path, study: Study) -> None:
        self.folder, self.study = folder, study
        identity = _identity(study)
        with self.writing():
            (folder / CASES).mkdir(parents=True, exist_ok=True)
        if (folder / STUDY).exists():
            found = _read_study(folder)
            if _unlimited(found) != _unlimited(identity) or found.get("question") != identity["question"]:
                raise StoreError(
                    f"{folder}: the folder holds results of another study, or of this one with other settings "
                    f"({found.get('question', 'no question')!r}): choose another folder with --out, or remove this one"
                )
        self.write_text(STUDY, json.dumps(identity, indent=1, ensure_ascii=False) + "\n")

    def load(self, case: str) -> Part | None:
        """The part of a finished case; None when there is none, it is damaged, or its case is to be tried again."""
        try:
            runs, steps, fields = (pd.read_parquet(self._part(case, name)) for name in ("runs", "steps", "fields"))
            (run,) = rows_of(runs)
            usable = run["case"] == case and not lacks_something(run)
        except (OSError, ValueError, KeyError, ArrowException):
            return None
        return Part(run, steps, fields) if usable else None

    def save(self, part: Part) -> None:
        """Write a part, and what its case has printed. Its row is written last: a part with a row is complete."""
        case = part.run["case"]
        if part.output:
            self.write_text(str(output_file(Path(), case)), part.output)
        else:
            with self.writing():
                output_file(self.folder, case).unlink(missing_ok=True)
        self._parquet(self._part(case, "fields"), part.fields)
        self._parquet(self._part(case, "steps"), part.steps)
        self._parquet(self._part(case, "runs"), pd.DataFrame([part.run]))

    def write_frames(self, frames: Frames) -> None:
        """Write runs and steps as parquet and CSV, fields as parquet."""
        for name, frame in (("runs", frames.runs), ("steps", frames.steps)):
            self._parquet(self.folder / f"{name}.parquet", frame)
            self.write_text(f"{name}.csv", frame.to_csv(index=False))
        self._parquet(self.folder / "fields.parquet", frames.fields)

    def write_text(self, name: str, text: str) -> None:
        """Write a text file whole or not at all."""
        with self._replacing(self.folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def _parquet(self, path: Path, frame: pd.DataFrame) -> None:
        with self._replacing(path) as temporary:
            _storable(frame).to_parquet(temporary, index=False)

    def _part(self, case: str, name: str) -> Path:
        return self.folder / CASES / f"{case}.{name}.parquet"

    @contextmanager
    def _replacing(self, path: Path) -> Iterator[Path]:
        """A temporary file to write to, which takes the place of `path` when it is complete."""
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        with self.writing():
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                yield temporary
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn a failure of the file system into a StoreError."""
        try:
            yield
        except OSError as error:
            reason = error.strerror or str(error)
            raise StoreError(
                f"{self.folder}: the results cannot be written there ({reason}): choose another folder with --out"
            ) from error


def read_tables(folder: Path) -> tuple[list[TableSpec], pd.DataFrame]:
    """The tables declared by the study of a results folder, and its runs. Raises StoreError if they cannot be read."""
    document = _read_study(folder)
    try:
        runs = pd.read_parquet(folder / "runs.parquet")
    except (OSError, ValueError, ArrowException) as error:
        raise StoreError(f"{folder}: no finished cases can be read there: run the study again with --out") from error
    return [TableSpec.model_validate(table) for table in document.get("tables", [])], runs


def _read_study(folder: Path) -> dict[str, Any]:
    try:
        document = json.loads((folder / STUDY).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"{folder}: not a results folder: it has no readable {STUDY}") from error
    if not isinstance(document, dict):
        raise StoreError(f"{folder}: not a results folder: its {STUDY} was written by something else")
    return document


def _identity(study: Study) -> dict[str, Any]:
    """The description of a study that its folder holds; a run is resumed if question and cases are the same."""
    return {
        "name": study.name,
        "question": study.question,
        "cases": {case.id: dict(case.parameters) for case in study.cases},
        "tables": [table.model_dump(mode="json") for table in study.tables],
    }


def _unlimited(identity: dict[str, Any]) -> dict[str, Any]:
    """The parameters of each case but its limits, which may be changed for the cases that are left."""
    return {
        case: {name: value for name, value in parameters.items() if not name.startswith(f"{Limits.noun}.")}
        for case, parameters in identity.get("cases", {}).items()
    }


def _stacked(frames: list[pd.DataFrame], columns: Iterable[str]) -> pd.DataFrame:
    filled = [frame for frame in frames if len(frame)]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=list(columns))


def _storable(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with one type a column: a parameter with numbers in some cases and words in others becomes words."""
    mixed = []
    for name, column in frame.items():
        types = {type(value) for value in column.dropna()} if is_object_dtype(column) else set()
        if len(types) > 1 and not types <= {int, float}:
            mixed.append(name)
    return frame.assign(**{str(name): frame[name].map(str, na_action="ignore") for name in mixed})
