"""Solve, estimate, make a cloud for the error asked for, solve again: the rounds of adaptive nodes.

    N′ = N · (estimate/(AIM · error))^(2/k),   at most FASTEST N and at least SLOWEST N

An error of order k in h goes like N^(−k/2) once the spacing has the shape of the solution. What the first clouds miss
shows on the next, so that N grows by no more than FASTEST at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nlsolve.contracts.continuum.adaptive import AdaptiveNodes
from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.status import SolveError, Status
from nlsolve.flow.accuracy.estimate import Comparison
from nlsolve.flow.accuracy.spacing import wanted_spacing
from nlsolve.series import Array

AIM = 0.8
"""The part of the error asked for that a new cloud is made for."""

SLOWEST, FASTEST = 1.25, 3.0

WORTH = 1.1
"""A new cloud has more nodes than the last by this factor, or is not made."""

FEWEST = 10
"""Nodes with which no largest spacing can be kept: a cloud for fewer is not tried."""


@dataclass
class Adaptation:
    """The rounds so far.

    rounds : clouds made from a solution.
    factorizations : matrices factorised for the estimates.
    found : the last estimate; None before the first.
    added : nodes of the last cloud over those that the scene gave it.
    """

    asked: AdaptiveNodes
    rounds: int = 0
    factorizations: int = 0
    found: Comparison | None = field(default=None)
    added: float = 1.0

    def judge(self, found: Comparison) -> None:
        """Take in the estimate for the present cloud. Raises SolveError (not applicable) where there is none."""
        self.factorizations += found.factorizations
        self.found = found
        if np.isnan(found.larger):
            raise SolveError(
                Status.NOT_APPLICABLE,
                "adaptive nodes need an estimate of the error, and this case has none: give an error_estimator, such "
                "as delaunay",
            )

    @property
    def reached(self) -> bool:
        """Whether the last estimate is within the error asked for."""
        return self.found is not None and self.found.larger <= self.asked.error

    def next_count(self, nodes: int, order: float) -> int | None:
        """N′ for a cloud of N `nodes` and an error of this order; None where the limits allow no larger cloud."""
        assert self.found is not None
        wanted = (self.found.larger / (AIM * self.asked.error)) ** (2.0 / order)
        growth = float(np.clip(wanted, SLOWEST, FASTEST))
        count = min(round(growth * nodes), self.asked.most_nodes)
        return count if self.rounds < self.asked.most_rounds and count > WORTH * nodes else None

    def cloud(self, scene: Geometry, discretizer: Discretizer, here: Cloud, velocity: Array, count: int) -> Cloud:
        """The next cloud, of about `count` nodes with those that the discretizer adds, for the `velocity` (N, 2)
        `here`. May raise SolveError.
        """
        most = self.asked.most_nodes
        while True:
            wanted = max(round(count / self.added), FEWEST)
            made = scene.graded(wanted_spacing(here, velocity, wanted, self.asked.spacing), self.asked)
            completed = discretizer.completed(made)
            self.added = len(completed.nodes) / len(made.nodes)
            if len(completed.nodes) <= most or wanted <= FEWEST:
                return completed
            count = int(count * most / len(completed.nodes) / WORTH)

    def shortfall(self, nodes: int) -> str:
        """Why the error asked for is not reached, and the way out."""
        assert self.found is not None
        found, asked = self.found, self.asked
        spent = self.rounds >= asked.most_rounds
        limit = f"nodes.most_rounds = {asked.most_rounds}" if spent else f"nodes.most_nodes = {asked.most_nodes}"
        return (
            f"with {nodes} nodes the error of the velocity is estimated as {found.relative:.2g} inside and "
            f"{found.worst:.2g} at the worst node; nodes.error = {asked.error:g} was asked for, and {limit} allows no "
            "better cloud: allow more, or ask for less"
        )
