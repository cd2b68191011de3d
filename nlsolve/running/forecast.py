"""What a study will do and about what it will cost, told from unit costs measured once for every scene in it."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from nlsolve.algebra.simulation import AlgebraicSetup
from nlsolve.contracts.component import Component
from nlsolve.contracts.status import SolveError
from nlsolve.flow.setup import Setup
from nlsolve.registry.component_tables import class_name
from nlsolve.running.timing import calibrate
from nlsolve.study.study import Study

SOLVES = 20
"""Pairs of triangular solves, and residuals, an increment is taken to need: about one series."""

STAGE = 5
"""Newton iterations taken for each law on the way to the first state."""

ASSUMPTION = (
    f"forecast: {STAGE} Newton iterations for each law on the way to the first state, then one factorisation and "
    f"{SOLVES} pairs of triangular solves an increment"
)
"""Newton needs several factorisations an increment, a kept tangent far fewer than one."""

INCREMENT = {"factorizations": 1, "jacobians": 1, "triangular_solves": SOLVES, "residuals": SOLVES}
ITERATION = {"factorizations": 1, "jacobians": 1, "triangular_solves": 1, "residuals": 1}

SAMPLE = [
    "nodes",
    "unknowns",
    "seconds_operators",
    "seconds_factorization",
    "seconds_triangular_solve",
    "seconds_iteration",
    "seconds_increment",
]


def forecast(study: Study) -> pd.DataFrame:
    """A row a case: its swept parameters, its size, and the seconds it would take under the `ASSUMPTION`."""
    measured: dict[str, dict[str, float]] = {}
    rows = []
    for case in study.cases:
        setup = case.setup
        increments, clouds, stages = 1, 1, 0
        parts: list[Component] = [setup.scene, setup.linear]
        if isinstance(setup, Setup):
            parts += [setup.law, setup.discretizer]
            increments = max(1, setup.scene.increments)
            clouds = 1 + (increments if setup.scene.motion_of_nodes != "fixed" else 0)
            stages = len(setup.start.stages(setup.law))
        key = "".join(class_name(type(part)) + part.model_dump_json() for part in parts)
        if key not in measured:
            measured[key] = costs_of(setup)
        costs = measured[key]
        seconds = {
            "seconds_start": STAGE * stages * costs["seconds_iteration"],
            "seconds": increments * costs["seconds_increment"],
        }
        seconds["seconds_all"] = sum(seconds.values()) + clouds * costs["seconds_operators"]
        swept = {name: case.parameters[name] for name in case.swept}
        rows.append({"case": case.id, **swept, "increments": increments, **costs, **seconds})
    return pd.DataFrame(rows)


def costs_of(setup: Setup | AlgebraicSetup) -> dict[str, Any]:
    """Sizes and timings [s] of one scene at its first cloud, or of a system; all NaN when that is bad."""
    try:
        found = calibrate(setup, rounds=1)
    except SolveError:
        known = {"unknowns": len(setup.scene.start())} if isinstance(setup, AlgebraicSetup) else {}
        return {**dict.fromkeys(SAMPLE, math.nan), **known}
    return {
        "nodes": found.nodes,
        "unknowns": found.unknowns,
        "seconds_operators": found.operators,
        "seconds_factorization": found.unit.factorization,
        "seconds_triangular_solve": found.unit.triangular_solve,
        "seconds_iteration": found.unit.predict(ITERATION),
        "seconds_increment": found.unit.predict(INCREMENT),
    }
