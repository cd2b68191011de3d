"""Operators, viscosities and boundary velocities of other shapes or types are told with the plugin's name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from nlsolve_discretizers import LinearTriangles
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Couette

import nlsolve
from nlsolve.plugin import Operators

SCENE = {"kind": "couette", "nodes": {"kind": "rings", "spacing": 0.75}}


class Triangles(LinearTriangles):
    kind: Literal["odd-triangles"] = "odd-triangles"  # type: ignore[assignment]
    gives: str = ""

    def operators(self, cloud: Any, volumetric: bool) -> Any:
        found = super().operators(cloud, volumetric)
        strain = found.strain
        changed = {
            "points": replace(strain, points=strain.points[:, :1]),
            "rate": replace(strain, rate=strain.rate[1:]),
            "force": replace(strain, force=strain.force[:-2]),
            "areas": replace(strain, areas=strain.areas[:-1]),
            "complex": replace(strain, rate=strain.rate.astype(complex)),
        }
        if self.gives == "pair":
            return strain.rate, strain.force
        if self.gives == "node_areas":
            return replace(found, node_areas=found.node_areas[1:])
        return Operators(changed.get(self.gives, strain), found.volumetric, found.node_areas)


class Law(PowerLaw):
    kind: Literal["odd-law"] = "odd-law"  # type: ignore[assignment]
    gives: str = ""

    def viscosity(self, rate_squared: Any) -> Any:
        found = super().viscosity(rate_squared)
        if isinstance(rate_squared, np.ndarray) and self.gives:
            return {"number": 1.0, "complex": found + 0.0j, "column": np.reshape(found, (-1, 1))}[self.gives]
        return found


class Walls(Couette):
    kind: Literal["odd-walls"] = "odd-walls"  # type: ignore[assignment]
    gives: str = ""

    def boundary_velocity(self, cloud: Any, law: Any, time: float) -> Any:
        found = super().boundary_velocity(cloud, law, time)
        return {"flat": found.ravel(), "complex": found + 0.0j}.get(self.gives, found)


def ended(**sections: Any) -> tuple[str, str]:
    study = {
        "question": "Is it told?",
        "scene": SCENE,
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "delaunay"},
        "solver": {"kind": "newton"},
        "start": {"values": [1.0]},
        **sections,
    }
    row = nlsolve.run(study, isolation="none").runs.iloc[0]
    return row["status"], row["message"]


@pytest.mark.parametrize(
    ("gives", "sentence"),
    [
        ("pair", "the discretizer 'odd-triangles' gave a tuple, not Operators"),
        ("points", "the discretizer 'odd-triangles' gave strain points of shape ("),
        ("rate", "the discretizer 'odd-triangles' gave a strain rate B of shape ("),
        ("force", "the discretizer 'odd-triangles' gave a strain force S of shape ("),
        ("areas", "the discretizer 'odd-triangles' gave strain areas of shape ("),
        ("node_areas", "the discretizer 'odd-triangles' gave node_areas of shape ("),
        ("complex", "gave a strain rate B of complex128 numbers, which should be real"),
    ],
)
def test_operators(gives: str, sentence: str) -> None:
    status, message = ended(discretizer=Triangles(gives=gives))
    assert status == "crashed"
    assert sentence in message


@pytest.mark.parametrize(
    ("gives", "sentence"),
    [
        ("number", "the law 'odd-law' gave for two rates a viscosity of shape None, not (2,)"),
        ("column", "the law 'odd-law' gave for two rates a viscosity of shape (2, 1), not (2,)"),
        ("complex", "the law 'odd-law' gave for two rates a viscosity of complex128 numbers, which should be real"),
    ],
)
def test_viscosities(gives: str, sentence: str) -> None:
    status, message = ended(law=Law(index=0.5, gives=gives))
    assert status == "crashed"
    assert sentence in message


@pytest.mark.parametrize(
    ("gives", "sentence"),
    [
        ("flat", "the scene 'odd-walls' gave a boundary velocity of shape ("),
        ("complex", "the scene 'odd-walls' gave a boundary velocity of complex128 numbers, which should be real"),
    ],
)
def test_boundary_velocities(gives: str, sentence: str) -> None:
    status, message = ended(scene=Walls(nodes=SCENE["nodes"], gives=gives))
    assert status == "crashed"
    assert sentence in message


def test_what_keeps_its_contract_is_solved() -> None:
    assert ended(discretizer=Triangles(), law=Law(index=0.5), scene=Walls(nodes=SCENE["nodes"]))[0] == "converged"
