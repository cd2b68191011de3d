"""Node sets of an annulus r_t ≤ r ≤ r_p: rings, graded rings, rings graded to the law's layer, and scattered nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from nlsolve.plugin import Cloud
from nlsolve_scenes.nodes.between_circles import between_circles
from nlsolve_scenes.nodes.scatter import jittered, scatter


class NodeSet(BaseModel):
    """The fields that all node sets have. Equal fields give equal nodes."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    jitter: float = Field(
        0.0, ge=0, lt=0.5, description="random shift of interior nodes, as a fraction of the distance to the nearest"
    )
    seed: int = Field(0, ge=0, description="seed of scattered nodes and of the random shifts")


class AnnulusSet(NodeSet, ABC):
    """Nodes of an annulus with the boundary groups "tool" and "plate"."""

    def cloud(self, inner: float, outer: float) -> Cloud:
        """The nodes between the radii `inner` and `outer` [mm]."""
        return jittered(self.regular(inner, outer), self.jitter, self.seed)

    @abstractmethod
    def regular(self, inner: float, outer: float) -> Cloud:
        """The nodes before they are jittered."""


class Rings(AnnulusSet):
    """Rings at equal radial spacing h, each with floor(2 π r/h) nodes: the 2015 paper's 1780 nodes for h = 0.25 mm."""

    kind: Literal["rings"] = "rings"
    spacing: float = Field(0.25, gt=0, description="h [mm]")

    def regular(self, inner: float, outer: float) -> Cloud:
        """Rings at distances of h, or a little more or less so that the last one lies on the wall."""
        count = max(1, round((outer - inner) / self.spacing))
        # Not walked: where four nodes are on one circle all tables of these nodes were printed with Qhull's choice.
        return on_rings(np.linspace(inner, outer, count + 1), np.full(count + 1, self.spacing))


class GradedSet(AnnulusSet):
    """h(r) = min(first + growth max(0, d − even), middle + growth max(0, d − reach), spacing), d = |r − r_t|: spacing
    that grows away from the tool.
    """

    first: float = Field(0.1, gt=0, description="spacing at the tool [mm]")
    even: float = Field(0.0, ge=0, description="width of the band at the tool before the spacing grows [mm]")
    growth: float = Field(0.12, ge=0, description="growth of the spacing per mm of distance beyond that band")
    middle: float | None = Field(
        None, gt=0, description="largest spacing within the reach of the tool [mm]; absent: as `spacing`"
    )
    reach: float = Field(3.0, ge=0, description="distance from the tool up to which `middle` holds [mm]")
    spacing: float = Field(0.25, gt=0, description="largest spacing [mm]")

    def local_spacing(self, radii: np.ndarray, inner: float) -> np.ndarray:
        """h(r) [mm]."""
        distance = np.abs(radii - inner)
        h = np.minimum(self.first + self.growth * np.maximum(0.0, distance - self.even), self.spacing)
        if self.middle is None:
            return h
        return np.minimum(h, self.middle + self.growth * np.maximum(0.0, distance - self.reach))


class GradedRings(GradedSet):
    """Rings whose spacing grows from the tool outwards."""

    kind: Literal["graded-rings"] = "graded-rings"

    def regular(self, inner: float, outer: float) -> Cloud:
        """Rings at distances of h(r), stretched so that the last one lies on the wall."""
        radii = [inner]
        while radii[-1] < outer:
            radii.append(radii[-1] + float(self.local_spacing(np.array(radii[-1]), inner)))
        stretched = inner + (np.array(radii) - inner) * (outer - inner) / (radii[-1] - inner)
        return on_rings(stretched, self.local_spacing(stretched, inner), walked=True)


class Scattered(GradedSet):
    """Nodes in no order, at the spacing of graded rings, as an unstructured mesh has them."""

    kind: Literal["scattered"] = "scattered"

    def regular(self, inner: float, outer: float) -> Cloud:
        """Nodes at equal distances on both circles, and scattered nodes between them."""
        walls = {
            name: on_circle(radius, self.local_spacing(np.array(radius), inner))
            for name, radius in (("tool", inner), ("plate", outer))
        }

        def inside(points: np.ndarray) -> np.ndarray:
            radius = np.hypot(points[:, 0], points[:, 1])
            return (radius > inner) & (radius < outer)

        def spacing(points: np.ndarray) -> np.ndarray:
            return self.local_spacing(np.hypot(points[:, 0], points[:, 1]), inner)

        return scatter(walls, inside, spacing, self.seed)


