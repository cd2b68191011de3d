"""About a quarter of the nodes of a cloud, no two of them neighbours."""

from __future__ import annotations

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.series import Mask

SEED = 0


def thinned(cloud: Cloud) -> Cloud:
    """The cloud of nodes that no edge of the triangulation joins, while every other node is joined to one of them; on
    walls first, so that these keep their shape. May raise SolveError (bad cloud).
    """
    keep = _independent(cloud)
    number = np.cumsum(keep) - 1
    groups = {name: number[group[keep[group]]] for name, group in cloud.boundaries.items()}
    return Cloud(cloud.nodes[keep], groups)


def _independent(cloud: Cloud) -> Mask:
    """Which nodes are kept, (N,): in rounds, those whose number drawn is larger than all of their neighbours' that are
    still undecided (Luby 1986).
    """
    size = len(cloud.nodes)
    drawn = np.random.default_rng(SEED).permutation(size) + size * cloud.on_boundary
    one, other = cloud.edges.T
    keep, undecided = np.zeros(size, dtype=bool), np.ones(size, dtype=bool)
    while undecided.any():
        largest = np.full(size, -1)
        np.maximum.at(largest, one, drawn[other])
        np.maximum.at(largest, other, drawn[one])
        chosen = undecided & (drawn > largest)
        keep |= chosen
        beside = np.zeros(size, dtype=bool)
        beside[one[chosen[other]]] = beside[other[chosen[one]]] = True
        undecided &= ~(chosen | beside)
        left = undecided[one] & undecided[other]
        one, other = one[left], other[left]
    return keep
