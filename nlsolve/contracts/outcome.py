"""How one solve ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from nlsolve.contracts import notebook
from nlsolve.contracts.status import Status
from nlsolve.series import Array

SHOWN = 6
"""Number of entries that are printed of a longer state, half of them from each end."""


@dataclass(frozen=True, eq=False, repr=False)
class Outcome:
    """How one solve ended: its status, its last state and residual, its work, and its steps.

    status : the kind of ending.
    detail : a sentence on this ending; the sentence of the status when there is no more to say.
    state : u, shape (U,), the last state that the method reached.
    residual_norm : the relative residual, which the driver computes: ‖R(u)‖₂ over the problem's scale, or |F_i| over
        what cancels in equation i, largest over the equations (`nlsolve.algebra.by_equation`).
    residual_absolute : ‖R(u)‖₂ in the unit of the problem; NaN when nothing was solved.
    rows : one dictionary for each step, in order; `steps` gives them as a frame.
    claimed_wrongly : True when the method, or a stopping test other than that of residuals, accepted a state whose
        residual is not small.
    denied_wrongly : True when the method reported failure at a state whose residual is small.
    blame : where the last residual is largest (`NonlinearProblem.blame`); empty after convergence.
    counts : how often each kind of work was done in this solve, by columns of `runs`.
    seconds : the time [s] that each kind of work took, "own" for the method's own arithmetic; their sum is the time
        spent in the method.
    newton_correction : max_j |Δu_j| over the size of u_j, where the driver has needed it to judge the state; else NaN.
    idle : number of steps to another state for which the method has asked for no work that is counted.
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
    residual_absolute: float = float("nan")
    newton_correction: float = float("nan")
    idle: int = 0

    @property
    def converged(self) -> bool:
        """Whether the stopping test was met, at a known root or at another one."""
        return self.status in (Status.CONVERGED, Status.OTHER_ROOT)

    @property
    def message(self) -> str:
        """How the solve ended, in a sentence."""
        said = self.status.sentence
        return said if self.detail == said else f"{said}; {self.detail}"

    @property
    def iterations(self) -> int:
        """Number of steps after the start."""
        return max(0, len(self.rows) - 1)

    @property
    def steps(self) -> pd.DataFrame:
        """One row for each state, the start first, with the columns of `steps` that apply to the method."""
        return pd.DataFrame(list(self.rows))

    def __repr__(self) -> str:
        return "\n".join(f"{name:<10}  {text}" for name, text in self._told().items())

    def _repr_html_(self) -> str:
        """What a notebook shows: status, residual, work, seconds, and a short state."""
        return notebook.facts(self._told())

    def _told(self) -> dict[str, str]:
        counts = ", ".join(_counted(number, name) for name, number in self.counts.items() if number)
        seconds = ", ".join(f"{_words(kind)} {value:.2g}" for kind, value in self.seconds.items() if value > 0.0)
        return {
            "status": f"{self.status.word}: {self.message}",
            "residual": f"{self.residual_norm:.2g}",
            "iterations": f"{self.iterations}",
            "work": counts or "none",
            "seconds": f"{sum(self.seconds.values()):.2g}" + (f": {seconds}" if seconds else ""),
            "state": _entries(self.state),
        }


def _words(name: str) -> str:
    return name.replace("_", " ")


def _counted(number: int, name: str) -> str:
    """A number with its noun: 1 residual, 2 residuals."""
    return f"{number} {_words(name.removesuffix('s') if number == 1 else name)}"


def _entries(state: Array) -> str:
    """The entries of a short state, or those at both ends of a long one."""
    shown = [f"{value:.4g}" for value in state]
    if len(shown) > SHOWN:
        shown = [*shown[: SHOWN // 2], "…", *shown[-SHOWN // 2 :]]
    return f"{', '.join(shown)} ({_counted(len(state), 'unknowns')})"
