"""The section `timing` of a study."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from nlsolve.contracts.component import Component
from nlsolve.results.costs.lanes import EXCLUSIVE, SHARED


class Timing(Component):
    """How the cases of a study are timed."""

    noun: ClassVar[str] = "timing"

    lane: Literal["shared", "exclusive"] = Field(
        SHARED,
        description="shared: cases may run side by side, and the fastest of `rounds` counts; exclusive: one case at a "
        "time in a worker process that is warm and pinned to a core, all cases in turn, round after round, and the "
        "median counts",
    )
    rounds: int = Field(
        1,
        gt=0,
        description="how often all cases are run, one after the other; a case's fastest round counts, in the exclusive "
        "lane the median of all, of which these are the fewest",
    )
    precision: float = Field(
        0.03,
        gt=0,
        description="exclusive: half the width of the 95 % interval of the median over the median, at which a case has "
        "been timed enough; cases that differ in method only have the same rounds",
    )
    most_rounds: int = Field(30, gt=0, description="exclusive: rounds after which no further round begins")
    seconds: float = Field(
        600.0,
        gt=0,
        description="exclusive: seconds of `clock`, in all their rounds together, after which cases that differ in "
        "method only begin no further round",
    )
    clock: Literal["wall", "processor"] = Field(
        "processor",
        description="seconds the processor worked for the case, which other programs on the machine do not lengthen, "
        "or seconds that passed",
    )
    calibrate: bool = Field(
        False, description="measure after each case what a unit of its work costs, and predict its seconds from that"
    )

    @model_validator(mode="after")
    def _has_room_for_rounds(self) -> Timing:
        if self.is_exclusive and self.most_rounds < self.rounds:
            raise ValueError(f"most_rounds = {self.most_rounds} is less than rounds = {self.rounds}, the fewest")
        return self

    @property
    def is_exclusive(self) -> bool:
        """Whether the cases are timed in the exclusive lane."""
        return self.lane == EXCLUSIVE
