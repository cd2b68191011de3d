"""The parts of a results folder: all that is known of each finished case, in files of its own.

    cases/KEY.json               its identity, its row of `runs`, and how long its frames are; written last
    cases/KEY.steps.parquet      its rows of `steps`, if it has any
    cases/KEY.fields.parquet     its rows of `fields`, if it has any
    cases/KEY.iterates.parquet   the state of each of its rows of `steps`, if the study asks for them
    cases/KEY.txt                what it has printed, if anything
    environments/NAME.json       where rows were computed, once for all rows that share it

A part whose JSON is there is complete. Every file is written beside its place and then moved there, so none is torn.
"""

from __future__ import annotations

import json
import math
import os
import secrets
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_object_dtype
from pyarrow import ArrowException
from pydantic_core import from_json

from nlsolve.contracts.status import InputError
from nlsolve.results.columns import FIELDS, RUNS, STEPS
from nlsolve.results.frames import Frames, Part, Row
from nlsolve.results.parameters import names_settings
from nlsolve.results.verdicts import status_of
from nlsolve.running.store.environment import name_of
from nlsolve.running.store.identity import Identity

CASES, ENVIRONMENTS, WAYS = "cases", "environments", "ways"
"""Names of the folders of parts, of environments and of ways to first states (`nlsolve.running.ways`)."""

OLD_PART = ".runs.parquet"
"""How the name of a part ended before parts knew their source."""

PARTIAL = ".partial"
"""How the name of a file ends that is being written, or was when its writer died."""


class StoreError(InputError):
    """A results folder cannot be used; the sentence says why, and what to do."""


@dataclass(frozen=True)
class Entry:
    """What the JSON of a part holds.

    measured : its row of `runs` without parameters; parameters : those, and the names of settings it was first run by.
    frames : name -> size [bytes] of each frame that has a file.
    written : when, in seconds since 1970.
    elapsed : seconds from the start of the case until it was written, less `startup` [s]; NaN where that is not known.
    rounds, startup : see `Part`.
    way : how much of `elapsed` the way to its first state took, where this case has solved it [s].
    """

    identity: Identity
    measured: Row
    parameters: Row
    frames: Mapping[str, int]
    written: float
    elapsed: float = math.nan
    rounds: Sequence[Row] = ()
    startup: float = 0.0
    way: float = 0.0

    def run(self, names: Mapping[str, str]) -> Row:
        """The row of `runs` under other names of settings."""
        dotted = {name: value for name, value in self.parameters.items() if not names_settings(name)}
        return {"case": self.identity.case, **self.measured, **names, **dotted}


