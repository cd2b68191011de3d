"""Orders of convergence of the steady spin, every law, the bearing, and the orbit against independent finite elements.

    python benchmarks/accuracy.py

Prints, one after the other: observed orders between clouds whose spacings are all scaled by s; how many nodes small
errors of the spin need at small n; the errors of every law where there is an exact solution; the errors of torque and
force of the journal bearing; and for the orbit the largest difference from the reference (tests/reference) off the
walls, in parts of the tool speed, and the difference in drag.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import nlsolve

REFERENCE = Path(__file__).parent.parent / "tests" / "reference"
DRAG = {1.0: -205426.58, 0.3: -12224.03}  # of the reference, by n [N/mm]
TOOL_SPEED = 150.0  # mm/s


def steady(
    scene: dict[str, Any],
    index: float = 1.0,
    discretizer: dict[str, Any] | None = None,
    law: dict[str, Any] | None = None,
    **sections: Any,
) -> nlsolve.Results:
    """The results of one steady state by Newton's method."""
    return nlsolve.run(
        {
            "question": "how accurate is this steady state?",
            "scene": {"kind": "stirring-tool", **scene},
            "law": {"kind": "power-law", "index": index, "regularization": 1e-3} if law is None else law,
            "discretizer": discretizer or {"kind": "mls"},
            "solver": {"kind": "newton"},
            **sections,
        }
    )


def orders() -> None:
    """Print orders for graded rings with h(r) = s min(0.1 + 0.12 (r − r_t), 0.25) mm, in the mean spacing N^(−1/2)."""
    for index in (1.0, 0.3):
        print(f"\nsteady spin, n = {index}:       s    nodes   velocity error   order")
        before: tuple[int, float] | None = None
        for s in (1.4, 1.0, 0.7, 0.5):
            nodes = {"kind": "graded-rings", "first": 0.1 * s, "growth": 0.12 * s, "spacing": 0.25 * s}
            run = steady({"nodes": nodes}, index).runs.iloc[0]
            count, error = int(run["nodes"]), float(run["velocity_error"])
            order = "" if before is None else f"{2 * np.log(before[1] / error) / np.log(count / before[0]):.2f}"
            print(f"                           {s:4.1f} {count:8d} {100 * error:15.4f}%  {order:>6s}")
            before = (count, error)


RESOLUTION = {("delaunay", 0.1324): 0.6, ("delaunay", 0.05): 1.0, ("mls", 0.1324): 0.45, ("mls", 0.05): 1.0}
"""Nodes graded to the layer of the flow that reach 0.1 % at n = 0.1324 and 0.5 % at n = 0.05."""


def spin(kind: str, index: float) -> pd.Series:
    """The run of a steady spin on nodes graded to its layer."""
    nodes = {"kind": "auto", "resolution": RESOLUTION[kind, index], "growth": 0.2}
    start = {"values": [1.0, 0.5, 0.3, 0.2, 0.13, 0.08]}
    return steady({"nodes": nodes}, index, {"kind": kind}, start=start).runs.iloc[0]


def spins() -> None:
    """Print how many nodes small errors of the steady spin need."""
    print("\nsteady spin:     n   nodes   smallest spacing   velocity error   inside     torque error   seconds")
    for kind, index in RESOLUTION:
        run = spin(kind, index)
        errors = (f"{100 * run[name]:.3f} %" for name in ("velocity_error", "velocity_error_inside", "torque_error"))
        print(
            f"  {kind:10s}{index:8g}{run['nodes']:8d}{run['smallest_spacing']:15.4f} mm"
            + "".join(f"{error:>14s}" for error in errors)
            + f"{run['seconds_all']:10.1f}"
        )


LAWS = ("power-law", "norton-hoff", "carreau-yasuda", "cross", "herschel-bulkley", "bingham", "sellars-tegart")
GRADED = {"delaunay": {"resolution": 0.7}, "mls": {"resolution": 0.5, "growth": 0.1}}
"""Nodes graded to the layer of the flow with which velocity and torque of every law are within 0.5 %."""


def couette(kind: str, law: str) -> pd.Series:
    """The run of the steady spin of a law, with its defaults, on nodes graded to its layer."""
    scene = {"kind": "couette", "nodes": {"kind": "auto", **GRADED[kind]}}
    by = {"by": "regularization", "values": [1e3, 1e2, 10.0, 1.0]} if law in ("bingham", "sellars-tegart") else {}
    return steady(scene, discretizer={"kind": kind}, law={"kind": law}, start=by).runs.iloc[0]


def channel(kind: str, index: float, jitter: float) -> pd.Series:
    """The run of the flow between plates, nodes 0.05 mm apart."""
    scene = {"kind": "channel", "spacing": 0.05, "jitter": jitter}
    return steady(scene, index, {"kind": kind}).runs.iloc[0]


