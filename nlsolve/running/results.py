"""The results of a study at hand: frames, tables, figures, and the states of its cases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from numpy.typing import ArrayLike
from pydantic import TypeAdapter, ValidationError

from nlsolve.contracts import notebook
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.results.frames import Frames
from nlsolve.results.states.exports import dataset, write_vtk
from nlsolve.results.states.snapshots import case_among, snapshot, state_of, values_at
from nlsolve.running.portions.portion import FAILED
from nlsolve.running.store.reading import iterates_in
from nlsolve.series import Array
from nlsolve.show.expectations import Finding, judged
from nlsolve.show.figures import FigureError, FigureSpec, draw
from nlsolve.show.tables import Table, build, built
from nlsolve.study.study import Study

if TYPE_CHECKING:
    import xarray

    from nlsolve.show import plotting


@dataclass(frozen=True, repr=False)
class Results:
    """The results of a study.

    runs, steps, fields : tidy frames; `nlsolve.results.columns` says what every column means.
    folder : the results folder; None if the results are in memory only.
    notes : one sentence for each table or figure that could not be shown, with the reason, and for each thing that was
        done otherwise than asked.
    recorded : case -> its iterates, of results in memory; those in a folder are read when they are asked for.
    """

    study: Study
    runs: pd.DataFrame
    steps: pd.DataFrame
    fields: pd.DataFrame
    folder: Path | None = None
    notes: tuple[str, ...] = ()
    recorded: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    @property
    def crashed(self) -> int:
        """How many cases stopped on an error in the program or in a plugin, or were stopped at a limit."""
        return int(self.runs["status"].isin([status.word for status in FAILED]).sum())

    @property
    def frames(self) -> Frames:
        """The three frames."""
        return Frames(self.runs, self.steps, self.fields)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the study expects to find, and whether these runs bear it out; nothing until all cases are finished."""
        if len(self.runs) < len(self.study.cases):
            return ()
        return judged(self.study.expectations, self.study.tables, self.runs)

    def tables(self) -> list[Table]:
        """The declared tables that these runs can fill; the others are in `notes`."""
        return built(self.study.tables, self.runs)[0]

    def table(self, name: str) -> pd.DataFrame:
        """The cells of a declared table. Raises StudyError if no table has this name or these runs cannot fill it."""
        for spec in self.study.tables:
            if spec.name == name:
                return build(spec, self.runs).cells
        names = [spec.name for spec in self.study.tables]
        raise StudyError(f"{self.study.name}: the study declares no table {name!r}; {did_you_mean(name, names)}")

    def at(self, case: str | int, points: ArrayLike, time: float | None = None) -> pd.DataFrame:
        """The fields of a flow at points (P, 2) [mm], a row for each, with the columns of `fields`.

        They are interpolated linearly between the nodes, on the triangles that figures are drawn on: exactly, where a
        field is linear. A point outside of the triangles, as in a hole, gets NaN.

        case : its identity, or its row in `runs`.
        time : a recorded time [s]; absent: the last.

        Raises StudyError for another case, time or shape, and for a system, whose state has no places.
        """
        return values_at(snapshot(self.fields, self._case(case), time), points)

    def state(self, case: str | int) -> Array:
        """u (U,), the state at which the solve of a system ended, however it ended (`status` tells that); of a flow the
        velocities (N, 2) of its nodes at the last recorded time [mm/s].

        Raises StudyError for a case that is not among the results, or has left no state.
        """
        return state_of(self.fields, self._case(case))

    def iterates(self, case: str | int) -> Array:
        """The states (K, U) of the K rows of `steps` of a case, which a study asks for with `record.iterates = true`.

        Raises StudyError for a case that is not among the results, and where its iterates were not recorded.
        """
        chosen = self._case(case)
        found = self.recorded.get(chosen, pd.DataFrame()) if self.folder is None else iterates_in(self.folder, chosen)
        if found.empty:
            raise StudyError(
                f"case {chosen}: its iterates were not recorded: run the study with record = {{ iterates = true }}"
            )
        return found["value"].to_numpy(float).reshape(int((self.steps["case"] == chosen).sum()), -1)

    def plot(self, kind: str, **keys: Any) -> plotting.Figure:
        """A figure of these results: one that the study declares, by its name, or a new one of a kind, with the keys
        of a `[[figure]]`: `results.plot("field", value="rate")`. `savefig` writes it, a notebook shows it.

        Raises StudyError for a kind or a key that is none, and for a figure that these results cannot fill.
        """
        declared = {figure.name: figure for figure in self.study.figures}
        try:
            if kind in declared and not keys:
                spec = declared[kind]
            else:
                spec = TypeAdapter[Any](FigureSpec).validate_python({"kind": kind, "name": kind, **keys})
            return draw(spec, self.runs, self.steps, self.fields)
        except ValidationError as error:
            told = "; ".join(f"{'.'.join(map(str, each['loc'][1:])) or kind}: {each['msg']}" for each in error.errors())
            names = f"; the study declares {', '.join(declared)}" if declared else ""
            raise StudyError(f"results.plot({kind!r}): {told}{names}") from error
        except FigureError as error:
            raise StudyError(f"results.plot: {error}") from error

    def to_vtk(self, path: str | Path, case: str | int, time: float | None = None) -> Path:
        """Write the fields of a flow at a recorded time (absent: the last) as .vtu or .vtk, which ParaView reads;
        returns the path. Needs meshio: the extra `mesh`. Raises StudyError without it, and as `at` does.
        """
        write_vtk(Path(path), snapshot(self.fields, self._case(case), time))
        return Path(path)

    def to_xarray(self, case: str | int) -> xarray.Dataset:
        """The fields of a flow by time and node, or the state of a system by unknown, with units and meanings.

        Needs xarray: the extra `xarray`. Raises StudyError without it, and as `state` does.
        """
        chosen = self._case(case)
        self.state(chosen)
        return dataset(self.fields[self.fields["case"] == chosen])

    def __repr__(self) -> str:
        return "\n".join(f"{name:<8}  {text}" for name, text in self._told().items())

    def _repr_html_(self) -> str:
        """What a notebook shows: how the cases ended, the tables, what was expected and found, the notes."""
        tables = (notebook.frame(title, cells) for table in self.tables() for title, cells in table.frames().items())
        return notebook.facts(self._told()) + "".join(tables) + notebook.sentences(map(str, self.findings))

    def _told(self) -> dict[str, str]:
        counts = self.runs["status"].value_counts()
        endings = ", ".join(f"{number} {word}" for word, number in counts.items()) or "none has ended"
        frames = {"runs": self.runs, "steps": self.steps, "fields": self.fields}
        told = {
            "results": self.study.name,
            "question": self.study.question,
            "cases": f"{len(self.runs)}: {endings}",
            "frames": ", ".join(f"{name} ({len(rows)} rows)" for name, rows in frames.items()),
            "tables": ", ".join(table.spec.name for table in self.tables()),
            "folder": "" if self.folder is None else str(self.folder),
            "notes": "; ".join(self.notes),
        }
        return {name: text for name, text in told.items() if text}

    def _case(self, case: str | int) -> str:
        return case_among(self.runs, case)
