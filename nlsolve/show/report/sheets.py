"""Tables of the report that no study declares: failures, doubts, audits, and what the cases cost."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.results.columns import RUNS
from nlsolve.results.frames import rows_of
from nlsolve.results.verdicts import AT_A_SOLUTION, Run, doubt, number, status_of

MOST_ROWS = 200
TOTAL = {"seconds": "inside the method"}
PARTS = {
    "seconds_factorization": "factorising",
    "seconds_triangular_solve": "triangular solves",
    "seconds_jacobian": "Jacobians",
    "seconds_residual": "residuals",
    "seconds_series": "series coefficients",
    "seconds_own": "work of the method itself",
}
"""Columns of `runs` that add up to `seconds`, in words."""
BESIDE = {
    "seconds_operators": "operators",
    "seconds_start": "first states",
    "seconds_estimate": "estimates of adaptive nodes",
}
"""What is not in `seconds`."""
ALL = {"seconds_all": "everything"}
AUDIT = "audit."
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(?=\s|$)", re.IGNORECASE)
"""What is sorted as a number, see page.js."""


@dataclass(frozen=True)
class Sheet:
    """A table in words. meanings : a sentence a column, or none; note : what stands beneath."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    meanings: tuple[str, ...] = ()
    note: str = ""

    @property
    def classes(self) -> tuple[str, ...]:
        """For each column "words", which stand left, or "numbers", where more than half of its cells are numbers."""
        columns = list(zip(*self.rows, strict=True)) or [()] * len(self.headings)
        cells = [[bool(NUMBER.match(cell)) for cell in column if cell] for column in columns]
        return tuple("numbers" if sum(found) > len(found) / 2 else "words" for found in cells)


def sheet_of(frame: pd.DataFrame) -> Sheet:
    """A frame as a sheet, the names of its rows as the first columns."""
    named = any(name is not None for name in frame.index.names) or not isinstance(frame.index, pd.RangeIndex)
    flat = frame.reset_index(names=[name or "" for name in frame.index.names]) if named else frame
    headings = [" · ".join(map(str, key)) if isinstance(key, tuple) else str(key) for key in flat.columns]
    rows = [tuple(map(in_words, row)) for row in flat.to_numpy(dtype=object)]
    return Sheet(tuple(heading.strip(" ·") for heading in headings), tuple(rows))


def failures(runs: pd.DataFrame, names: Sequence[str]) -> Sheet:
    """The cases that are not at a solution, each with its parameters `names` and what happened."""
    failed = [run for run in rows_of(runs) if status_of(run) not in AT_A_SOLUTION]
    rows = [(*_case(run, names), in_words(run["status"]), _sentence(run)) for run in failed]
    return Sheet(("case", *names, "ending", "what happened"), tuple(rows))


def doubts(runs: pd.DataFrame, names: Sequence[str]) -> Sheet:
    """The cases whose results are in doubt, each with its parameters `names`, why, and the way out."""
    rows = [(*_case(run, names), in_words(run["status"]), doubt(run)) for run in rows_of(runs) if doubt(run)]
    return Sheet(("case", *names, "ending", "what is in doubt"), tuple(rows))


def audits(runs: pd.DataFrame) -> Sheet:
    """The largest value of each audit over the cases, and what it measures."""
    rows = []
    for name in (str(name) for name in runs if str(name).startswith(AUDIT)):
        values = pd.to_numeric(runs[name], errors="coerce").dropna()
        if len(values):
            meaning = RUNS[name].meaning if name in RUNS else ""
            words = name.removeprefix(AUDIT).replace("_", " ")
            rows.append((words, in_words(float(values.max())), str(len(values)), meaning))
    return Sheet(("audit", "largest", "cases audited", "what it is"), tuple(rows))


def cost(runs: pd.DataFrame, names: Sequence[str]) -> Sheet:
    """The seconds of each case by part; of very many cases the dearest ones."""
    timed = TOTAL | PARTS | BESIDE | ALL
    columns = [name for name in timed if name in runs and pd.to_numeric(runs[name], errors="coerce").gt(0).any()]
    if not columns:
        return Sheet((), ())
    members = rows_of(runs)
    dearest = sorted(range(len(members)), key=lambda place: -_or_zero(members[place].get(columns[0])))[:MOST_ROWS]
    chosen = [members[place] for place in sorted(dearest)]
    told = [*columns, *(name for name in ("lane",) if name in runs)]
    rows = tuple((*_case(run, names), *(_seconds(run[name]) for name in told)) for run in chosen)
    headings = (f"{timed[name]} [{RUNS[name].unit}]" if name in timed else name for name in told)
    meanings = ("", *("" for _ in names), *(f"column {name}: {RUNS[name].meaning}" for name in told))
    note = f"These are the {MOST_ROWS} dearest of {len(members)} cases; runs.csv has all." * (len(members) > MOST_ROWS)
    return Sheet(("case", *names, *headings), rows, meanings, note)


def cost_in_words(runs: pd.DataFrame) -> str:
    """The seconds of all cases and where they went, in a sentence; empty where none were measured."""
    inside = _total(runs, "seconds")
    if not inside:
        return ""
    parts = {words: _total(runs, name) / inside for name, words in PARTS.items()}
    told = [f"{100 * share:.0f} % {words}" for words, share in _largest_first(parts) if share >= 0.005]
    beside = {words: _total(runs, name) for name, words in BESIDE.items()}
    others = [f"{seconds:.3g} s {words}" for words, seconds in _largest_first(beside) if seconds]
    more = f" Beside these: {', '.join(others)}." if others else ""
    return f"The methods took {inside:.3g} s in all{': ' if told else ''}{', '.join(told)}.{more}"


def in_words(value: Any) -> str:
    """A value of a frame as the page prints it; empty where there is none."""
    if isinstance(value, str):
        return value
    if value is None or (isinstance(value, float) and value != value):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _seconds(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) and value == value else in_words(value)


def _case(run: Run, names: Sequence[str]) -> tuple[str, ...]:
    return (in_words(run["case"]), *(in_words(run[name]) for name in names))


def _sentence(run: Run) -> str:
    """The message of a case, or the sentence of its status where it left none."""
    message = run.get("message")
    return message if isinstance(message, str) and message else Status.of(run["status"]).sentence


def _total(runs: pd.DataFrame, name: str) -> float:
    return float(pd.to_numeric(runs[name], errors="coerce").sum()) if name in runs else 0.0


def _or_zero(value: Any) -> float:
    found = number(value)
    return found if found == found else 0.0


def _largest_first(parts: dict[str, float]) -> Iterable[tuple[str, float]]:
    return sorted(parts.items(), key=lambda part: -part[1])
