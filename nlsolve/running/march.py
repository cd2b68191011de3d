"""A flow in time from Python: its states, its fields, and its velocity at any points and times, without files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import ArrayLike

from nlsolve.contracts import notebook
from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.scene import Simulation
from nlsolve.contracts.status import InputError
from nlsolve.flow.march import FlowSimulation
from nlsolve.flow.momentum import Flow
from nlsolve.flow.motion.markers import LOST, within
from nlsolve.flow.observables import nodal_fields
from nlsolve.flow.state import FlowParts
from nlsolve.registry.plugin_files import Plugin
from nlsolve.registry.problems import StudyError
from nlsolve.running.runner import study_of
from nlsolve.series import Array
from nlsolve.solving.simulate import Progress, run_case
from nlsolve.study.study import Study


@dataclass(frozen=True, eq=False, repr=False)
class March:
    """The states of a flow at the ends of its increments, or the one state of a steady flow.

    outcome : how the march ended; the states before a failure are kept.
    row : its row of `runs`.
    steps : one row for each iteration or series.
    times : t = 0, the time of the first state or of rest, and the ends of the increments, shape (K,) [s].
    nodes, velocities : at these times, shape (K, N, 2) [mm], [mm/s].
    parts : the validated component of each section of the case.
    """

    outcome: Outcome
    row: Mapping[str, Any]
    steps: pd.DataFrame
    times: Array
    nodes: Array
    velocities: Array
    parts: FlowParts

    def __repr__(self) -> str:
        return "\n".join(f"{name:<10}  {text}" for name, text in self._told().items())

    def _repr_html_(self) -> str:
        """What a notebook shows: how the march ended, its times and its nodes."""
        return notebook.facts(self._told())

    def _told(self) -> dict[str, str]:
        reached = f"0 to {self.times[-1]:g} s, {len(self.times)} states" if len(self.times) else "none"
        nodes = str(self.nodes.shape[1]) if len(self.times) else "none"
        work = f"{self.row['tangents']} tangents, {self.row['factorizations']} factorizations"
        status = f"{self.outcome.status.word}: {self.outcome.message}"
        return {"status": status, "times": reached, "nodes": nodes, "work": work}

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """V at points (T, 2) [mm] and a time [s], shape (T, 2) [mm/s]; NaN outside the material.

        The discretizer interpolates in space; in time V is linear between the ends of the increments. Raises
        InputError for a time that was not reached and for points of another shape.
        """
        places = np.asarray(points, dtype=float)
        if places.ndim != 2 or places.shape[1] != 2:
            raise InputError(f"March.velocity: points of shape {places.shape}: should be of shape (T, 2)")
        after = int(np.searchsorted(self.times, self._reached("velocity", time)))
        before = max(0, after - 1)
        span = self.times[after] - self.times[before]
        part = (time - self.times[before]) / span if span else 1.0
        ends = [(before, 1.0 - part), (after, part)]
        return np.sum([weight * self._at(k, places) for k, weight in ends if weight], axis=0)

    def fields(self, time: float) -> pd.DataFrame:
        """One row for each node at the end of the increment nearest to `time` [s], with the columns of `fields`;
        without the pressure, which a march does not keep.

        Raises InputError for a time that was not reached.
        """
        parts, k = self.parts, int(np.abs(self.times - self._reached("fields", time)).argmin())
        initial = parts.discretizer.completed(parts.scene.cloud(parts.law))
        cloud, moment = initial.moved_to(self.nodes[k]), float(self.times[k])
        wall = parts.scene.boundary_velocity(cloud, parts.law, moment)
        discretizer = parts.discretizer.for_law(parts.law, parts.scene.reference_rate)
        flow = Flow(cloud, discretizer.operators(cloud, False), parts.law, wall)
        return nodal_fields(parts.scene, parts.discretizer, flow, self.velocities[k], initial, moment)

    def _reached(self, caller: str, time: float) -> float:
        if not len(self.times) or not self.times[0] <= time <= self.times[-1]:
            reached = f"t = 0 to {self.times[-1]:g} s were" if len(self.times) else "no state was"
            raise InputError(f"March.{caller}: time = {time:g}: {reached} solved; choose a time among them")
        return time

    def _at(self, k: int, places: Array) -> Array:
        """V(x, t_k) at `places` (T, 2) [mm], (T, 2) [mm/s]; NaN where a marker would count as lost."""
        nodes = self.nodes[k]
        tree = scipy.spatial.cKDTree(nodes)
        distance, nearest = tree.query(places)
        spacing = tree.query(nodes, 2)[0][:, 1]
        found: Array = self.parts.discretizer.values(nodes, within(nodes, places)) @ self.velocities[k]
        found[(distance > LOST * spacing[nearest]) | (places != within(nodes, places)).any(axis=1)] = np.nan
        return found


def march(
    study: Study | str | Path | Mapping[str, Any],
    *,
    overrides: Mapping[str, Any] | None = None,
    quick: bool = False,
    listen: Callable[[Progress], None] | None = None,
    plugins: Iterable[Plugin] = (),
) -> March:
    """March the flow of a study with one case; nothing is written.

    study : as for `run`; a dictionary needs no question, and its sections may be instances.
    listen : is called with a `Progress` after every increment.
    plugins : component classes, and paths of files with such, whose kinds the study may name.

    Raises StudyError for a study that is not valid or has several cases, InputError for a scene that is no flow.
    """
    if isinstance(study, Mapping):
        study = {"question": "What does the flow look like?", **study}
    chosen = study_of(study, overrides, quick, plugins)
    if len(chosen.cases) != 1:
        raise StudyError(
            f"{chosen.name}: a march is of one case, and the study has {len(chosen.cases)}: drop its sweeps"
        )
    parts = chosen.cases[0].parts
    states: dict[float, tuple[Array, Array]] = {}

    def watch(simulation: Simulation) -> None:
        if not isinstance(simulation, FlowSimulation):
            raise InputError(f"nlsolve.march: the scene {parts.scene.kind_name()!r} is no flow: use nlsolve.run")
        if simulation.rest is not None:
            states.setdefault(0.0, (simulation.initial.nodes, simulation.rest))
        states[simulation.state.time] = simulation.state.cloud.nodes, simulation.state.velocity

    record = run_case(parts, listen, watch=watch)
    nodes, velocities = (np.array([pair[i] for pair in states.values()]) for i in (0, 1))
    return March(record.outcome, record.summary, record.steps, np.array(list(states)), nodes, velocities, parts)
