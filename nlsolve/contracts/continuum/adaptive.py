"""Nodes that follow the solution: what a user asks of them, and the limits within which they are made."""

from __future__ import annotations

from typing import Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field

from nlsolve.series import Array


class Spacing(Protocol):
    """h(x): the distance of a node from its neighbours that is wanted at a place."""

    def __call__(self, points: Array, /) -> Array:
        """h (P,) [mm] at points (P, 2) [mm]."""


class AdaptiveNodes(BaseModel):
    """Nodes for an error: the steady flow is solved, its error estimated, and solved again on a cloud whose spacing
    follows the second derivatives of the velocity, until the estimate is at most `error`.

    The estimate is that of the relative ℓ² error inside, and of the largest error of a node inside over the largest
    speed: both must be at most `error`. Equal fields give equal nodes.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Literal["adaptive"] = "adaptive"
    error: float = Field(
        default=0.005, gt=0, lt=1, description="largest error of the velocity, relative, by its estimate"
    )
    most_nodes: int = Field(default=30_000, gt=0, description="nodes of the largest cloud")
    most_rounds: int = Field(default=8, gt=0, description="clouds made from a solution, one after the other")
    spacing: float = Field(default=0.25, gt=0, description="largest spacing [mm]")
    seed: int = Field(default=0, ge=0, description="seed of the nodes that are scattered")
