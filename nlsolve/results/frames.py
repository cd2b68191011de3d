"""The three result frames of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.results.columns import NOTE, STEPS
from nlsolve.series import Array

Row = dict[str, Any]
"""A row of a frame, or of a table, by the names of its columns."""


@dataclass(frozen=True)
class Frames:
    """The three result frames, as documented in `nlsolve.results.columns`."""

    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame


@dataclass(frozen=True)
class Part:
    """The results of one case: its row of `runs`, its rows of `steps` and of `fields`.

    environment : what it was computed with, such as versions and processor; its row has the digest of it.
    iterates : the state of each row of `steps`, where the study asks for them; see `iterates_frame`.
    output : what the case has printed, cut in the middle where it is long; empty where nobody has listened.
    rounds : of a case in the exclusive lane, what each round has measured: columns of `runs`.
    startup : how long the case has waited for a process of its own that had to be started for it [s].
    """

    run: Row
    steps: pd.DataFrame
    fields: pd.DataFrame
    environment: Mapping[str, str] = field(default_factory=dict)
    iterates: pd.DataFrame = field(default_factory=pd.DataFrame)
    output: str = ""
    rounds: tuple[Row, ...] = ()
    startup: float = 0.0


def steps_frame(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The rows of one case's `steps`: the documented columns but the case's identity, then the notes of its method."""
    documented = [name for name in STEPS if name != "case"]
    notes = dict.fromkeys(name for row in rows for name in row if name.startswith(NOTE))
    return pd.DataFrame(rows, columns=[*documented, *notes])


def iterates_frame(states: Sequence[Array]) -> pd.DataFrame:
    """One column `value` with the entries of K states (U,), state after state; the number of states is K of the rows of
    `steps`.
    """
    return pd.DataFrame({"value": np.concatenate(states)}) if states else pd.DataFrame()


def rows_of(frame: pd.DataFrame) -> list[Row]:
    """The rows of a frame, in their order, every value with its type."""
    names = [str(name) for name in frame.columns]
    columns = [frame.iloc[:, place].to_numpy(dtype=object).tolist() for place in range(len(names))]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def json_rows(frame: pd.DataFrame) -> list[Row]:
    """The rows of a frame as JSON can hold them, at full precision: null for ±∞ and for what is missing.

    `DataFrame.to_json` writes 15 decimals, which leave a residual of 1.234e-14 two digits.
    """
    finite = frame.replace([float("inf"), -float("inf")], float("nan")).astype(object)
    found = finite.where(finite.notna(), None).to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in found]
