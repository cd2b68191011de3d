"""Triangles and supports of a cloud, which are found before any weight and kept while the nodes move a little."""

from __future__ import annotations

from dataclasses import dataclass, field

from nlsolve.plugin import Cloud
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles


@dataclass(frozen=True)
class Neighbours:
    """Triangles of a cloud, and the supports of each role ("strain", "force", "volume") once they have been found."""

    triangles: Triangles
    supports: dict[str, Supports] = field(default_factory=dict)

    def moved_to(self, cloud: Cloud) -> Neighbours:
        """The same neighbours on a cloud whose nodes have moved; supports are updated when weights are computed."""
        return Neighbours(self.triangles.moved_to(cloud), dict(self.supports))