def laws() -> None:
    """Print the errors of every law in the spin, and of the power law in the channel."""
    print("\nspin of every law:            nodes   smallest spacing   velocity error   torque error")
    for kind in GRADED:
        for law in LAWS:
            run = couette(kind, law)
            print(
                f"  {kind:10s}{law:17s}{run['nodes']:7d}{run['smallest_spacing']:15.4f} mm"
                f"{100 * run['velocity_error']:14.3f} %{100 * run['torque_error']:13.3f} %"
            )
    print("\nchannel:        n   jitter   nodes   velocity error")
    for kind in GRADED:
        for index in (1.0, 0.5, 0.3, 0.1324):
            for jitter in (0.0, 0.2):
                run = channel(kind, index, jitter)
                print(f"  {kind:8s}{index:8g}{jitter:8.1f}{run['nodes']:9d}{100 * run['velocity_error']:14.4f} %")


BEARING: dict[str, dict[str, Any]] = {
    "delaunay": {"kind": "delaunay"},
    "mls": {"kind": "mls"},
    "mls, conservative": {"kind": "mls", "form": "conservative"},
}
FEW = {"delaunay": 0.047, "mls": 0.07, "mls, conservative": 0.085}
"""Spacings [mm] with which torque and force of the bearing are within 0.2 %."""


def bearing(name: str, spacing: float) -> pd.Series:
    """The run of the journal bearing, incompressible by an iterated pressure."""
    scene = {"kind": "eccentric-cylinders", "spacing": spacing}
    physics = {"penalty": 1e3, "divergence_tolerance": 1e-8}
    return steady(scene, 1.0, BEARING[name], physics=physics, stop={"tolerance": 1e-10}).runs.iloc[0]


def bearings() -> None:
    """Print the errors of velocity, torque and force of the bearing."""
    print("\nbearing:           spacing   nodes   velocity error   torque error   force error   pressures   seconds")
    for name in BEARING:
        for spacing in (0.2, 0.1, FEW[name]):
            run = bearing(name, spacing)
            errors = (f"{100 * run[column]:.3f} %" for column in ("velocity_error", "torque_error", "force_error"))
            print(
                f"  {name:18s}{spacing:6g}{run['nodes']:8d}"
                + "".join(f"{error:>15s}" for error in errors)
                + f"{run['pressure_iterations']:10.0f}{run['seconds_all']:11.1f}"
            )


RINGS = {"resolution": 0.45, "layers": 5.0, "growth": 0.15, "smallest": 0.008, "middle": 0.18, "spacing": 0.18}
"""Auto nodes of the orbit, whatever their defaults."""


@dataclass(frozen=True)
class Comparison:
    """Differences of velocity off the walls, in parts of the tool speed, and the drag [N/mm]."""

    nodes: int
    velocity: np.ndarray
    drag: float


def orbit_against_reference(index: float) -> Comparison:
    """The steady orbit with λ/μ(100 1/s) = 1e4 on rings graded to the layer at the tool."""
    nodes = {"kind": "auto", **RINGS}
    scene, start = {"motion": "orbit", "nodes": nodes}, {"values": [1.0, 0.7, 0.5, 0.4]}
    results = steady(scene, index, physics={"penalty": 1e4}, start=start)
    run, fields = results.runs.iloc[0], results.fields
    reference = pd.read_csv(REFERENCE / f"orbit_n{index:.1f}.csv")
    radius = np.hypot(reference["x"], reference["y"])
    reference = reference[(radius > 1.501) & (radius < 5.999)]
    discretizer = results.study.cases[0].parts.discretizer
    values = discretizer.values(fields[["x", "y"]].to_numpy(), reference[["x", "y"]].to_numpy())
    difference = values @ fields[["u", "v"]].to_numpy() - reference[["u", "v"]].to_numpy()
    return Comparison(int(run["nodes"]), np.linalg.norm(difference, axis=1) / TOOL_SPEED, float(run["force_x"]))


def orbit() -> None:
    """Print the comparison of the orbit with the reference at both n."""
    for index, drag in DRAG.items():
        ours = orbit_against_reference(index)
        print(
            f"\norbit, n = {index}: {ours.nodes} nodes; velocity within {100 * ours.velocity.max():.2f} % of the tool "
            f"speed (median {100 * np.median(ours.velocity):.2f} %), "
            f"drag {ours.drag:.1f} N/mm, {100 * (ours.drag / drag - 1):+.2f} %"
        )


if __name__ == "__main__":
    orders()
    spins()
    laws()
    bearings()
    orbit()
