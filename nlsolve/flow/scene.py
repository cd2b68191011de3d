"""Scenes that are flows: geometry and boundary, and the sections of a study that a flow needs."""

from __future__ import annotations

from abc import ABC
from collections.abc import Collection, Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import ValidationError, model_validator

from nlsolve.contracts.continuum.adaptive import AdaptiveNodes
from nlsolve.contracts.continuum.discretizer import Discretizer
from nlsolve.contracts.continuum.geometry import Geometry
from nlsolve.contracts.continuum.law import ConstitutiveLaw
from nlsolve.contracts.continuum.terms import NodeMotion, Physics, Recording, TimeSteps
from nlsolve.contracts.rules.predictor import Predictor
from nlsolve.contracts.scene import Entry, Misfit, Scene, Section
from nlsolve.flow.continuation import LOAD, REST, Start
from nlsolve.flow.march import FlowSimulation
from nlsolve.flow.state import FlowParts

WAY = ("scene", "law", "physics", "motion", "discretizer", "linear", "start")
"""The sections on which the way to a first state depends."""


class FlowScene(Geometry, Scene, ABC):
    """A flow of one material: one steady R(v) = 0, or implicit Euler from a first state at t = 0 to a horizon."""

    sections: ClassVar[Mapping[str, Section]] = {
        "law": Section(ConstitutiveLaw),
        "physics": Section(Physics),
        "time": Section(TimeSteps),
        "motion": Section(NodeMotion),
        "discretizer": Section(Discretizer),
        "error_estimator": Section(Discretizer, of="discretizer"),
        "start": Section(Start),
        "predictor": Section(Predictor),
        "record": Section(Recording),
    }

    @model_validator(mode="before")
    @classmethod
    def _adaptive_where_nodes_can_be(cls, given: Any) -> Any:
        asked = given.get("nodes") if isinstance(given, Mapping) else None
        kind = asked.get("kind") if isinstance(asked, Mapping) else getattr(asked, "kind", asked)
        if kind == AdaptiveNodes.model_fields["kind"].default and cls.graded is Geometry.graded:
            raise ValueError(f"nodes: the scene {cls.kind_name()} has no adaptive clouds: choose its spacing")
        return given

    def simulation(self, parts: FlowParts, entry: Entry) -> FlowSimulation:
        """The flow of a case; `entry` times the building of its operators."""
        return FlowSimulation(parts, entry)

    def way(self, parts: FlowParts) -> Collection[str]:
        """All sections but those of the method, of increments, and of what is recorded."""
        if self.adaptive is not None:
            return (*WAY, "error_estimator")
        leads = parts.start.at != REST and (parts.time.increments or (parts.start.path and parts.start.stored is None))
        return WAY if leads else ()

    def check(self, parts: Any) -> None:
        """Raises Misfit when nodes move that must stay, when moving nodes are combined with convection, or when the law
        refuses the start: its continuation to the first state, or rest.
        """
        if parts.motion.moving and self.keeps_nodes:
            raise Misfit("motion", "nodes", f'{self.keeps_nodes}; use nodes = "fixed"')
        if parts.motion.moving and parts.physics.convection:
            raise Misfit(
                "physics",
                "convection",
                'nodes that move with the material carry it already; use motion.nodes = "fixed"',
            )
        if self.adaptive is not None and parts.time.increments:
            raise Misfit(
                "time", "horizon", "adaptive nodes follow one steady state: leave it out, or choose other nodes"
            )
        if parts.start.at == REST:
            self._check_rest(parts)
        try:
            parts.start.stages(parts.law)
        except ValidationError as error:
            reasons = "; ".join(detail["msg"] for detail in error.errors())
            raise Misfit("start", "values", f"refused by the law: {reasons}") from error
        except ValueError as error:
            raise Misfit(
                "start", "values" if parts.start.by == LOAD else "by", str(error).partition(": ")[2]
            ) from error

    def _check_rest(self, parts: Any) -> None:
        if not parts.time.increments:
            raise Misfit("start", "at", "a steady scene has no increment to begin: set time.horizon, or values = []")
        with np.errstate(all="ignore"):
            viscosity = parts.law.viscosity(np.zeros(1))
        if not np.isfinite(viscosity).all():
            raise Misfit(
                "start",
                "at",
                "the law has no finite viscosity at ε̄ = 0, where the march would begin: "
                'choose law.regularization > 0, or at = "state"',
            )
