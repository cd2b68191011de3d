"""Which cases a figure shows, and what they are called in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nlsolve.contracts.status import Status
from nlsolve.results.verdicts import telling
from nlsolve.show.figures.base import BaseFigure, Scalar, listing


def select(spec: BaseFigure, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that have every value `where` asks for."""
    if runs.empty:
        raise spec.refuse("there are no runs to draw")
    for column, wanted in spec.where.items():
        spec.require(column, runs, "runs", what="where")
        values = wanted if isinstance(wanted, list) else [wanted]
        fit = np.logical_or.reduce([_equals(runs[column], value) for value in values])
        if not fit.any():
            there = list(dict.fromkeys(repr(value) for value in runs[column].tolist()))
            raise spec.refuse(f"no case has {column} = {wanted!r}; the cases left have {listing(there)}")
        runs = runs[fit]
    return runs


def labelled(spec: BaseFigure, cases: pd.DataFrame, one_case: bool) -> list[tuple[str, pd.DataFrame]]:
    """The cases group by group, in their order, each with the words that tell it apart."""
    by = list(spec.group)
    for column in by:
        spec.require(column, cases, "runs", what="group")
    if not by and one_case and len(cases) > 1:
        by = telling(cases) or ["case"]
    if not by:
        return [("", cases)]
    groups: dict[tuple[str, ...], list[int]] = {}
    for position, values in enumerate(cases[by].itertuples(index=False, name=None)):
        groups.setdefault(tuple(map(str, values)), []).append(position)
    found = []
    for positions in groups.values():
        members = cases.iloc[positions]
        label = label_of({column: members[column].iloc[0] for column in by})
        if one_case and len(members) > 1:
            raise spec.refuse(
                f"group = {by} leaves {len(members)} cases under the one label {label!r}; "
                f"they differ in {listing(telling(members))}: add one to `group`, or choose with `where`"
            )
        found.append((label, members))
    return found


def records_of(runs: pd.DataFrame) -> list[dict[str, Any]]:
    """The runs one by one, in their order."""
    return [dict(zip(map(str, runs.columns), row, strict=True)) for row in runs.itertuples(index=False)]


def label_of(parameters: Mapping[str, Any]) -> str:
    """{"solver.kind": "anm", "solver.order": 20} -> "anm, order 20"."""
    last = [name.rpartition(".")[2] for name in parameters]
    words = []
    for name, short in zip(parameters, last, strict=True):
        value = parameters[name]
        called = (short if last.count(short) == 1 else name).replace("_", " ")
        if isinstance(value, (bool, np.bool_)):
            words.append(called if value else f"no {called}")
        elif isinstance(value, str):
            words.append(value)
        elif not (value is None or (np.ndim(value) == 0 and pd.isna(value))):
            words.append(f"{called} {number_text(value)}")
    return ", ".join(filter(None, words))


def number_text(value: Any) -> str:
    """20 -> "20", 1e-6 -> "$10^{-6}$"."""
    if np.ndim(value):
        return "(" + ", ".join(map(number_text, value)) + ")"
    if not isinstance(value, (int, float, np.number)):
        return str(value)
    text = f"{value:.6g}"
    if "e" not in text and not text.startswith(("0.000", "-0.000")):
        return text
    mantissa, power = f"{value:.5e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    return f"$10^{{{int(power)}}}$" if mantissa == "1" else rf"${mantissa}\times 10^{{{int(power)}}}$"


def _equals(column: pd.Series, value: Scalar) -> NDArray[np.bool_]:
    if isinstance(value, str):
        return column.astype(str).to_numpy() == value
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(float, na_value=np.nan)
    return np.isclose(numbers, float(value), rtol=1e-9, atol=0)


def ending(run: pd.Series) -> str:
    """The status of a case that did not converge; empty for one that did."""
    status = str(run.get("status", Status.CONVERGED.word))
    return "" if status == Status.CONVERGED.word else status
