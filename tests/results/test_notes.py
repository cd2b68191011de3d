"""What a method notes of a step, in the frame `steps` of a flow and of a system."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from cases import PLAIN, SystemParts, setup
from nlsolve_rules.refresh import EveryIteration
from nlsolve_scenes import StirringTool
from nlsolve_scenes.nodes.rings import Rings
from nlsolve_solvers import Newton
from nlsolve_systems import Published

from nlsolve.plugin import Step
from nlsolve.solving.simulate import run_case


class Numbered(Newton):
    """Newton's steps, each with its number, for which there is no column, and a length of its own."""

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        for number, step in enumerate(super().steps(problem, tangent, start)):
            yield Step(step.state, notes={"number": number, "length": 7.0})


RECORDS = {
    "flow": lambda: run_case(setup(StirringTool(nodes=Rings(spacing=0.75)), solver=Numbered())),
    "system": lambda: run_case(
        SystemParts(scene=Published(problem="wood"), linear=PLAIN, solver=Numbered(), refresh=EveryIteration())
    ),
}


@pytest.mark.parametrize("kind", RECORDS)
def test_a_note_without_a_column_stands_behind_the_columns(kind: str) -> None:
    steps = RECORDS[kind]().steps
    assert list(steps.columns)[-1] == "note.number"
    assert list(steps["note.number"]) == list(steps["step"])
    assert set(steps["length"]) == {7.0}
