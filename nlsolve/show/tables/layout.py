"""Runs -> the cells of a declared table, and the problems that prevent it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.registry.problems import ABSENT, Problem, Source, StudyError, did_you_mean
from nlsolve.results.aggregates import key_of
from nlsolve.results.columns import RUNS, is_measured, no_such_column
from nlsolve.results.costs.lanes import on_seconds
from nlsolve.results.frames import rows_of
from nlsolve.results.selection import fits, same
from nlsolve.results.verdicts import AT_A_SOLUTION, OUTCOME, SOLVED, SPEEDUP, Run, number, outcome, solved, status_of
from nlsolve.show.tables.spec import TableSpec, written
from nlsolve.show.tables.table import Table, shown_in

MEASURED = (*RUNS, OUTCOME, SOLVED, SPEEDUP)
"""Columns that have values only when a case has been run."""


def build(spec: TableSpec, runs: pd.DataFrame) -> Table:
    """The declared table of these runs.

    Raises StudyError when two runs claim one cell, a name is unknown, or seconds come from several lanes.
    """
    measured, judged = rows_of(runs), (spec.accepted, spec.error)
    known = [
        {**run, OUTCOME: outcome(run, *judged), SOLVED: solved(run, *judged), SPEEDUP: _speedup(spec, run, measured)}
        for run in measured
    ]
    problems = check(spec, known)
    if problems:
        raise StudyError(*(problem.sentence(Source(f"table {spec.name!r}")) for problem in problems))
    notes = (*spec.notes, *_on_seconds(spec, known))
    chosen = spec.aggregated([run for run in known if fits(run, spec.where)])
    rows = _numbered(key_of(spec.row_names, run) for run in chosen)
    columns = _numbered(key for run in chosen for key in _column_keys(spec, run))
    cells = np.full((len(rows), len(columns)), 0 if spec.count else np.nan, dtype=object)
    for run in chosen:
        for value, key in zip(spec.shown, _column_keys(spec, run), strict=True):
            failed = not spec.aggregates and status_of(run) not in AT_A_SOLUTION
            cells[rows[key_of(spec.row_names, run)], columns[key]] = run.get("status" if failed else value)
    names = (*spec.columns, "") if spec.columns and len(spec.shown) > 1 else spec.columns or ("",)
    index, header = _index(list(rows), spec.row_names), _index(list(columns), names)
    frame = pd.DataFrame(cells, index=index, columns=header, dtype=object)
    if spec.paper is None:
        return Table(spec, frame, notes=notes)
    shown = shown_in(spec, header)
    compared = spec.paper.compare(cells, lambda value, column: spec.text(value, shown[column]))
    return Table(spec, frame, pd.DataFrame(compared, index=index, columns=header, dtype=object), notes)


def built(specs: Iterable[TableSpec], runs: pd.DataFrame) -> tuple[list[Table], list[str]]:
    """The declared tables that these runs can fill, and a sentence for each of the others."""
    tables, sentences = [], []
    for spec in specs:
        try:
            tables.append(build(spec, runs))
        except StudyError as error:
            sentences.append(str(error))
    return tables, sentences


def check(spec: TableSpec, runs: Sequence[Run], measured: Iterable[str] = MEASURED) -> list[Problem]:
    """The problems of a table: unknown names, cells with several runs, paper values of another shape.

    Works on the parameters of cases before anything has been computed, and on rows of `runs` afterwards.
    """
    known = list(dict.fromkeys([*measured, *(name for run in runs for name in run)]))
    planned = not any("status" in run for run in runs)
    contest = () if spec.cheapest is None else (spec.cheapest.cost, spec.cheapest.error)
    axes = {} if spec.crossover is None else spec.crossover.columns_of_runs()
    problems = [
        Problem(place, name, no_such_column(name, known))
        for place, names in [
            (("rows",), spec.rows),
            (("columns",), spec.columns),
            (("value",), () if spec.count else spec.value),
            (("where",), spec.where),
            (("against",), spec.against),
            (("cheapest", "cost"), contest[:1]),
            (("cheapest", "error"), contest[1:]),
            *((("crossover", field), columns) for field, columns in axes.items()),
        ]
        for name in names
        if name not in known and not (planned and is_measured(name))  # what scenes measure is known afterwards
    ]
    problems += _of_style(spec, runs)
    layout = (*spec.rows, *spec.columns)
    unmeasured = {name for name in measured if not all(name in run for run in runs)}
    if problems or unmeasured.intersection((*layout, *spec.where)):
        return problems
    chosen = [run for run in runs if fits(run, spec.where)]
    if not chosen:
        asked = ", ".join(f"{name} = {value!r}" for name, value in spec.where.items())
        return [Problem(("where",), ABSENT, f"no case has these values: {asked}")]
    if spec.aggregates and not spec.count:
        return []
    cells: dict[tuple[Any, ...], Run] = {}
    for run in () if spec.count else chosen:
        other = cells.setdefault(key_of(layout, run), run)
        if other is not run:
            differing = [
                name
                for name in run
                if not (name in measured or is_measured(name)) and not same(run[name], other.get(name))
            ]
            hint = f"; they differ in {differing[0]!r}: put it in rows, columns or where" if differing else ""
            here = ", ".join(f"{name} = {value!r}" for name, value in zip(layout, key_of(layout, run), strict=True))
            return [Problem(("rows",), list(spec.rows), f"several runs land in the cell {here}{hint}")]
    if spec.paper is not None:
        height = len({key_of(spec.rows, run) for run in chosen})
        width = len({key for run in chosen for key in _column_keys(spec, run)})
        lengths = [len(row) for row in spec.paper.values]
        if lengths != [width] * height:
            expected = f"should be {height} lists of {width} numbers, as the table has; there are lists of {lengths}"
            return [Problem(("paper", "values"), [list(row) for row in spec.paper.values], expected)]
    return []


def _of_style(spec: TableSpec, runs: Sequence[Run]) -> list[Problem]:
    """Columns of which the declaration says how they look and which the table does not have; labels of nothing."""
    problems = [
        Problem((field,), name, f"the table has no such column; {did_you_mean(name, spec.names)}")
        for field, names in spec.styled.items()
        for name in names
        if name not in spec.names
    ]
    words = {written(run[name]) for name in (*spec.rows, *spec.columns) for run in runs if name in run}
    known = {*spec.names, *words, *(status.word for status in Status)}
    for name in spec.labels:
        nearest = get_close_matches(name, known - set(spec.labels), n=1, cutoff=0.8)
        if name not in known and nearest:
            sentence = f"the table shows nothing of this name; did you mean {nearest[0]!r}?"
            problems.append(Problem(("labels",), name, sentence))
    return problems


def _on_seconds(spec: TableSpec, runs: Sequence[Run]) -> tuple[str, ...]:
    """What is said of the seconds that a table shows or compares; see `on_seconds`."""
    if not spec.shows_seconds:
        return ()
    shown = [run for run in runs if fits(run, spec.where) or (spec.against and fits(run, dict(spec.against)))]
    try:
        return on_seconds(shown, spec.lanes)
    except StudyError as error:
        raise StudyError(f"table {spec.name!r}: {error}") from error


def _speedup(spec: TableSpec, run: Run, runs: Sequence[Run]) -> float:
    """Seconds of the run that `against` names, like this one in the rest of rows and columns, over this one's."""
    if not spec.against or status_of(run) not in AT_A_SOLUTION:
        return float("nan")
    wanted = {name: run.get(name) for name in (*spec.rows, *spec.columns)} | spec.against
    bases = [other for other in runs if all(same(other.get(name), value) for name, value in wanted.items())]
    known = len(bases) == 1 and status_of(bases[0]) in AT_A_SOLUTION and number(run.get("seconds")) > 0.0
    return number(bases[0].get("seconds")) / number(run["seconds"]) if known else float("nan")


def _column_keys(spec: TableSpec, run: Run) -> list[tuple[Any, ...]]:
    """The table's columns that a run has a value for."""
    if spec.columns and len(spec.shown) == 1:
        return [key_of(spec.columns, run)]
    return [(*key_of(spec.columns, run), value) for value in spec.shown]


def _numbered(keys: Iterable[tuple[Any, ...]]) -> dict[tuple[Any, ...], int]:
    """The different keys in their order, each with its number."""
    return {key: number for number, key in enumerate(dict.fromkeys(keys))}


def _index(keys: list[tuple[Any, ...]], names: tuple[str, ...]) -> pd.Index:
    if len(names) == 1:
        return pd.Index([key[0] for key in keys], name=names[0], dtype=object)
    return pd.MultiIndex.from_tuples(keys, names=names)
