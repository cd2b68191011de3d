"""Nodes of an annulus on concentric rings."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class Rings(BaseModel):
    """Rings at equal radial spacing h, each with floor(2 π r/h) nodes: the 2015 paper's 1780 nodes for h = 0.25 mm."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Literal["rings"] = "rings"
    spacing: float = Field(0.25, gt=0, description="h [mm]")

    def radii(self, inner: float, outer: float) -> tuple[np.ndarray, np.ndarray]:
        """Radii of the rings and the spacing at each, both (R,) [mm]."""
        count = max(1, round((outer - inner) / self.spacing))
        return np.linspace(inner, outer, count + 1), np.full(count + 1, self.spacing)


class GradedRings(BaseModel):
    """Rings whose spacing grows from the tool outwards: h(r) = min(first + growth (r − r_t), spacing)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kind: Literal["graded-rings"] = "graded-rings"
    first: float = Field(0.1, gt=0, description="spacing at the tool [mm]")
    growth: float = Field(0.12, ge=0, description="growth of the spacing per mm of distance from the tool")
    spacing: float = Field(0.25, gt=0, description="largest spacing [mm]")

    def local_spacing(self, radii: np.ndarray, inner: float) -> np.ndarray:
        """h(r) [mm]."""
        return np.minimum(self.first + self.growth * (radii - inner), self.spacing)

    def radii(self, inner: float, outer: float) -> tuple[np.ndarray, np.ndarray]:
        """Radii of the rings, stretched so that the last one lies on the wall, and the spacing at each, (R,) [mm]."""
        radii = [inner]
        while radii[-1] < outer:
            radii.append(radii[-1] + float(self.local_spacing(np.array(radii[-1]), inner)))
        stretched = inner + (np.array(radii) - inner) * (outer - inner) / (radii[-1] - inner)
        return stretched, self.local_spacing(stretched, inner)


RingNodes = Annotated[Rings | GradedRings, Field(discriminator="kind")]


def nodes_on_rings(radii: np.ndarray, spacings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (N, 2) and the number of nodes on each ring (R,): floor(2 π r/h), at least 6."""
    # The small shift keeps a quotient that is whole but for rounding from losing a node on some machines.
    counts = np.maximum(6, np.floor(2.0 * np.pi * radii / spacings + 1e-9).astype(int))
    radius = np.repeat(radii, counts)
    angle = 2.0 * np.pi * np.concatenate([np.arange(count) / count for count in counts])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), counts
