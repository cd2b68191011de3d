"""How one solve ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from nlsolve.contracts.status import Status
from nlsolve.series import Array

SHOWN = 6
"""Entries of a longer state that are printed, from both ends."""


@dataclass(frozen=True, eq=False, repr=False)
class Outcome:
    """How one solve ended: its status, the last state, the residual that counts, the work it took, and its steps.

    status, detail : the ending, and what is to be said of this one; the sentence of the status where that is all.
    state : u, (U,), the last one that the method reached.
    residual_norm : ‖R(u)‖₂ over the problem's scale, asked for outside the method.
    rows : a dictionary a step, in order; `steps` is the same as a frame.
    claimed_wrongly, denied_wrongly : the method said converged of a state that is no solution, failed of one that is.
    blame : of a solve that failed, where the last residual is largest (`NonlinearProblem.blame`).
    counts : how often each kind of work was done in this solve, by the names of the columns of `runs`.
    seconds : the time each kind of work took, "own" for what the method did by itself; their sum is all of it.
    """

    status: Status
    detail: str
    state: Array
    residual_norm: float
    rows: tuple[dict[str, Any], ...] = ()
    claimed_wrongly: bool = False
    denied_wrongly: bool = False
    blame: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """Whether the stopping test was met, at whichever root."""
        return self.status in (Status.CONVERGED, Status.OTHER_ROOT)

    @property
    def message(self) -> str:
        """How the solve ended, in a sentence."""
        said = self.status.sentence
        return said if self.detail == said else f"{said}; {self.detail}"

    @property
    def iterations(self) -> int:
        """Steps taken from the start."""
        return max(0, len(self.rows) - 1)

    @property
    def steps(self) -> pd.DataFrame:
        """A row a state, the start first, with the columns of `steps` that apply."""
        return pd.DataFrame(list(self.rows))

    def __repr__(self) -> str:
        counts = ", ".join(_counted(number, name) for name, number in self.counts.items() if number)
        seconds = ", ".join(f"{_words(kind)} {value:.2g}" for kind, value in self.seconds.items() if value > 0.0)
        lines = {
            "status": f"{self.status.word}: {self.message}",
            "residual": f"{self.residual_norm:.2g}",
            "iterations": f"{self.iterations}",
            "work": counts or "none",
            "seconds": f"{sum(self.seconds.values()):.2g}" + (f": {seconds}" if seconds else ""),
            "state": _entries(self.state),
        }
        return "\n".join(f"{name:<10}  {text}" for name, text in lines.items())


def _words(name: str) -> str:
    return name.replace("_", " ")


def _counted(number: int, name: str) -> str:
    """1 residual, 2 residuals"""
    return f"{number} {_words(name.removesuffix('s') if number == 1 else name)}"


def _entries(state: Array) -> str:
    """A short state, or both ends of a long one."""
    shown = [f"{value:.4g}" for value in state]
    if len(shown) > SHOWN:
        shown = [*shown[: SHOWN // 2], "…", *shown[-SHOWN // 2 :]]
    return f"{', '.join(shown)} ({_counted(len(state), 'unknowns')})"
