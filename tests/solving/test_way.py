"""The way to a first state that one case has solved, taken by others: the same numbers, and no factorisation for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pandas as pd
import pytest
from cases import FlowCase, setup
from nlsolve_laws import PowerLaw
from nlsolve_linear.superlu import SuperLU
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import AsymptoticNumericalMethod, ModifiedNewton

from nlsolve.contracts.status import CaseStopped, Status
from nlsolve.flow.continuation import Start
from nlsolve.plugin import NodeMotion, Physics, TimeSteps
from nlsolve.results.columns import RUNS
from nlsolve.solving.simulate import Record, run_case
from nlsolve.solving.stopping import Budget
from nlsolve.solving.way import Way

COARSE = Rings(spacing=0.75)
MARCH = {
    "time": TimeSteps(horizon=3e-4, increment=1e-4),
    "physics": Physics(inertia=True, penalty=100.0),
    "motion": NodeMotion(nodes="lagrangian"),
}


class Watched(SuperLU):
    """Keeps the number of matrices that it has factorised."""

    def factorize(self, matrix: Any, similar: Any = None) -> Any:
        factorised.append(matrix.shape)
        return super().factorize(matrix, similar)


factorised: list[tuple[int, int]] = []


def case(index: float = 0.3, **parts: Any) -> FlowCase:
    return setup(StirringTool(nodes=COARSE), index, **(MARCH | parts))


def solved(parts: FlowCase) -> tuple[Record, list[Way]]:
    """The record of a case, and the ways that it has shared."""
    found: list[Way] = []
    return run_case(parts, share=found.append), found


def assert_same(one: Record, other: Record) -> None:
    """Whatever no clock has measured is the same to the last digit."""

    def frames(record: Record) -> list[pd.DataFrame]:
        measured = [name for name in RUNS if name.startswith("seconds") or name in ("factor_solve_ratio", "lane")]
        return [
            frame.drop(columns=measured, errors="ignore") for frame in (pd.DataFrame([record.summary]), record.steps)
        ]

    for left, right in zip(frames(one), frames(other), strict=True):
        pd.testing.assert_frame_equal(left, right, check_exact=True)


@pytest.mark.parametrize(
    "start",
    [Start(), Start(adaptive=True), Start(by="load", values=(1e-2, 1e-1))],
    ids=["values", "adaptive", "load"],
)
@pytest.mark.parametrize("scene", [MARCH, {}], ids=["march", "steady"])
def test_a_way_that_is_taken_gives_the_numbers_of_one_that_is_solved(scene: dict[str, Any], start: Start) -> None:
    parts = setup(StirringTool(nodes=COARSE), 0.3, start=start, solver=AsymptoticNumericalMethod(order=12), **scene)
    _, (way, *_) = solved(replace(parts, solver=ModifiedNewton()))
    alone = run_case(parts)
    led = run_case(parts, way=way)
    assert_same(alone, led)
    assert led.summary["start_factorizations"] > 3


def test_the_pressure_on_the_way_is_that_of_the_way() -> None:
    parts = case(physics=Physics(inertia=True, penalty=30.0, divergence_tolerance=1e-4))
    alone, (way,) = solved(parts)
    led = run_case(parts, way=way)
    assert_same(alone, led)


def test_a_way_costs_the_case_that_takes_it_one_factorisation_for_the_ordering() -> None:
    parts = case(linear=Watched(ordering="mmd-ata"))
    factorised.clear()
    alone, (way,) = solved(parts)
    whole = len(factorised)
    factorised.clear()
    news: list[Way] = []
    led = run_case(parts, way=way, share=news.append)
    assert news == [], "what was taken whole is no news"
    assert len(factorised) == whole - alone.summary["start_factorizations"] + 1
    assert led.summary["start_factorizations"] == alone.summary["start_factorizations"]
    assert led.summary["seconds_start"] == alone.summary["seconds_start"]


@pytest.mark.parametrize(
    "changes",
    [
        {"law": PowerLaw(index=0.3, regularization=1.0)},
        {"start": Start(tolerance=1e-9)},
        {"start": Start(solver=ModifiedNewton())},
        {"start": Start(values=(1.0, 0.6))},
    ],
    ids=["law", "tolerance", "solver", "values"],
)
def test_a_way_of_another_case_serves_no_further_than_it_leads(changes: dict[str, Any]) -> None:
    """The Newtonian stage is the same for two of them; the rest is solved, and shared."""
    _, (way,) = solved(case())
    parts = replace(case(), **changes)
    news: list[Way] = []
    led, alone = run_case(parts, way=way, share=news.append), run_case(parts)
    assert_same(alone, led)
    assert len(news) == 1


def test_a_state_whose_residual_is_not_small_is_not_taken() -> None:
    alone, (way,) = solved(case())
    first = way.stretches[0]
    spoilt = replace(first, outcome=replace(first.outcome, state=1.001 * first.outcome.state))
    led = run_case(case(), way=Way((spoilt, *way.stretches[1:])))
    assert_same(alone, led)


def test_a_way_that_fails_fails_for_all() -> None:
    parts = case(0.05, budget=Budget(iterations=3))
    alone, (way,) = solved(parts)
    assert alone.outcome.status is not Status.CONVERGED
    assert way.stretches[-1].outcome.status is alone.outcome.status
    led = run_case(parts, way=way)
    assert led.summary["message"] == alone.summary["message"]
    assert led.summary["start_factorizations"] == alone.summary["start_factorizations"]


def test_a_way_that_was_stopped_at_a_limit_is_not_shared() -> None:
    class Stopping(SuperLU):
        def factorize(self, matrix: Any, similar: Any = None) -> Any:
            raise CaseStopped(Status.TIMED_OUT, "limits.seconds = 1")

    record, ways = solved(case(linear=Stopping()))
    assert record.outcome.status is Status.TIMED_OUT
    assert ways == []


def test_rest_has_no_way() -> None:
    assert solved(case(start=Start(at="rest")))[1] == []
    assert case().scene.way(case(start=Start(at="rest"))) == ()
    assert "law" in case().scene.way(case())
    assert StirringTool().way(setup(StirringTool(), start=Start(values=()))) == ()
