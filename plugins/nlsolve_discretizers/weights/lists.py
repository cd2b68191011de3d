"""|x_s − x_t| ≥ r − Σ (|δx_t| + max_s |δx_s|) : the nearest sources of each target, listed once and ranked anew.

A source that was farther than r from a target cannot have come nearer than that; lists with a few more sources than are
needed therefore hold the nearest ones until the motion has used up the rest (Verlet 1967). The maximum is over sources
near enough to come so near: what moves fast elsewhere does not matter.
"""

from __future__ import annotations

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


@dataclass(frozen=True)
class Lists:
    """The nearest sources of T targets.

    sources, targets : their places (S, 2) and (T, 2) [mm].
    index, distance : (T, K), nearest first; −1 for a source that is no more, at an infinite distance.
    reach : (T,) [mm], every source nearer than this is listed.
    count : how many of the nearest are sure to be listed, all sources at most.
    known_tree : the tree of the sources, where there is one already.
    """

    sources: np.ndarray
    targets: np.ndarray
    index: np.ndarray
    distance: np.ndarray
    reach: np.ndarray
    count: int
    known_tree: scipy.spatial.cKDTree | None = None

    @classmethod
    def of(
        cls,
        sources: np.ndarray,
        targets: np.ndarray,
        count: int,
        spare: int = 0,
        tree: scipy.spatial.cKDTree | None = None,
    ) -> Lists:
        """The `count` nearest sources, and some to spare."""
        every, listed = np.arange(len(targets)), min(count + spare, len(sources))
        index, distance = np.empty((len(targets), listed), np.intp), np.empty((len(targets), listed))
        lists = cls(sources, targets, index, distance, np.empty(len(targets)), min(count, len(sources)), tree)
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
        steps = np.zeros(len(self.sources))
        if sources_before is None:
            steps = _steps(self.sources, sources, None)
        else:
            old = np.flatnonzero(sources_before >= 0)
            steps[sources_before[old]] = np.linalg.norm(sources[old] - self.sources[sources_before[old]], axis=1)
        within = np.max(self.reach, where=np.isfinite(self.reach), initial=0.0) + steps.max(initial=0.0)
        reach = self.reach - largest_near(self.sources, steps, self.targets, float(within))
        if targets_before is not None:
            reach = np.where(targets_before < 0, -np.inf, reach[targets_before])
        reach -= _steps(self.targets, targets, targets_before)
        if sources_before is not None:
            new = sources[sources_before < 0]
            if len(new):
                reach = np.minimum(reach, scipy.spatial.cKDTree(new).query(targets)[0])
        rows, numbers = _as_they_are(len(targets), len(self.sources))
        if targets_before is not None:
            rows = targets_before
        if sources_before is not None:
            numbers = _numbers_now(sources_before, len(self.sources))
        index, distance = ranked(sources, targets, self.index, rows, numbers)
        now = Lists(sources, targets, index, distance, reach, self.count, tree)
        which = np.flatnonzero(~(distance[:, self.count - 1] < reach))
        return now._filled(which, now.query(index.shape[1], which, quick=True)) if len(which) else now

    def _filled(self, which: np.ndarray, found: tuple[np.ndarray, np.ndarray]) -> Lists:
        """These lists, still in nobody's hands, with those `found` for the targets `which` written into them."""
        self.distance[which], self.index[which] = found
        self.reach[which] = self.distance[which, -1] if self.index.shape[1] < len(self.sources) else np.inf
        return self

    def nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """Distances and numbers of the `count` nearest sources of all targets, (T, count) each."""
        distance, index = self.distance[:, : self.count], self.index[:, : self.count]
        tied = np.flatnonzero(distance[:, -2:-1].sum(axis=1) >= (1.0 - TIE) * distance[:, -1])
        if len(tied):
            distance, index = distance.copy(), index.copy()
            distance[tied], index[tied] = self.query(self.count, tied)
        return distance, index

    def query(self, count: int, which: np.ndarray, quick: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Distances and numbers of the `count` nearest sources of the targets `which`, (W, count) each, by the tree.

        quick : by one that is made in half the time, and may have equal distances in another order.
        """
        if quick and self.known_tree is None:
            tree = scipy.spatial.cKDTree(self.sources, compact_nodes=False, balanced_tree=False)
        else:
            tree = self.tree
        distance, index = tree.query(self.targets[which], np.arange(1, count + 1))
        return distance, index

    @cached_property
    def tree(self) -> scipy.spatial.cKDTree:
        """The tree of the sources."""
        return scipy.spatial.cKDTree(self.sources) if self.known_tree is None else self.known_tree


def _steps(before: np.ndarray, now: np.ndarray, numbers: np.ndarray | None) -> np.ndarray:
    """|δx| of the places `now` (P, 2), 0 for new ones."""
    if numbers is None:
        return np.linalg.norm(now - before, axis=1)
    return np.where(numbers < 0, 0.0, np.linalg.norm(now - before[numbers], axis=1))


def _as_they_are(targets: int, sources: int) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of targets and of sources that have kept them, and −1 for number −1."""
    return np.arange(targets), np.append(np.arange(sources), -1)


def _numbers_now(numbers_before: np.ndarray, count_before: int) -> np.ndarray:
    """The number now of each that there was before, −1 for those that are no more and, at the end, for number −1."""
    now = np.full(count_before + 1, -1)
    old = np.flatnonzero(numbers_before >= 0)
    now[numbers_before[old]] = old
    return now
