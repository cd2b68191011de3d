"""The sections `record` and `start` of a study: what is kept of a case, and a case that begins with what was kept."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from pyarrow import ArrowException
from pydantic import Field, model_validator

from nlsolve.contracts.component import Component, InputFile
from nlsolve.contracts.status import SolveError, Status
from nlsolve.series import Array


class IterateRecording(Component):
    """What is recorded of a case of any scene."""

    noun: ClassVar[str] = "record"
    incidental: ClassVar[frozenset[str]] = frozenset({"iterates"})

    iterates: bool = Field(
        default=False,
        description="keep the state of every row of `steps` beside the case, for results.iterates; a case that was run "
        "without is run again",
    )


class StoredState(Component):
    """The last state of a case in a results folder. Its file is an input of the case that begins with it: when it has
    changed, that case is run again. What has led to the stored state is not counted once more.
    """

    noun: ClassVar[str] = "stored"
    incidental: ClassVar[frozenset[str]] = frozenset({"file"})

    results: str = Field(min_length=1, description="a results folder, relative to the folder the study is run in")
    case: str = Field(min_length=1, description="identity of a case in it, from the column `case` of its results")
    file: InputFile = Field(default="", description="the file of that state, which follows from the two: leave it out")

    @model_validator(mode="before")
    @classmethod
    def _finds_its_file(cls, given: Any) -> Any:
        if not (isinstance(given, Mapping) and {"results", "case"} <= given.keys()):
            return given  # told by the mistakes in the fields
        cases = Path(str(given["results"])) / "cases"
        written = sorted(cases.glob(f"{given['case']}-*.fields.parquet"), key=lambda path: path.stat().st_mtime)
        return {**given, "file": str(written[-1] if written else cases / f"{given['case']}.fields.parquet")}

    def unknowns(self, size: int) -> Array:
        """u (U,), the state of a system of U = `size` unknowns. Raises SolveError where there is none of this size."""
        rows = self._rows()
        if "unknown" not in rows:
            raise self._refused("is of a flow, and this scene is a system: name a case of a system")
        if len(rows) != size:
            raise self._refused(f"has {len(rows)} unknowns, and this system has {size}: name a case of that size")
        return rows["value"].to_numpy(float)

    def velocity(self) -> tuple[Array, Array]:
        """Nodes (N, 2) [mm] and their velocities (N, 2) [mm/s]. Raises SolveError where there are none."""
        rows = self._rows()
        if "u" not in rows:
            raise self._refused("is of a system, and this scene is a flow: name a case of a flow")
        last = rows[rows["time"] == rows["time"].max()]
        return last[["x", "y"]].to_numpy(float), last[["u", "v"]].to_numpy(float)

    def _rows(self) -> pd.DataFrame:
        try:
            rows = pd.read_parquet(self.file)
        except (OSError, ValueError, ArrowException) as error:
            why = "is damaged" if Path(self.file).exists() else "is not there"
            raise self._refused(f"{why}: run the study of that folder, or name another case") from error
        values = rows[[name for name in ("value", "u", "v") if name in rows]].to_numpy(float)
        if not values.size or not np.isfinite(values).all():
            raise self._refused("is not finite: name a case that has converged")
        return rows

    def _refused(self, why: str) -> SolveError:
        return SolveError(Status.NOT_APPLICABLE, f"start.stored: the state of case {self.case} in {self.results} {why}")


class SystemStart(Component):
    """Where the solve of a system begins: at its own start, or at a stored state."""

    noun: ClassVar[str] = "start"

    stored: StoredState | None = Field(default=None, description="begin with the state of a case in a results folder")
