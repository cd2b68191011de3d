"""Runs -> the cells of a declared table, and what keeps it from being laid out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.registry.problems import ABSENT, Problem, StudyError, did_you_mean
from nlsolve.results.aggregates import key_of
from nlsolve.results.columns import RUNS
from nlsolve.results.verdicts import AT_A_SOLUTION, OUTCOME, SOLVED, SPEEDUP, number, outcome, solved
from nlsolve.show.tables.spec import TableSpec
from nlsolve.show.tables.table import Table

MEASURED = (*RUNS, OUTCOME, SOLVED, SPEEDUP)
"""Columns that are known only when a case has been run."""


def build(spec: TableSpec, runs: pd.DataFrame) -> Table:
    """The declared table of these runs. Raises StudyError when two runs claim one cell or a name is unknown."""
    records = [dict(zip(runs.columns, row, strict=True)) for row in runs.itertuples(index=False)]
    judged = (spec.accepted, spec.error)
    records = [
        {**run, OUTCOME: outcome(run, *judged), SOLVED: solved(run, *judged), SPEEDUP: _speedup(spec, run, records)}
        for run in records
    ]
    problems = check(spec, records)
    if problems:
        raise StudyError(*(f"table {spec.name!r}: {problem.expected}" for problem in problems))
    chosen = spec.condensed([run for run in records if _fits(spec, run)])
    rows = list(dict.fromkeys(key_of(spec.labels, run) for run in chosen))
    columns = list(dict.fromkeys(key for run in chosen for key in _column_keys(spec, run)))
    cells = np.full((len(rows), len(columns)), 0 if spec.count else np.nan, dtype=object)
    for run in chosen:
        for value, key in zip(spec.shown, _column_keys(spec, run), strict=True):
            failed = not (spec.count or spec.success) and run["status"] not in AT_A_SOLUTION
            cells[rows.index(key_of(spec.labels, run)), columns.index(key)] = run.get("status" if failed else value)
    names = (*spec.columns, "") if spec.columns and len(spec.shown) > 1 else spec.columns or ("",)
    index, header = _index(rows, spec.labels), _index(columns, names)
    frame = pd.DataFrame(cells, index=index, columns=header, dtype=object)
    if spec.paper is None:
        return Table(spec, frame)
    compared = spec.paper.compare(cells, spec.text)
    return Table(spec, frame, pd.DataFrame(compared, index=index, columns=header, dtype=object))


def check(spec: TableSpec, runs: Sequence[Mapping[str, Any]], measured: Iterable[str] = MEASURED) -> list[Problem]:
    """What keeps a table from being laid out: unknown names, cells with several runs, a paper of another shape.

    Works on the parameters of cases before anything has been computed, and on rows of `runs` afterwards.
    """
    known = list(dict.fromkeys([*measured, *(name for run in runs for name in run)]))
    contest = () if spec.cheapest is None else (spec.cheapest.cost, spec.cheapest.error)
    axes = {} if spec.crossover is None else spec.crossover.columns_of_runs()
    problems = [
        Problem(place, name, f"no such column of the results; {did_you_mean(name, known)}")
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
        if name not in known
    ]
    layout = (*spec.rows, *spec.columns)
    unmeasured = {name for name in measured if not all(name in run for run in runs)}
    if problems or unmeasured.intersection((*layout, *spec.where)):
        return problems
    chosen = [run for run in runs if _fits(spec, run)]
    if not chosen:
        asked = ", ".join(f"{name} = {value!r}" for name, value in spec.where.items())
        return [Problem(("where",), ABSENT, f"no case has these values: {asked}")]
    if spec.success or spec.cheapest is not None or spec.crossover is not None:
        return []
    cells: dict[tuple[Any, ...], Mapping[str, Any]] = {}
    for run in () if spec.count else chosen:
        other = cells.setdefault(key_of(layout, run), run)
        if other is not run:
            differing = [name for name in run if name not in measured and not _same(run[name], other.get(name))]
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


def _speedup(spec: TableSpec, run: Mapping[str, Any], runs: Sequence[Mapping[str, Any]]) -> float:
    """Seconds of the run that `against` names, like this one in the rest of rows and columns, over this one's."""
    if not spec.against or run["status"] not in AT_A_SOLUTION:
        return float("nan")
    wanted = {name: run.get(name) for name in (*spec.rows, *spec.columns)} | spec.against
    bases = [other for other in runs if all(_same(other.get(name), value) for name, value in wanted.items())]
    known = len(bases) == 1 and bases[0]["status"] in AT_A_SOLUTION and number(run.get("seconds")) > 0.0
    return number(bases[0].get("seconds")) / number(run["seconds"]) if known else float("nan")


def _fits(spec: TableSpec, run: Mapping[str, Any]) -> bool:
    wanted = {name: value if isinstance(value, list) else [value] for name, value in spec.where.items()}
    return all(any(_same(run.get(name), value) for value in values) for name, values in wanted.items())


def _same(a: Any, b: Any) -> bool:
    return bool(a == b) or (pd.isna(a) and pd.isna(b))


def _column_keys(spec: TableSpec, run: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """The table's columns that a run has a value for."""
    if spec.columns and len(spec.shown) == 1:
        return [key_of(spec.columns, run)]
    return [(*key_of(spec.columns, run), value) for value in spec.shown]


def _index(keys: list[tuple[Any, ...]], names: tuple[str, ...]) -> pd.Index:
    if len(names) == 1:
        return pd.Index([key[0] for key in keys], name=names[0], dtype=object)
    return pd.MultiIndex.from_tuples(keys, names=names)
