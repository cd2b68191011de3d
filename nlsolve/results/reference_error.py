"""‖v − v_ref‖₂/‖v_ref‖₂ : distance of every run from the reference case of its study."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from nlsolve.results.frames import Frames

REFERENCE = "reference"
"""The name of the section, and the `variant` of the cases it makes."""


def with_reference_errors(frames: Frames, references: Mapping[str, str]) -> Frames:
    """`runs` with the column `reference_error`: of the velocities of all nodes at the last recorded time.

    references : case -> its reference case. NaN where one of the two is missing or ended at another time.
    """
    if not references:
        return frames
    flows = frames.fields.dropna(subset="time") if "time" in frames.fields else frames.fields.iloc[:0]
    last = {str(case): _at_the_end(part) for case, part in flows.groupby("case", sort=False)}
    errors = [_error(last.get(case), last.get(references.get(case, ""))) for case in frames.runs["case"]]
    return Frames(frames.runs.assign(reference_error=errors), frames.steps, frames.fields)


def _at_the_end(fields: pd.DataFrame) -> pd.DataFrame:
    return fields[fields["time"] == fields["time"].max()]


def _error(run: pd.DataFrame | None, reference: pd.DataFrame | None) -> float:
    if run is None or reference is None or run["time"].iloc[0] != reference["time"].iloc[0]:
        return float("nan")
    exact = reference[["u", "v"]].to_numpy()
    return float(np.linalg.norm(run[["u", "v"]].to_numpy() - exact) / np.linalg.norm(exact))
