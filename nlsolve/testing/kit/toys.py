"""What flows are checked on: a power law, a disc of jittered nodes, and the flow of the one in the other."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from nlsolve.contracts.continuum.cloud import Cloud
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.law import ConstitutiveLaw, PowerForm
from nlsolve.flow.momentum import Flow
from nlsolve.registry.registry import registry_in_use
from nlsolve.series import Array

JITTER = 0.2
"""Largest shift of an inner node over the spacing."""


class ToyLaw(ConstitutiveLaw):
    """3 μ ε̄ = K ε̄ⁿ, without regularisation: the law that closed solutions are written for."""

    kind: Literal["power-law"] = "power-law"
    consistency: float = 100.0
    index: float = 0.5

    def viscosity(self, rate_squared: Any) -> Any:
        """μ = K/3 (ε̄²)^((n − 1)/2)."""
        return self.consistency / 3.0 * rate_squared ** (0.5 * (self.index - 1.0))

    def power_form(self) -> PowerForm:
        """K and n."""
        return PowerForm(self.consistency, self.index)


def toy_cloud(rings: int = 5) -> Cloud:
    """Nodes on rings in the unit disc, the inner ones shifted at random; one boundary group, "wall"."""
    radii = np.arange(rings + 1) / rings
    circles = [np.zeros(1), *(np.arange(round(2.0 * np.pi * k)) / round(2.0 * np.pi * k) for k in range(1, rings + 1))]
    turns = 2.0 * np.pi * np.concatenate(circles)
    radius = np.concatenate([np.full(len(circle), r) for circle, r in zip(circles, radii, strict=True)])
    nodes = radius[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    shift = np.random.default_rng(0).uniform(-JITTER, JITTER, nodes.shape) / rings
    return Cloud(nodes + shift * (radius < 1.0)[:, None], {"wall": np.flatnonzero(radius == 1.0)})


def toy_flow() -> tuple[Flow, Array]:
    """A flow of `ToyLaw` in `toy_cloud`, discretised as errors are estimated, and another state (U,)."""
    cloud, law = toy_cloud(), ToyLaw()
    discretizer = registry_in_use().component(Discretizer.noun, Discretizer.default_error_estimator)
    assert isinstance(discretizer, Discretizer)
    x, y = cloud.nodes.T
    velocity = np.stack([y**2 + 0.3 * x, np.sin(2.0 * x) - 0.3 * y], axis=1)
    flow = Flow(cloud, discretizer.operators(cloud, False), law, velocity[cloud.boundary], reference_rate=1.0)
    return flow, flow.unknowns(velocity)