@dataclass(frozen=True)
class Grading:
    """The fields of `Auto` for one motion of the tool, where a study leaves them out."""

    resolution: float
    layers: float
    growth: float
    smallest: float
    middle: float | None


SPIN = Grading(0.75, 5.0, 0.15, 0.008, None)
"""One layer, all around the tool, and nothing beyond it."""


def orbit(layer: float) -> Grading:
    """For a layer of so many tool radii: a thinner one, and lines beyond it on which the strain rate falls steeply, at
    a spacing of 0.17 n^(1/5) mm for the index n = √layer. The lines turn with the tool's velocity, so that the
    spacing depends on the radius alone.
    """
    return Grading(0.7, 1.0, 0.145, 0.0066, 0.17 * layer**0.1)


class Auto(NodeSet):
    """Graded rings with first = resolution · layer and even = layers · layer: the flow's layer at the tool decides.

    The layer is the distance over which the strain rate at the tool falls by e; it follows from the law and the motion
    (see the scene). Evenly spaced nodes across a few layers reduce the error more than finer ones at the tool.
    `smallest` limits the number of nodes where the layer is very thin: in the spin for n < 0.015, in the orbit for
    n < 0.08. The column `smallest_spacing` of the runs holds the first spacing chosen.
    """

    kind: Literal["auto"] = "auto"
    resolution: float | None = Field(
        None, gt=0, description="first spacing in layers: the smaller, the finer; absent: spin 0.75, orbit 0.7"
    )
    layers: float | None = Field(
        None, ge=0, description="width of the band before the spacing grows, in layers; absent: spin 5, orbit 1"
    )
    growth: float | None = Field(
        None, ge=0, description="growth of the spacing per mm beyond that band; absent: spin 0.15, orbit 0.145"
    )
    spacing: float = Field(0.25, gt=0, description="largest spacing [mm]")
    middle: float | None = Field(
        None,
        gt=0,
        description="largest spacing up to 3 mm from the tool [mm]; absent: spin as spacing, orbit 0.17 n^(1/5)",
    )
    smallest: float | None = Field(None, gt=0, description="least first spacing [mm]; absent: spin 0.008, orbit 0.0066")

    def rings(self, layer: float, motion: Grading) -> GradedRings:
        """The graded rings for a layer [mm], with what is left out as the `motion` has it."""
        asked = self.model_dump(include=set(Grading.__dataclass_fields__), exclude_none=True)
        grading = replace(motion, **asked)
        return GradedRings(
            first=min(max(grading.resolution * layer, grading.smallest), self.spacing),
            even=grading.layers * layer,
            growth=grading.growth,
            middle=grading.middle,
            **self.model_dump(include={"spacing", "jitter", "seed"}),
        )


def on_circle(radius: float, spacing: float | np.ndarray) -> np.ndarray:
    """floor(2 π r/h) nodes, at least 6, at equal distances on a circle about the origin, (B, 2)."""
    # The small shift keeps a quotient that is whole but for rounding from losing a node on some machines.
    count = max(6, int(np.floor(2.0 * np.pi * radius / spacing + 1e-9)))
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def on_rings(radii: np.ndarray, spacings: np.ndarray, walked: bool = False) -> Cloud:
    """Circles of radii (R,) with nodes at distances (R,); the first is the group "tool", the last "plate".

    walked : whether the cloud is told the triangles of a walk around the gaps, which takes a tenth of Qhull's time.
    """
    circles = [on_circle(radius, h) for radius, h in zip(radii, spacings, strict=True)]
    nodes, counts = np.concatenate(circles), np.array([len(circle) for circle in circles])
    groups = {"tool": np.arange(counts[0]), "plate": np.arange(len(nodes) - counts[-1], len(nodes))}
    return Cloud(nodes, groups, triangles_before=between_circles(counts) if walked else None)
