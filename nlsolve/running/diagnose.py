"""How good are the operators of a study's discretizers on its clouds? Answered before anything is solved."""

from __future__ import annotations

from typing import Any

import pandas as pd

from nlsolve.contracts.status import SolveError
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.results.parameters import names_settings
from nlsolve.solving.simulate import simulation_of
from nlsolve.solving.work.ledger import Ledger
from nlsolve.study.study import Study

NO_CLOUD = "this scene has no cloud, and no operators on it"


def telling(name: str) -> bool:
    """Whether `name` is a parameter of the scene or the discretizer, or the column of settings' names."""
    return names_settings(name) or name.split(".")[0] in ("scene", "discretizer")


def diagnose(study: Study) -> pd.DataFrame:
    """One row for each operator of every distinct pair of cloud and discretizer.

    Columns: the swept parameters of scene and discretizer, `nodes`, and `DIAGNOSTICS`. Where a cloud or its operators
    cannot be built, there is one row, whose `operator` is the sentence that says why.
    """
    seen: list[Any] = []
    rows: list[dict[str, Any]] = []
    for case in study.cases:
        named = {name: case.parameters[name] for name in case.swept if telling(name)}
        try:
            found = simulation_of(case.parts, Ledger().entry).diagnostics()
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
