"""Which columns of `runs` are parameters of cases and names of settings, and which of them tell cases apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import pandas as pd

from nlsolve.results.columns import Column, is_measured

VARIANT = "variant"
"""Column of `runs` with the names of the settings a case was made by, where a sweep of named settings has no name."""

LETTERS: Mapping[str, Column] = MappingProxyType(
    {
        column.name: column
        for column in (
            Column("solver.order", "order of a series", symbol="order $p$"),
            Column("solver.tolerance", "tolerance of a method's own test or range", symbol=r"tolerance $\eta$"),
            Column("law.index", "index of a power law", symbol="index $n$"),
            Column("law.regularization", "rate at which a law is regularised", "1/s", r"$\varepsilon_0$"),
            Column("physics.penalty", "second viscosity over the viscosity at a rate", symbol=r"$\lambda/\mu$"),
            Column("time.increment", "time step", "s", r"$\Delta t$"),
        )
    }
)
"""Parameters for which papers have a letter."""


def names_settings(column: str) -> bool:
    """Whether a column of `runs` holds names of settings: neither a measurement nor a parameter, which is dotted."""
    return "." not in column and not is_measured(column)


def differing_parameters(runs: pd.DataFrame) -> list[str]:
    """Parameters whose values differ between the runs, without those that follow from the names of settings."""
    words = {str(name): [str(value) for value in runs[name]] for name in runs if not is_measured(str(name))}
    differing = [name for name, values in words.items() if len(set(values)) > 1]
    names = [name for name in differing if names_settings(name)]
    return [name for name in differing if name in names or not settled(words, name, names)]


def settled(words: Mapping[str, Sequence[str]], name: str, by: Sequence[str]) -> bool:
    """Whether runs with the same words in the columns `by` have the same in the column `name`."""
    keys = list(zip(*(words[column] for column in by), strict=True)) or [()] * len(words[name])
    return len(set(zip(keys, words[name], strict=True))) == len(set(keys))
