"""Triangles and supports of a cloud: found before any weight, kept while the nodes move a little, or renewed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from nlsolve.plugin import Cloud
from nlsolve_discretizers.weights.lists import SPARE, Lists
from nlsolve_discretizers.weights.supports import Supports
from nlsolve_discretizers.weights.triangles import Triangles

Numbers = np.ndarray | None


@dataclass(frozen=True)
class Neighbours:
    """Triangles of a cloud, and the supports of each role ("strain", "force", "volume") once they have been found.

    lists : of each role, once they have been made; only on a cloud whose nodes have moved.
    before : the lists from before the nodes moved; None on a cloud whose nodes have not.
    points_before : (M,), the number that each strain point had then, −1 for new ones; None: the same as now.
    """

    triangles: Triangles
    supports: dict[str, Supports] = field(default_factory=dict)
    lists: dict[str, Lists] = field(default_factory=dict)
    before: dict[str, Lists] | None = None
    points_before: np.ndarray | None = None

    def moved_to(self, cloud: Cloud) -> Neighbours:
        """The same neighbours on a cloud whose nodes have moved; supports are updated when weights are computed."""
        return Neighbours(self.triangles.moved_to(cloud), dict(self.supports), self.lists)

    def renewed(self, cloud: Cloud, ends: Callable[[Triangles], np.ndarray] | None) -> Neighbours:
        """Those of a cloud whose nodes have moved, found with the help of these.

        ends : the edges (M, 2) of triangles whose midpoints are the strain points; None where these are the nodes.
        """
        triangles = self.triangles.renewed(cloud)
        numbers = None if ends is None else _numbers(ends(triangles), ends(self.triangles), len(cloud.nodes))
        return Neighbours(triangles, before=self.lists, points_before=numbers)

    def listed(self, role: str, sources: np.ndarray, targets: np.ndarray, count: int) -> Lists | None:
        """Lists of the `count` nearest sources in a role; None on a cloud whose nodes have not moved, and
        where there are no more sources.
        """
        if self.before is None or len(sources) <= count:
            return None
        earlier, cloud = self.before.get(role), self.triangles.cloud
        tree = cloud.tree if sources is cloud.nodes else None
        if earlier is None:
            self.lists[role] = Lists.of(sources, targets, count, SPARE, tree)
        else:
            numbers = {"strain": (None, self.points_before), "force": (self.points_before, None)}
            self.lists[role] = earlier.moved(sources, targets, *numbers.get(role, (None, None)), tree)
        return self.lists[role]


def _numbers(edges: np.ndarray, before: np.ndarray, nodes: int) -> np.ndarray:
    """The number of each of the `edges` (M, 2) among those of before, −1 for new ones; both are in order."""
    now, then = (ends[:, 0] * nodes + ends[:, 1] for ends in (edges, before))
    number = np.minimum(np.searchsorted(then, now), len(then) - 1)
    return np.where(then[number] == now, number, -1)
