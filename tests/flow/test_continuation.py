"""Continuation to the first state: in a field of the law or the load, by values or by steps that find themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
from cases import setup
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel, StirringTool
from nlsolve_scenes.nodes.rings import Rings
from pydantic import ValidationError

from nlsolve import Status, Study
from nlsolve.contracts.outcome import Outcome
from nlsolve.flow.continuation import Solves, Stage, Start, walk
from nlsolve.plugin import Solve, TimeSteps
from nlsolve.registry.problems import StudyError
from nlsolve.solving.simulate import run_case as march
from nlsolve.solving.stopping import Budget
from nlsolve.testing.toy_problem import ToyProblem

COARSE = Rings(spacing=0.5)
LAW = PowerLaw(index=0.1, regularization=1e-3)


class Guarded:
    """Ends of stages: a solve succeeds within `reach` of the last one in log(by), in a given number of iterations."""

    def __init__(self, reach: float, iterations: int = 5) -> None:
        self.reach, self.iterations, self.at = reach, iterations, np.inf
        self.asked: list[float] = []

    def __call__(self, stage: Stage) -> Outcome:
        self.asked.append(stage.value)
        solved = not abs(np.log(self.at / stage.value)) > self.reach if np.isfinite(self.at) else True
        self.at = stage.value if solved else self.at
        status = Status.CONVERGED if solved else Status.STAGNATED
        return Outcome(status, status.sentence, np.zeros(1), 0.0, tuple({} for _ in range(self.iterations + 1)))


def walked(start: Start, end: Callable[[Stage], Outcome]) -> tuple[Outcome, Stage]:
    """The way under `LAW`, a solve for each stage, which ends as it is told; the last outcome, and of which stage."""
    stages: list[Stage] = []

    def solve(stage: Stage, last: bool) -> Solves:
        stages.append(stage)
        return (yield Solve(ToyProblem(), ToyProblem.solution))

    way = walk(start, LAW, solve)
    try:
        next(way)
        while True:
            way.send(end(stages[-1]))
    except StopIteration as finished:
        return finished.value


# The stages.


def test_natural_stages_are_the_values_on_the_way_and_the_target() -> None:
    solve = Guarded(10.0)
    outcome, stage = walked(Start(values=(1.0, 0.3, 0.05)), solve)
    assert outcome.status is Status.CONVERGED
    assert solve.asked == [1.0, 0.3, 0.1]  # 0.05 lies beyond the target
    assert stage.law == LAW
    assert walked(Start(values=()), Guarded(1.0))[1].law == LAW


def test_a_natural_continuation_ends_where_a_stage_fails() -> None:
    outcome, stage = walked(Start(values=(1.0, 0.9, 0.2, 0.15)), Guarded(0.5))
    assert (outcome.status, stage.value) == (Status.STAGNATED, 0.2)


def test_an_adaptive_step_doubles_where_it_is_easy() -> None:
    """A decade in log n: 1/8, then 1/8 + 1/4, then 1/8 + 1/4 + 1/2, then the rest."""
    solve = Guarded(10.0)
    walked(Start(values=(1.0, 10.0**-0.125), adaptive=True), solve)
    np.testing.assert_allclose(solve.asked, 10.0 ** -np.array([0.0, 0.125, 0.375, 0.875, 1.0]))
    hard = Guarded(10.0, iterations=20)
    walked(Start(values=(1.0, 10.0**-0.25), adaptive=True), hard)
    np.testing.assert_allclose(hard.asked, 10.0 ** -np.array([0.0, 0.25, 0.5, 0.75, 1.0]))


def test_an_adaptive_step_is_halved_where_it_fails() -> None:
    solve = Guarded(0.3 * np.log(10.0), iterations=20)
    outcome, stage = walked(Start(values=(1.0,), adaptive=True), solve)
    np.testing.assert_allclose(solve.asked, 10.0 ** -np.array([0.0, 1.0, 0.5, 0.25, 0.5, 0.75, 1.0]))
    assert (outcome.status, stage.law) == (Status.CONVERGED, LAW)


def test_an_adaptive_continuation_that_cannot_go_on_says_where_it_got() -> None:
    class Wall(Guarded):
        def __call__(self, stage: Stage) -> Outcome:
            outcome = super().__call__(stage)
            return outcome if stage.value > 0.2 else Outcome(Status.DIVERGED, "too steep", np.zeros(1), 1.0, ())

    outcome, stage = walked(Start(values=(1.0, 0.5), adaptive=True), Wall(10.0))
    assert outcome.status is Status.DIVERGED
    assert 0.19 < stage.value <= 0.2
    assert outcome.detail.startswith("the adaptive continuation got from 1 to 0.20")
    assert outcome.detail.endswith("not even a step of 0.01 of the way succeeds (start.smallest): too steep")


def test_the_load_scales_and_leaves_the_law_alone() -> None:
    stages = Start(by="load", values=(1e-4, 1e-2)).stages(LAW)
    assert [(stage.load, stage.law) for stage in stages] == [(1e-4, LAW), (1e-2, LAW), (1.0, LAW)]
    start = Start(by="load", values=(1e-4,), adaptive=True)
    middle = start.between(stages[0], stages[-1], 0.5)
    assert middle.load == middle.value == pytest.approx(1e-2)


@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        (Start(by="load"), r"start\.values = \[1\.0, 0\.5, 0\.3, 0\.2\]: a load grows to 1"),
        (Start(by="load", values=(0.0, 0.5)), "increasing values between 0 and 1"),
        (Start(by="lod"), r"start\.by = 'lod': the law 'power-law' is continued by index, regularization only"),
        (Start(by="regularization", adaptive=True), r"start\.by = 'regularization': .* the law's is 0"),
    ],
)
def test_what_cannot_be_gone_through_is_a_mistake_of_the_caller(start: Start, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        start.stages(PowerLaw(index=0.1, regularization=0.0))


def test_a_study_is_told_in_its_own_place() -> None:
    document: dict[str, Any] = {
        "question": "?",
        "scene": {"kind": "stirring-tool"},
        "law": {"kind": "power-law"},
        "discretizer": {"kind": "mls"},
        "solver": {"kind": "newton"},
        "start": {"by": "load"},
    }
    with pytest.raises(StudyError, match=r"start\.values = .*: a load grows to 1"):
        Study.from_dict(document)
    document["start"] = {"by": "regularisation"}
    with pytest.raises(StudyError, match=r"start\.by = 'regularisation': the law 'power-law' is continued by index, "):
        Study.from_dict(document)


@pytest.mark.parametrize("fields", [{"smallest": 0.0}, {"smallest": 1.0}, {"iterations": 0}, {"adaptive": "maybe"}])
def test_nonsense_is_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=next(iter(fields))):
        Start(**fields)


# On the way to the spin.


@pytest.fixture(scope="module")
def natural() -> dict[str, Any]:
    return march(setup(StirringTool(nodes=COARSE), 0.1324)).summary


@pytest.mark.parametrize(
    "start",
    [
        Start(adaptive=True),
        Start(by="regularization", values=(1e3, 1e2), adaptive=True),
        Start(by="load", values=(1e-6, 1e-5), adaptive=True),
        Start(by="load", values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)),
    ],
    ids=lambda start: f"{start.by} {start.adaptive}",
)
def test_every_continuation_leads_to_the_same_state(start: Start, natural: dict[str, Any]) -> None:
    row = march(setup(StirringTool(nodes=COARSE), 0.1324, start=start)).summary
    assert row["status"] == "converged", row["message"]
    assert row["velocity_error"] == pytest.approx(natural["velocity_error"], rel=1e-6)
    assert row["start_factorizations"] > 0
    assert row["factorizations"] > 0  # the last stage of a steady scene is the case's own
    assert row["residual_norm"] <= 1e-10


def test_a_marched_scene_begins_where_its_start_ended() -> None:
    start = Start(by="load", values=(1e-4, 1e-2), adaptive=True)
    time = TimeSteps(horizon=1e-4, increment=1e-4)
    row = march(setup(StirringTool(nodes=COARSE), 0.3, time=time, start=start)).summary
    assert (row["status"], row["increments"], row["factorizations"]) == ("converged", 1, 0)


def test_the_load_includes_the_force_on_the_body() -> None:
    """A linear channel at a tenth of its load is solved by a tenth of the velocity: one iteration from there to all."""
    record = march(setup(Channel(), 1.0, start=Start(by="load", values=(0.1,))))
    full = march(setup(Channel(), 1.0, start=Start(values=())))
    assert record.summary["start_factorizations"] == record.summary["factorizations"] == 1
    pd.testing.assert_frame_equal(record.fields, full.fields, rtol=1e-8, atol=1e-8)


def test_a_start_that_cannot_get_there_is_a_row_with_its_place() -> None:
    start = Start(adaptive=True, smallest=0.5, iterations=2)
    parts = {"time": TimeSteps(horizon=1e-4), "start": start, "budget": Budget(iterations=50)}
    row = march(setup(StirringTool(nodes=COARSE), 0.1324, **parts)).summary
    assert row["status"] == "budget spent"
    assert "on the way to the first state, at index = 0." in row["message"]
    assert "the adaptive continuation got from 1 to" in row["message"]
