"""The section `timing` of a study."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from nlsolve.contracts.component import Component


class Timing(Component):
    """How the cases of a study are timed."""

    noun: ClassVar[str] = "timing"

    rounds: int = Field(
        1, gt=0, description="how often all cases are run, one after the other; a case's fastest round counts"
    )
    clock: Literal["wall", "processor"] = Field(
        "processor",
        description="seconds the processor worked for the case, which other programs on the machine do not lengthen, "
        "or seconds that passed",
    )
    calibrate: bool = Field(
        False, description="measure after each case what a unit of its work costs, and predict its seconds from that"
    )
