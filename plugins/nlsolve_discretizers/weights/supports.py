"""The neighbours of each target among the sources: the nearest, or all within a radius; more if they lie on one side.

T targets, S sources, k the largest number of neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from nlsolve.plugin import SolveError, Status
from nlsolve_discretizers.kernels.offsets import offsets
from nlsolve_discretizers.kernels.quadrants import quadrants, surrounded
from nlsolve_discretizers.weights.lists import Lists, by_tree

REACH = 1.5  # times the distance of the farthest neighbour: a quadrant whose nearest source lies beyond is left empty


@dataclass(frozen=True)
class Supports:
    """The neighbours of T targets among the sources.

    index : (T, k); those of target t are its first count[t] columns, in order.
    count : (T,).
    radius : (T,) [mm], half-way to the first source that is no neighbour.
    farthest : (T,) [mm], distance of the last neighbour.
    """

    index: np.ndarray
    count: np.ndarray
    radius: np.ndarray
    farthest: np.ndarray

    @classmethod
    def nearest(
        cls,
        sources: np.ndarray,
        targets: np.ndarray,
        count: int | np.ndarray,
        balanced: bool = False,
        lists: Lists | None = None,
    ) -> Supports:
        """The `count` nearest sources, one number or (T,). `balanced` supports grow, to twice `count` at most, until
        every quadrant around the target that has a source within REACH holds a neighbour.

        lists : of `count` sources, where there are such.
        Raises SolveError (bad cloud) if there are too few sources.
        """
        counts = np.broadcast_to(count, len(targets))
        largest = int(np.max(count, initial=1))
        if len(sources) <= largest:
            raise SolveError(
                Status.BAD_CLOUD, f"a support of {largest} neighbours was asked for among {len(sources)} points"
            )
        if lists is None:
            query = by_tree(scipy.spatial.cKDTree(sources), targets)
            plain = cls._of(*query(largest + 1, np.arange(len(targets))), counts)
        else:
            query, plain = lists.query, cls._reaching(*lists.nearest(), counts)
        if not balanced:
            return plain
        lopsided = np.flatnonzero(~surrounded(sources, targets, plain.index, counts))
        if not len(lopsided):
            return plain
        most = min(2 * largest, len(sources) - 1)
        distance, index = query(most + 1, lopsided)
        apart = offsets(sources, targets[lopsided], index[:, :most])
        return plain.replaced(lopsided, cls._of(distance, index, _balanced(apart, distance, counts[lopsided])))

    @classmethod
    def _of(cls, distance: np.ndarray, index: np.ndarray, counts: np.ndarray) -> Supports:
        """Supports from the sources that a tree found for each target: `counts` neighbours and at least one more."""
        row, width = np.arange(len(counts)), int(counts.max(initial=1))
        beyond = (np.arange(width) >= counts[:, None]) * (int(index.max(initial=0)) + 1)
        in_order = np.sort(index[:, :width] + beyond, axis=1) - beyond
        return cls._reaching(in_order, distance[row, counts - 1], distance[row, counts], counts)

    @classmethod
    def _reaching(cls, index: np.ndarray, farthest: np.ndarray, beyond: np.ndarray, counts: np.ndarray) -> Supports:
        """Supports from the distances of the last neighbour and of the next source."""
        # On a regular grid the two tie, and a source on the rim would weigh nothing: the rim lies just beyond it.
        return cls(index, counts, np.maximum(0.5 * (farthest + beyond), 1.001 * farthest), farthest)

    @classmethod
    def within(cls, sources: np.ndarray, targets: np.ndarray, radius: float) -> Supports:
        """All sources nearer than `radius`."""
        tree = scipy.spatial.cKDTree(sources)
        count = np.maximum(tree.query_ball_point(targets, radius, return_length=True), 1)
        distance, index = tree.query(targets, np.arange(1, int(count.max()) + 1))
        farthest = distance[np.arange(len(targets)), count - 1]
        return cls(index, count, np.full(len(targets), radius), farthest)

    def moved(self, sources: np.ndarray, targets: np.ndarray) -> Supports:
        """The same neighbours at other places; radii change with the farthest of them, so that no weight jumps."""
        distance = np.hypot(*offsets(sources, targets, self.index))
        farthest = np.where(np.arange(len(distance))[:, None] < self.count, distance, 0.0).max(axis=0)
        return replace(self, radius=self.radius * farthest / self.farthest, farthest=farthest)

    def replaced(self, which: np.ndarray, others: Supports) -> Supports:
        """These supports, with those of the targets `which` replaced by `others`."""
        width = max(self.index.shape[1], others.index.shape[1])
        index = np.pad(self.index, ((0, 0), (0, width - self.index.shape[1])))
        index[which, : others.index.shape[1]] = others.index
        count, radius, farthest = self.count.copy(), self.radius.copy(), self.farthest.copy()
        count[which], radius[which], farthest[which] = others.count, others.radius, others.farthest
        return Supports(index, count, radius, farthest)


def _balanced(offsets: np.ndarray, distance: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Counts (T,) that include the nearest source of every quadrant, if within REACH, for offsets (2, most, T)."""
    row = np.arange(len(counts))
    rim = REACH * distance[row, counts - 1]
    needed = counts.copy()
    for quadrant in quadrants(offsets):
        first = quadrant.argmax(axis=0)
        reachable = quadrant[first, row] & (distance[row, first] <= rim)
        needed = np.where(reachable, np.maximum(needed, first + 1), needed)
    return needed
