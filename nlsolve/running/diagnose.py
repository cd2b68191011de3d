"""How good are the operators that a study's discretizers make of its clouds? Told before anything is solved."""

from __future__ import annotations

import hashlib
from typing import Any

import pandas as pd

from nlsolve.contracts.status import SolveError
from nlsolve.flow.setup import Setup
from nlsolve.registry.component_tables import class_name
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.results.verdicts import names_settings
from nlsolve.study.study import Study

NO_CLOUD = "a system of equations has no cloud, and no operators on it"


def telling(name: str) -> bool:
    """Is this a parameter of clouds or discretizers, or the name of a setting?"""
    return names_settings(name) or name.split(".")[0] in ("scene", "discretizer")


def diagnose(study: Study) -> pd.DataFrame:
    """A row an operator of every distinct cloud and discretizer: what tells the case apart, `nodes`, DIAGNOSTICS.

    A cloud or discretizer that refuses leaves a row whose `operator` is the sentence.
    """
    seen: set[str] = set()
    rows: list[dict[str, Any]] = []
    for case in study.cases:
        setup = case.setup
        named = {name: case.parameters[name] for name in case.swept if telling(name)}
        if not isinstance(setup, Setup):
            key = class_name(type(setup.scene)) + setup.scene.model_dump_json()
            rows += [{**named, "operator": NO_CLOUD}] if key not in seen else []
            seen.add(key)
            continue
        try:
            cloud = setup.scene.cloud(setup.law)
            discretizer = class_name(type(setup.discretizer)) + setup.discretizer.model_dump_json()
            key = hashlib.sha256(cloud.nodes.tobytes() + discretizer.encode()).hexdigest()
            if key in seen:
                continue
            seen.add(key)
            found = setup.discretizer.diagnostics(cloud) or [{"operator": "this discretizer gives no diagnostics"}]
        except SolveError as error:
            refused = {**named, "operator": error.detail}
            rows += [refused] if refused not in rows else []
        else:
            rows += [{**named, "nodes": len(cloud.nodes), **row} for row in found]
    swept = list(dict.fromkeys(name for case in study.cases for name in case.swept if telling(name)))
    return pd.DataFrame(rows, columns=[*swept, "nodes", *DIAGNOSTICS])
