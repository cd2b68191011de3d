"""How one solve ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from nlsolve.contracts.status import Status
from nlsolve.series import Array


@dataclass(frozen=True)
class Outcome:
    """How one solve ended: its status, the last state, the residual that counts, and a row a step.

    claimed_wrongly, denied_wrongly : the method said converged of a state that is no solution, failed of one that is.
    blame : of a solve that failed, where the last residual is largest (`NonlinearProblem.blame`).
    """

    status: Status
    detail: str
    state: Array
    residual_norm: float
    steps: tuple[dict[str, Any], ...]
    claimed_wrongly: bool = False
    denied_wrongly: bool = False
    blame: Mapping[str, float] = field(default_factory=dict)
