"""Which cases a figure shows, and by which words it tells them apart."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.results.parameters import differing_parameters
from nlsolve.results.selection import is_wanted
from nlsolve.show.figures.base import BaseFigure, listing


def select(spec: BaseFigure, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that have every value that `where` asks for. Raises FigureError when there are none."""
    if runs.empty:
        raise spec.refuse("there are no runs to draw")
    for column, wanted in spec.where.items():
        spec.require(column, runs, "runs", what="where")
        fit = [is_wanted(value, wanted) for value in runs[column]]
        if not any(fit):
            there = list(dict.fromkeys(repr(value) for value in runs[column].tolist()))
            raise spec.refuse(f"no case has {column} = {wanted!r}; the cases left have {listing(there)}")
        runs = runs[fit]
    return runs


def labelled(spec: BaseFigure, cases: pd.DataFrame, one_case: bool) -> list[tuple[str, pd.DataFrame]]:
    """Label and cases of every group, in order of appearance.

    one_case : whether a group is a single case; without `group`, cases are then told apart by the parameters that
        differ. Raises FigureError when a group is left with several.
    """
    by = list(spec.group)
    for column in by:
        spec.require(column, cases, "runs", what="group")
    if not by and one_case and len(cases) > 1:
        by = differing_parameters(cases) or ["case"]
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
                f"they differ in {listing(differing_parameters(members))}: add one to `group`, or choose with `where`"
            )
        found.append((label, members))
    return found


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


def plain(text: str) -> str:
    r"""A label without mathematics, for data: "tolerance $10^{-6}$, $t$ = 0.3 s" -> "tolerance 1e-6, t = 0.3 s"."""
    text = re.sub(r"\$([\d.+-]+)\\times 10\^\{(-?\d+)\}\$", r"\1e\2", text)
    return re.sub(r"\$10\^\{(-?\d+)\}\$", r"1e\1", text).replace("$", "")


def ending(run: pd.Series) -> str:
    """The word for the status of a case that did not converge; empty for one that did."""
    status = Status.of(run["status"])
    return "" if status is Status.CONVERGED else status.word
