"""The three result frames of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from nlsolve.results.columns import NOTE, STEPS


@dataclass(frozen=True)
class Frames:
    """The three result frames, as documented in `nlsolve.results.columns`."""

    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame


def steps_frame(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The rows of one case's `steps`: the documented columns but the case's identity, then the notes of its method."""
    documented = [name for name in STEPS if name != "case"]
    notes = dict.fromkeys(name for row in rows for name in row if name.startswith(NOTE))
    return pd.DataFrame(rows, columns=[*documented, *notes])
