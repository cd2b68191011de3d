"""What is found on a cloud before any weight: triangles and supports, kept while its nodes move a little."""

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
        """The same at other places of the nodes; supports follow when their weights are asked for."""
        return Neighbours(self.triangles.moved_to(cloud), dict(self.supports))
