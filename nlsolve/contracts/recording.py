"""The section `record` of a study: what is kept of a case beside its rows and its last state."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from nlsolve.contracts.component import Component


class IterateRecording(Component):
    """What is recorded of a case of any scene."""

    noun: ClassVar[str] = "record"
    incidental: ClassVar[frozenset[str]] = frozenset({"iterates"})

    iterates: bool = Field(
        False,
        description="keep the state of every row of `steps` beside the case, for results.iterates; a case that was run "
        "without is run again",
    )