class Parts:
    """The parts in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._cases = folder / CASES

    def names(self) -> list[str]:
        """The names of all parts, complete or damaged."""
        return sorted(name.removesuffix(".json") for name in self._listed() if name.endswith(".json"))

    def refuse_old(self) -> None:
        """Raises StoreError for a folder with parts of an nlsolve that did not keep by which source they were made."""
        if any(name.endswith(OLD_PART) for name in self._listed()):
            raise StoreError(
                f"{self.folder}: the folder was written by an older nlsolve, which did not keep the source that its "
                "numbers come from: choose another folder with --out, or remove this one"
            )

    def entry(self, key: str) -> Entry | None:
        """What the JSON of a part holds; None when there is none, or it or one of its frames is damaged."""
        try:
            held = from_json(self._path(key, "json").read_bytes())
            entry = Entry(**{**held, "identity": Identity(**held["identity"])})
            status_of(entry.measured)
            whole = all(self._frame(key, name).stat().st_size == size for name, size in entry.frames.items())
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
            return None
        return entry if whole and entry.identity.key == key else None

    def frames(self, entry: Entry) -> tuple[pd.DataFrame, pd.DataFrame] | None:
        """The rows of `steps` and `fields` of a part; None when they are damaged."""
        paths = {name: self._frame(entry.identity.key, name) for name in entry.frames}
        try:
            steps, fields = (
                pd.read_parquet(paths[name]) if name in paths else pd.DataFrame() for name in ("steps", "fields")
            )
        except (OSError, ValueError, ArrowException):
            return None
        return steps, fields

    def iterates(self, entry: Entry) -> pd.DataFrame:
        """The iterates of a part; no rows where they were not recorded, or are damaged."""
        if "iterates" not in entry.frames:
            return pd.DataFrame()
        try:
            return pd.read_parquet(self._frame(entry.identity.key, "iterates"))
        except (OSError, ValueError, ArrowException):
            return pd.DataFrame()

    def save(
        self,
        identity: Identity,
        part: Part,
        parameters: Mapping[str, Any],
        elapsed: float = math.nan,
        way: float = 0.0,
    ) -> None:
        """Write a part. Its JSON is written last. elapsed, way : see `Entry`."""
        measured = {name: value for name, value in part.run.items() if name not in {"case", *parameters}}
        sizes = {}
        for name, frame in (("steps", part.steps), ("fields", part.fields), ("iterates", part.iterates)):
            if len(frame):
                path = self._frame(identity.key, name)
                write_frame(self.folder, path, frame)
                sizes[name] = path.stat().st_size
        output = output_path(self.folder, identity.key)
        if part.output:
            write_text(self.folder, output, part.output)
        else:
            with writing(self.folder):
                output.unlink(missing_ok=True)
        self._keep(part.environment)
        held = {
            "identity": identity.plain(),
            "measured": measured,
            "parameters": dict(parameters),
            "frames": sizes,
            "written": time.time(),
            **({"elapsed": elapsed, "way": way} if math.isfinite(elapsed) else {}),
            "rounds": part.rounds,
            "startup": part.startup,
        }
        write_text(self.folder, self._path(identity.key, "json"), json.dumps(held, default=_plain))

    def environment(self, name: str) -> Mapping[str, str]:
        """A stored environment; empty when there is none of this name."""
        try:
            found = json.loads((self.folder / ENVIRONMENTS / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}

    def _keep(self, environment: Mapping[str, str]) -> None:
        name = name_of(environment)
        path = self.folder / ENVIRONMENTS / f"{name}.json"
        if name and not path.exists():
            write_text(self.folder, path, json.dumps(dict(environment), indent=1, ensure_ascii=False) + "\n")

    def _frame(self, key: str, name: str) -> Path:
        return self._path(key, f"{name}.parquet")

    def _path(self, key: str, ending: str) -> Path:
        return self._cases / f"{key}.{ending}"

    def _listed(self) -> list[str]:
        try:
            return [name for name in os.listdir(self._cases) if not name.startswith(".")]
        except OSError:
            return []


def output_path(folder: Path, key: str) -> Path:
    """Where the output of a case is kept, if it has printed anything."""
    return folder / CASES / f"{key}.txt"


def merge(parts: list[Part]) -> Frames:
    """The frames of several cases; `runs` has the documented columns first, then the parameters."""
    names = list(dict.fromkeys([*RUNS, *(name for part in parts for name in part.run)]))
    runs = pd.DataFrame([part.run for part in parts], columns=names)
    steps, fields = _stacked([part.steps for part in parts], STEPS), _stacked([part.fields for part in parts], FIELDS)
    return Frames(runs, steps, fields)


def write_text(folder: Path, path: Path, text: str) -> None:
    """Write a text file of a results folder whole or not at all."""
    with replacing(folder, path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_frame(folder: Path, path: Path, frame: pd.DataFrame) -> None:
    """Write a frame of a results folder as parquet, whole or not at all."""
    with replacing(folder, path) as temporary:
        _storable(frame).to_parquet(temporary, index=False)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn a failure of the file system into a StoreError."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise StoreError(
            f"{folder}: the results cannot be written there ({reason}): choose another folder with --out"
        ) from error


@contextmanager
def replacing(folder: Path, path: Path) -> Iterator[Path]:
    """A temporary file to write to, which takes the place of `path` when it is complete."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}{PARTIAL}")
    with writing(folder):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def _plain(value: Any) -> Any:
    """A number of numpy as one of Python, and anything else that JSON does not know as its text."""
    return value.item() if isinstance(value, np.generic) else str(value)


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
