"""The three result frames of a study."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd


@dataclass(frozen=True)
class Frames:
    """The three result frames, as documented in `nlsolve.results.columns`."""

    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame
