"""How far is the estimated error from the true one? Over scenes, laws, clouds and discretizers whose error is known.

    python benchmarks/error_estimates.py [CASES] [triangles]

True errors are those of exact solutions, and for the orbit those of independent finite elements (`tests/reference`), at
their points away from the walls. All cases are put in an order drawn at random, of which the first CASES (default: all)
are run: whatever is chosen is chosen on the even ones, and the odd ones are looked at afterwards. With `triangles` the
same scenes are solved by triangles of degree 2 alone, which estimate their errors themselves. Prints rows by scene,
discretizer and half: the number of cases, the share with an error between half and twice the estimate, the least, the
median and the largest error over its estimate, and how many wrong results (error above 5 %) nothing puts in doubt, and
right ones (below 2 %) something does.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from nlsolve.contracts.scene import Simulation
from nlsolve.solving.simulate import run_case
from nlsolve.study.study import Study

REFERENCE = Path(__file__).parent.parent / "tests" / "reference"
HALVES = ("even", "odd")
SEED = 26112026
WRONG, RIGHT = 0.05, 0.02

DISCRETIZERS: dict[str, dict[str, Any]] = {
    "mls": {"kind": "mls"},
    "mls, conservative": {"kind": "mls", "form": "conservative"},
    "rbf": {"kind": "rbf", "form": "strong"},
    "delaunay": {"kind": "delaunay"},
}
TRIANGLES: dict[str, dict[str, Any]] = {"triangles": {"kind": "triangles"}}
RINGS = [
    {"kind": "rings", "spacing": 0.25},
    {"kind": "rings", "spacing": 0.25, "jitter": 0.2},
    {"kind": "graded-rings", "first": 0.05, "growth": 0.12, "spacing": 0.3},
    {"kind": "scattered", "first": 0.1, "spacing": 0.3},
    {
        "kind": "auto",
        "resolution": 0.75,
        "layers": 5.0,
        "growth": 0.15,
        "smallest": 0.008,
        "middle": 0.25,
        "spacing": 0.25,
    },
]
LAWS: list[dict[str, Any]] = [
    {"kind": "norton-hoff"},
    {"kind": "carreau-yasuda"},
    {"kind": "cross"},
    {"kind": "herschel-bulkley"},
    {"kind": "bingham"},
    {"kind": "sellars-tegart"},
]


def power_law(index: float) -> dict[str, Any]:
    return {"kind": "power-law", "index": index, "regularization": 1e-3}


def flows() -> Iterator[tuple[str, dict[str, Any]]]:
    """The scenes, each with its law, its physics and its nodes."""
    for n, nodes in itertools.product([1.0, 0.5, 0.3, 0.1324, 0.05], RINGS):
        yield "spin", {"scene": {"kind": "stirring-tool", "nodes": nodes}, "law": power_law(n)}
    for n, nodes, penalty in itertools.product([1.0, 0.3, 0.2, 0.1], [RINGS[0], *RINGS[3:]], [1e4, 1e2]):
        scene = {"kind": "stirring-tool", "motion": "orbit", "nodes": nodes}
        yield "orbit", {"scene": scene, "law": power_law(n), "physics": {"penalty": penalty}}
    for law, nodes in itertools.product(LAWS, [RINGS[0], RINGS[3]]):
        start = {"by": "load", "values": [1e-3, 1e-2], "adaptive": True}
        yield "couette", {"scene": {"kind": "couette", "nodes": nodes}, "law": law, "start": start}
    for n, nodes in itertools.product([1.0, 0.5, 0.2], ["grid", "scattered"]):
        yield "channel", {"scene": {"kind": "channel", "nodes": nodes}, "law": power_law(n)}
    for spacing, penalty in itertools.product([0.3, 0.2], [1e4, 1e2]):
        scene = {"kind": "eccentric-cylinders", "spacing": spacing}
        yield "bearing", {"scene": scene, "law": power_law(1.0), "physics": {"penalty": penalty}}
    for n, nodes, jitter in itertools.product([1.0, 0.5, 0.3], ["grid", "scattered"], [0.0, 0.2]):
        scene = {"kind": "manufactured", "nodes": nodes, "jitter": jitter}
        yield "manufactured", {"scene": scene, "law": power_law(n)}


def cases(discretizers: dict[str, dict[str, Any]]) -> list[tuple[str, str, dict[str, Any]]]:
    """Scene, discretizer and document of each case, in an order drawn at random."""
    every = [
        (scene, name, {**flow, "discretizer": discretizer})
        for (scene, flow), (name, discretizer) in itertools.product(flows(), discretizers.items())
    ]
    return [every[number] for number in np.random.default_rng(SEED).permutation(len(every))]


def orbit_error(simulation: Any, index: float) -> float:
    """‖V − V*‖₂/‖V*‖₂ at the reference's lattice away from the walls."""
    known = pd.read_csv(REFERENCE / f"orbit_n{index}.csv").query("where == 'lattice'")
    places, velocity = known[["x", "y"]].to_numpy(), known[["u", "v"]].to_numpy()
    inside = np.abs(np.hypot(*places.T) - 3.75) < 2.24
    state = simulation.state
    found = state.parts.discretizer.values(state.cloud.nodes, places[inside]) @ state.velocity
    return float(np.linalg.norm(found - velocity[inside]) / np.linalg.norm(velocity[inside]))


def measured(scene: str, document: dict[str, Any]) -> dict[str, Any]:
    """Status, error, estimate and doubt of one case."""
    usual = {"question": "?", "solver": {"kind": "newton"}, "start": {"adaptive": True}, "budget": {"iterations": 60}}
    seen: list[Simulation] = []
    row = run_case(Study.from_dict(usual | document).cases[0].parts, watch=seen.append).summary
    error = row.get("velocity_error_inside", np.nan)
    if scene == "orbit" and row["status"] == "converged":
        error = orbit_error(seen[-1], document["law"]["index"])
    told = {name: row.get(name) for name in ("status", "message", "nodes", "doubt")}
    return {**told, "error": error, "estimate": row.get("velocity_error_estimate", np.nan)}


def summed_up(rows: pd.DataFrame) -> pd.Series:
    """One row of the table."""
    quotient = (rows["error"] / rows["estimate"]).dropna().sort_values()
    doubted = rows["doubt"].fillna("") != ""
    return pd.Series(
        {
            "cases": len(rows),
            "solved": int((rows["status"] == "converged").sum()),
            "estimated": len(quotient),
            "within 2": f"{((quotient >= 0.5) & (quotient <= 2.0)).mean():.0%}" if len(quotient) else "",
            "least": quotient.min(),
            "median": quotient.median(),
            "largest": quotient.max(),
            "wrong, no doubt": int(((rows["error"] > WRONG) & ~doubted).sum()),
            "right, in doubt": int(((rows["error"] < RIGHT) & doubted).sum()),
        }
    )


def main() -> None:
    rows = []
    asked = next((int(word) for word in sys.argv[1:] if word.isdigit()), None)
    discretizers = TRIANGLES if "triangles" in sys.argv else DISCRETIZERS
    for number, (scene, name, document) in enumerate(cases(discretizers)[:asked]):
        with threadpool_limits(limits=1):
            row = {"half": HALVES[number % 2], "scene": scene, "discretizer": name, **measured(scene, document)}
        rows.append(row)
        told = [*row.values(), document["scene"], document["law"], document.get("physics")]
        print(*(f"{value:.3g}" if isinstance(value, float) else value for value in told), sep=" | ", file=sys.stderr)
    frame = pd.DataFrame(rows)
    frame = frame[frame["status"] == "converged"]
    for names in (["scene"], ["discretizer"], ["half"]):
        print(frame.groupby(names).apply(summed_up, include_groups=False).to_string(float_format="%.2f"), "\n")


if __name__ == "__main__":
    main()
