"""What a study will do and about what it will cost, told from one factorisation for every scene in it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from nlsolve.algebra import Algebraic, AlgebraicSetup
from nlsolve.component import Component
from nlsolve.march import Setup
from nlsolve.status import SolveError
from nlsolve.studies import Study

SOLVES = 20
"""Pairs of triangular solves an increment is taken to need: about one series."""

ASSUMPTION = f"forecast: one factorisation and {SOLVES} pairs of triangular solves an increment"
"""Newton needs several factorisations an increment, a kept tangent far fewer than one."""

SAMPLE = ["nodes", "unknowns", "seconds_operators", "seconds_factorization", "seconds_triangular_solve"]


def forecast(study: Study) -> pd.DataFrame:
    """A row a case: its swept parameters, its size, and the seconds it would take under the `ASSUMPTION`."""
    measured: dict[str, dict[str, float]] = {}
    rows = []
    for case in study.cases:
        setup = case.setup
        increments = clouds = 1
        parts: list[Component] = [setup.scene, setup.linear]
        if isinstance(setup, Setup):
            parts += [setup.law, setup.discretizer]
            increments = max(1, setup.scene.increments)
            clouds = increments if setup.scene.motion_of_nodes != "fixed" else 1
        key = "".join(part.model_dump_json() for part in parts)
        if key not in measured:
            measured[key] = sample(setup) if isinstance(setup, Setup) else sample_of_system(setup)
        costs = measured[key]
        each = costs["seconds_factorization"] + SOLVES * costs["seconds_triangular_solve"]
        rows.append(
            {
                "case": case.id,
                **{name: case.parameters[name] for name in case.swept},
                "increments": increments,
                **costs,
                "seconds": increments * each + clouds * costs["seconds_operators"],
            }
        )
    return pd.DataFrame(rows)


def sample(setup: Setup) -> dict[str, float]:
    """Sizes and timings [s] of one scene with the operators' own matrix S·2B; all NaN when the cloud is bad."""
    try:
        cloud = setup.scene.cloud(setup.law)
        operators, seconds_operators = _timed(lambda: setup.discretizer.operators(cloud, bool(setup.scene.penalty)))
        inside = np.stack([2 * cloud.interior, 2 * cloud.interior + 1], axis=1).ravel()
        matrix = (operators.force @ (2.0 * operators.strain.tocsc()[:, inside])).tocsc()
        factors, seconds_factorization = _timed(lambda: setup.linear.factorize(matrix))
        _, seconds_solve = _timed(lambda: factors.solve(np.ones(matrix.shape[0])))
    except SolveError:
        return dict.fromkeys(SAMPLE, math.nan)
    found = (len(cloud.nodes), len(inside), seconds_operators, seconds_factorization, seconds_solve)
    return dict(zip(SAMPLE, found, strict=True))


@np.errstate(all="ignore")
def sample_of_system(setup: AlgebraicSetup) -> dict[str, float]:
    """The same of a system, with the Jacobian at its start; NaN for what cannot be timed where that is singular."""
    problem, seconds_operators = _timed(lambda: Algebraic(setup.scene))
    start = setup.scene.start()
    found = {**dict.fromkeys(SAMPLE, math.nan), "unknowns": len(start), "seconds_operators": seconds_operators}
    try:
        matrix = problem.jacobian(start)
        factors, found["seconds_factorization"] = _timed(lambda: setup.linear.factorize(matrix))
        _, found["seconds_triangular_solve"] = _timed(lambda: factors.solve(np.ones(len(start))))
    except SolveError:
        return found
    return found


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    begun = time.process_time()
    value = work()
    return value, time.process_time() - begun
