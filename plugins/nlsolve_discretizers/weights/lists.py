"""|x_s − x_t| ≥ r − Σ (|δx_t| + max_s |δx_s|) : the nearest sources of each target, listed once and ranked anew.

A source that was farther than r from a target cannot have come nearer than that; lists with a few more sources than are
needed therefore hold the nearest ones until the motion has used up the rest (Verlet 1967). The maximum is over sources
near enough to come so near: what moves fast elsewhere does not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from nlsolve.plugin import largest_near
from nlsolve_discretizers.kernels.ranking import ranked

SPARE = 8
"""Sources that are listed beyond those needed, where a motion is to follow."""

TIE = 1e-12
"""Two sources are equally near whose distances differ by less, relatively: the tree decides which is the last one."""

FEW_LEAVES = 128  # sources in a leaf of a tree that is asked about few targets

FAR = 2.0
"""Times the distance of the last of the nearest sources: farther than the spare ones, as a rule."""


@dataclass(frozen=True)
class Lists:
    """The nearest sources of T targets.

    sources, targets : their places (S, 2) and (T, 2) [mm].
    index : (T, K), the `count` nearest first, by number, then some to spare; −1 for a source that is no more.
    farthest, beyond : (T,) [mm], distances of the last of the nearest, and of the next source, infinite for none.
    reach : (T,) [mm], every source nearer than this is listed.
    known_tree : the tree of the sources, where there is one already.
    """

    sources: np.ndarray
    targets: np.ndarray
    count: int
    index: np.ndarray
    farthest: np.ndarray
    beyond: np.ndarray
    reach: np.ndarray
    known_tree: scipy.spatial.cKDTree | None = None

    @classmethod
    def of(
        cls,
        sources: np.ndarray,
        targets: np.ndarray,
        count: int,
        spare: int = 1,
        tree: scipy.spatial.cKDTree | None = None,
    ) -> Lists:
        """The `count` nearest sources, of more, and `spare` others, one at least."""
        every, listed = np.arange(len(targets)), min(count + spare, len(sources))
        index, (farthest, beyond, reach) = np.empty((len(targets), listed), np.intp), np.empty((3, len(targets)))
        lists = cls(sources, targets, count, index, farthest, beyond, reach, tree)
        return lists._filled(every, lists.query(listed, every))

    def moved(
        self,
        sources: np.ndarray,
        targets: np.ndarray,
        sources_before: np.ndarray | None = None,
        targets_before: np.ndarray | None = None,
        tree: scipy.spatial.cKDTree | None = None,
    ) -> Lists:
        """The nearest sources at other places, of which there may be a tree.

        sources_before, targets_before : the number that each of them had, −1 for new ones; None: the same as now.
        """
        steps = _steps(self.sources, sources, sources_before)
        if sources_before is not None:
            moved, steps = steps, np.zeros(len(self.sources) + 1)
            steps[sources_before] = moved  # of new ones, which have no number, behind the others
            steps = steps[:-1]
        within = np.max(self.reach, where=np.isfinite(self.reach), initial=0.0) + steps.max(initial=0.0)
        reach = self.reach - largest_near(self.sources, steps, self.targets, float(within))
        if targets_before is not None:
            reach = np.where(targets_before < 0, -np.inf, reach[targets_before])
        reach -= _steps(self.targets, targets, targets_before)
        if sources_before is not None:
            new = sources[sources_before < 0]
            if len(new):
                near = _around(new, float(reach.max(initial=0.0)), targets)
                reach[near] = np.minimum(reach[near], scipy.spatial.cKDTree(new).query(targets[near])[0])
        rows, numbers = _as_they_are(len(targets), len(self.sources))
        if targets_before is not None:
            rows = targets_before
        if sources_before is not None:
            numbers = _numbers_now(sources_before, len(self.sources))
        index, (farthest, beyond) = ranked(sources, targets, self.index, rows, numbers, self.count)
        now = Lists(sources, targets, self.count, index, farthest, beyond, reach, tree)
        which = np.flatnonzero(~(beyond < reach))
        return now._filled(which, now.query(index.shape[1], which, quick=True)) if len(which) else now

    def _filled(self, which: np.ndarray, found: tuple[np.ndarray, np.ndarray]) -> Lists:
        """These lists, still in nobody's hands, with those `found` for the targets `which` written into them."""
        distance, index = found
        index[:, : self.count].sort(axis=1)
        self.index[which] = index
        self.farthest[which], self.beyond[which] = distance[:, self.count - 1], distance[:, self.count]
        self.reach[which] = distance[:, -1] if index.shape[1] < len(self.sources) else np.inf
        return self

    def nearest(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers (T, count) of the nearest sources, in order, the distance of the last and that of the next one."""
        index = self.index[:, : self.count]
        tied = np.flatnonzero(self.farthest >= (1.0 - TIE) * self.beyond)
        if len(tied):
            index = index.copy()
            index[tied] = np.sort(self.query(self.count + 1, tied)[1][:, : self.count], axis=1)
        return index, self.farthest, self.beyond

    def query(self, count: int, which: np.ndarray, quick: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Distances and numbers of the `count` nearest sources of the targets `which`, (W, count) each, by the tree.

        quick : by one of the sources around them, which may have equal distances in another order.
        """
        if quick and self.known_tree is None:
            targets, far = self.targets[which], FAR * float(self.farthest[which].max())
            some = _around(targets, far, self.sources)
            if len(some) >= count:
                tree = scipy.spatial.cKDTree(self.sources[some], FEW_LEAVES, compact_nodes=False, balanced_tree=False)
                distance, index = tree.query(targets, np.arange(1, count + 1))
                if distance.max() < far:
                    return distance, some[index]
        return by_tree(self.tree, self.targets)(count, which)

    @cached_property
    def tree(self) -> scipy.spatial.cKDTree:
        """The tree of the sources."""
        return scipy.spatial.cKDTree(self.sources) if self.known_tree is None else self.known_tree


def by_tree(
    tree: scipy.spatial.cKDTree, targets: np.ndarray
) -> Callable[[int, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """count, which -> distances and numbers of the `count` nearest sources of the targets `which`, (W, count) each."""
    return lambda count, which: tree.query(targets[which], np.arange(1, count + 1))


def _around(centres: np.ndarray, distance: float, places: np.ndarray) -> np.ndarray:
    """Numbers of the `places` (P, 2) in the rectangle that holds all points within a distance of the centres (C, 2)."""
    inside = (places >= centres.min(axis=0) - distance) & (places <= centres.max(axis=0) + distance)
    return np.flatnonzero(inside[:, 0] & inside[:, 1])


def _steps(before: np.ndarray, now: np.ndarray, numbers: np.ndarray | None) -> np.ndarray:
    """|δx| of the places `now` (P, 2), 0 for new ones."""
    if numbers is not None:
        return np.where(numbers < 0, 0.0, _steps(before.take(numbers, axis=0), now, None))
    dx, dy = now.T - before.T
    steps: np.ndarray = np.sqrt(dx * dx + dy * dy)
    return steps


def _as_they_are(targets: int, sources: int) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of targets and of sources that have kept them, and −1 for number −1."""
    return np.arange(targets), np.append(np.arange(sources), -1)


def _numbers_now(numbers_before: np.ndarray, count_before: int) -> np.ndarray:
    """The number now of each that there was before, −1 for those that are no more and, at the end, for number −1."""
    now = np.full(count_before + 1, -1)
    now[numbers_before] = np.arange(len(numbers_before))
    now[-1] = -1
    return now
