"""Cases in this process, one after the other: for debugging, and for components that no other process can import."""

from __future__ import annotations

import time
from collections.abc import Generator

from nlsolve.results.costs.lanes import ALONE
from nlsolve.results.frames import Part
from nlsolve.running.engines.engine import SECONDS_BETWEEN_LOOKS, Engine, Listener, Turn, Turns
from nlsolve.running.engines.execution import Debugger, execute
from nlsolve.solving.simulate import Progress
from nlsolve.study.timing import Timing


class InProcess(Engine):
    """No limit is kept: what a case does to the interpreter, it does to this one.

    debugger : see `execute`.
    """

    def __init__(self, debugger: Debugger | None = None) -> None:
        super().__init__(ALONE)
        self.debugger = debugger

    def parts(self, turns: Turns, timing: Timing, tell: Listener) -> Generator[tuple[Turn, Part], None, None]:
        """Yields the turns in their order."""
        for turn in turns:
            if turn is None:
                time.sleep(SECONDS_BETWEEN_LOOKS)
                continue
            tell(turn.event())
            yield turn, run_here(turn, timing, tell, self.lane, self.debugger)


def run_here(turn: Turn, timing: Timing, tell: Listener, lane: str, debugger: Debugger | None = None) -> Part:
    """The part of a turn, run in this process."""
    case = turn.case

    def listen(progress: Progress) -> None:
        tell(turn.event(progress))

    return execute(case.id, case.parameters, case.parts, timing, listen, lane, debugger, turn.way, turn.share)
