"""How good are the operators that a study's discretizers make of its clouds? Told before anything is solved."""

from __future__ import annotations

from typing import Any

import pandas as pd

from nlsolve.contracts.status import SolveError
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.results.parameters import names_settings
from nlsolve.solving.ledger import Ledger
from nlsolve.study.study import Study

NO_CLOUD = "this scene has no cloud, and no operators on it"


def telling(name: str) -> bool:
    """Is this a parameter of clouds or discretizers, or the name of a setting?"""
    return names_settings(name) or name.split(".")[0] in ("scene", "discretizer")


def diagnose(study: Study) -> pd.DataFrame:
    """A row an operator of every distinct cloud and discretizer: what tells the case apart, `nodes`, DIAGNOSTICS.

    A cloud or discretizer that refuses leaves a row whose `operator` is the sentence.
    """
    seen: list[Any] = []
    rows: list[dict[str, Any]] = []
    for case in study.cases:
        named = {name: case.parameters[name] for name in case.swept if telling(name)}
        try:
            simulation = case.parts.scene.simulation(case.parts, Ledger().entry)
            found = simulation.diagnostics()
        except SolveError as error:
            refused = {**named, "operator": error.detail}
            rows += [refused] if refused not in rows else []
            continue
        told = found or case.parts.scene
        if told not in seen:
            seen.append(told)
            rows += [{**named, **row} for row in found or [{"operator": NO_CLOUD}]]
    swept = list(dict.fromkeys(name for case in study.cases for name in case.swept if telling(name)))
    return pd.DataFrame(rows, columns=[*swept, "nodes", *DIAGNOSTICS])
