"""Laws with ε₀ = 0 from rest: solved, or refused where mathematics has no finite viscosity, with the place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from nlsolve_laws import CarreauYasuda, Cross, NortonHoff, PowerLaw, SellarsTegart

import nlsolve
from nlsolve.contracts.continuum.law import stress, tangent_moduli
from nlsolve.plugin import ConstitutiveLaw, SolveError, Status
from tests.cases import spin_flow

BY_INDEX: dict[str, dict[str, Any]] = {
    "power-law": {},
    "norton-hoff": {},
    "carreau-yasuda": {"sharpness": 1.0},
    "cross": {},
}
AT_REST = [
    *(PowerLaw(index=n, regularization=0.0) for n in (1.0, 1.5, 2.0, 3.0, 4.0)),
    *(NortonHoff(index=n, regularization=0.0) for n in (1.0, 1.3)),
    *(CarreauYasuda(index=n, sharpness=a, regularization=0.0) for n in (0.3, 1.0, 1.7) for a in (0.7, 1.0, 2.0, 3.0)),
    *(Cross(index=n, regularization=0.0) for n in (0.3, 1.0)),
    *(SellarsTegart(stress_exponent=m, regularization=0.0) for m in (0.5, 1.0)),
]


def spun(law: dict[str, Any], solver: str, start: dict[str, Any]) -> pd.Series:
    """The steady spin on coarse rings."""
    scene = {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.75}}
    study = {"question": "ε₀ = 0?", "scene": scene, "discretizer": {"kind": "delaunay"}, "law": law}
    return nlsolve.run({**study, "solver": {"kind": solver}, "start": start}).runs.iloc[0]


@pytest.mark.parametrize("solver", ["newton", "anm"])
@pytest.mark.parametrize("index", [0.3, 0.5, 1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("kind", BY_INDEX)
def test_every_law_at_every_index_is_solved_by_way_of_a_newtonian_material(
    kind: str, index: float, solver: str
) -> None:
    if kind == "cross" and index > 1.0:
        with pytest.raises(nlsolve.StudyError, match="index"):
            spun({"kind": kind, "index": index}, solver, {})
        return
    law = {"kind": kind, "index": index, "regularization": 0.0, **BY_INDEX[kind]}
    run = spun(law, solver, {"values": [1.0, 0.7, 0.5]})
    assert run["status"] == "converged", run["message"]
    assert run["residual_norm"] <= 1e-8


@pytest.mark.parametrize(("exponent", "values"), [(1.0, []), (0.5, [100.0, 1.0]), (5.41, [100.0, 10.0, 1.0, 0.1])])
@pytest.mark.parametrize("solver", ["newton", "anm"])
def test_hot_working_is_solved_by_way_of_a_large_regularization(
    exponent: float, values: list[float], solver: str
) -> None:
    law = {"kind": "sellars-tegart", "stress_exponent": exponent, "regularization": 0.0}
    run = spun(law, solver, {"by": "regularization", "values": values})
    assert run["status"] == "converged", run["message"]


@pytest.mark.parametrize("solver", ["newton", "anm", "robust"])
@pytest.mark.parametrize(
    "law",
    [
        {"kind": "power-law", "index": 0.5},
        {"kind": "norton-hoff", "index": 0.5},
        {"kind": "sellars-tegart", "stress_exponent": 2.0},
    ],
    ids=lambda law: law["kind"],
)
def test_an_infinite_viscosity_at_rest_is_a_sentence_with_the_place(law: dict[str, Any], solver: str) -> None:
    by = "regularization" if law["kind"] == "sellars-tegart" else "index"
    run = spun({**law, "regularization": 0.0}, solver, {"by": by, "values": []})
    assert run["status"] == "non finite"
    assert f"the law '{law['kind']}' has no finite viscosity at (" in run["message"]
    assert "where ε̄ = 0 1/s (" in run["message"]
    assert "give it a regularization ε₀ > 0, or begin from a state that is deformed everywhere" in run["message"]
    assert run["blame_rate"] == 0.0


@pytest.mark.parametrize(
    "law",
    [{"kind": "cross", "index": 0.5}, {"kind": "carreau-yasuda", "index": 0.5, "sharpness": 1.0}],
    ids=lambda law: law["kind"],
)
def test_a_law_that_is_finite_but_not_analytic_at_rest_has_a_tangent_there_and_no_series(law: dict[str, Any]) -> None:
    law = {**law, "regularization": 0.0}
    assert spun(law, "newton", {"values": []})["status"] == "converged"
    run = spun(law, "anm", {"values": []})
    assert run["status"] == "non finite"
    assert f"the law '{law['kind']}' has no series at (" in run["message"]
    assert "x**0." in run["message"]
    assert "has no power series at x = 0" in run["message"]
    assert "or choose a method that needs no series, such as newton" in run["message"]


@pytest.mark.parametrize("law", AT_REST, ids=repr)
def test_the_tangent_at_rest_is_the_derivative_of_the_stress(law: ConstitutiveLaw) -> None:
    """S(h e)/h → C e for every direction e, as h → 0; beside it a point that is deformed."""
    h = 1e-60
    rates = np.array([[0.0, 1.0], [0.0, -1.0], [0.0, 0.5]])
    moduli = tangent_moduli(law, rates)
    assert np.isfinite(moduli).all()
    for direction in np.eye(3):
        at_rest = stress(law, h * direction[:, None])[:, 0] / h
        np.testing.assert_allclose(moduli[:, :, 0] @ direction, at_rest, rtol=1e-6, atol=1e-12)
        step = 1e-6 * direction[:, None]
        moved = (stress(law, rates + step) - stress(law, rates - step))[:, 1] / 2e-6
        np.testing.assert_allclose(moduli[:, :, 1] @ direction, moved, rtol=1e-6, atol=1e-6)


def test_a_tangent_that_is_infinite_is_refused_with_the_place() -> None:
    flow = spin_flow(0.5, regularization=0.0)
    with np.errstate(all="ignore"), pytest.raises(SolveError, match=r"no finite viscosity at \(") as refusal:
        flow.jacobian(np.zeros(2 * len(flow.cloud.interior)))
    assert refusal.value.status is Status.NON_FINITE


def test_a_series_is_refused_order_by_order_with_the_place() -> None:
    flow = spin_flow(1.5, regularization=0.0)
    rest = np.zeros(2 * len(flow.cloud.interior))
    expansion = flow.expand(rest)
    np.testing.assert_array_equal(expansion.coefficient(0), flow.residual(rest))
    with pytest.raises(SolveError, match=r"has no series at \(.*\), where ε̄ = 0 1/s"):
        expansion.remainder(1)
    expansion.append(np.ones_like(rest))
    with pytest.raises(SolveError, match=r"x\*\*0.25 has no power series at x = 0") as refusal:
        expansion.coefficient(1)
    assert refusal.value.status is Status.NON_FINITE


@pytest.mark.parametrize(
    ("index", "expected"),
    [(0.3, [2.0, 1.0, 0.3]), (1.0, [2.0, 1.0]), (1.7, [1.0, 1.5, 1.7]), (3.0, [2.0, 1.0, 1.5, 3.0])],
)
def test_an_index_above_one_is_reached_from_one(index: float, expected: list[float]) -> None:
    path = PowerLaw(index=index).continuation("index", (2.0, 1.0, 1.5) if index > 1.0 else (2.0, 1.0, 0.2))
    assert [law.index for law in path] == expected
