"""What does a velocity within 1 %, 0.1 % and 0.01 % cost, and what by finite elements? The steady spin and the orbit.

    python benchmarks/equal_error.py [rounds] [largest seconds] [rest]

Each method is run on its own clouds, graded to the layer at the tool and refined by a factor s. Ours: `triangles` (of
degree 2) and `delaunay` by Newton's method, and `mls` by newton-krylov preconditioned with triangles, each without and
with its audits, the estimate of the error among them. Theirs: Taylor-Hood elements (`taylor_hood.py`). All begin at
n = 1 and pass the same indices to the one asked for; with `rest` all begin with that one and V = 0 inside. All end at a
relative residual of 1e-8, take full steps that are halved until the residual falls, and factorise with PARDISO where it
is installed.

Seconds are of the processor, from the nodes on to the velocities, operators and assembly included, of audited runs to
the end; of each run the median of the rounds (default: 3), in which all take turns; what takes longer than 2 s is run
once. A method's clouds end before a run that would take longer than `largest seconds` (default: 60). The error of the
spin is ‖v − v_exact‖₂/‖v_exact‖₂ over the nodes inside. That of the orbit, with λ/μ = 1e5, is the same over points off
the walls where independent finite elements give v (tests/reference), to which v is taken from the nodes by the
quadratic fit of `mls`. Prints every run, then seconds at the errors asked for, interpolated between clouds in the
logarithms, and their ratios to those of finite elements.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from nlsolve_discretizers import MovingLeastSquares
from nlsolve_linear.pardiso import Pardiso
from nlsolve_linear.superlu import SuperLU
from taylor_hood import TaylorHood
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.continuation import VALUES
from nlsolve.solving.simulate import run_case

LONG, GROWTH = 2.0, 3.0  # seconds of a run that is not repeated, and of a finer cloud over those of one before
TOLERANCE = 1e-8
SCENES = {("spin", 0.3): (1e-2, 1e-3, 1e-4), ("spin", 0.1324): (1e-2, 1e-3, 1e-4), ("orbit", 0.3): (1e-2, 3e-3)}
"""Motion and n, and the errors asked for."""

REFERENCE = Path(__file__).parent.parent / "tests" / "reference"
FIT = MovingLeastSquares(degree=2, support=12)
SADDLE = SuperLU() if Pardiso.absent else Pardiso(symmetric="never")
GRADINGS = {
    "finite elements": {"resolution": 1.0, "layers": 1.0, "growth": 0.5},
    "triangles": {"resolution": 1.0, "layers": 1.0, "growth": 0.5},
    "delaunay": {"resolution": 1.0, "layers": 5.0, "growth": 0.4},
    "mls": {"resolution": 1.0, "layers": 5.0, "growth": 0.4},
}
"""At s = 1, the best of those tried for the spin at n = 0.1324: 9 for finite elements, 3 for `triangles`, 16 for
`delaunay`, 4 for `mls`.
"""
REFINEMENTS = {
    "finite elements": (2.0, 1.0, 0.5, 0.3),
    "triangles": (2.8, 2.0, 1.0, 0.5, 0.3),
    "delaunay": (2.0, 1.2, 0.6, 0.35, 0.2),
    "mls": (1.4, 0.8, 0.4, 0.25),
}
SOLVERS: dict[str, dict[str, Any]] = {
    "finite elements": {"kind": "newton"},
    "triangles": {"kind": "newton"},
    "delaunay": {"kind": "newton"},
    "mls": {"kind": "newton-krylov", "preconditioner": "triangles"},
}
Cost = tuple[int, float, float]
"""Velocities, relative error and seconds of one run."""


def parts(method: str, motion: str, index: float, s: float, rest: bool) -> Any:
    """The components of the steady flow on the method's own grading, refined by s."""
    grading = GRADINGS[method]
    nodes = {"kind": "auto", **grading, "growth": grading["growth"] * s, "resolution": s, "spacing": s, "middle": s}
    study = {
        "question": "what does an error cost?",
        "scene": {"kind": "stirring-tool", "motion": motion, "nodes": nodes},
        "law": {"kind": "power-law", "index": index, "regularization": 1e-3},
        "physics": {} if motion == "spin" else {"penalty": 1e5},
        "discretizer": {"kind": "delaunay" if method == "finite elements" else method},
        "solver": SOLVERS[method],
        "start": {"solver": SOLVERS[method], "tolerance": TOLERANCE, "values": [] if rest else list(VALUES)},
        "stop": {"tolerance": TOLERANCE},
    }
    return nlsolve.Study.from_dict(study).cases[0].parts


def relative_error(case: Any, points: np.ndarray, velocity: np.ndarray) -> float:
    """Of velocities at points inside, beside the exact ones or the reference's."""
    exact = case.scene.exact(case.law, points, 0.0)
    if exact is not None:
        return float(np.linalg.norm(velocity - exact.velocity) / np.linalg.norm(exact.velocity))
    table = pd.read_csv(REFERENCE / f"orbit_n{case.law.index}.csv")
    radius = np.hypot(table["x"], table["y"])
    table = table[(radius > 1.501) & (radius < 5.999)]
    there = FIT.values(points, table[["x", "y"]].to_numpy()) @ velocity
    reference = table[["u", "v"]].to_numpy()
    return float(np.linalg.norm(there - reference) / np.linalg.norm(reference))


def ours(method: str, motion: str, index: float, s: float, audited: bool, rest: bool) -> Cost:
    """One case of nlsolve."""
    case = parts(method, motion, index, s, rest)
    if not audited:
        case = case.model_copy(update={"error_estimator": None})
    solved = []
    begun = time.process_time()
    result = run_case(case, watch=lambda _: solved.append(time.process_time()))
    seconds = (time.process_time() if audited else solved[-1]) - begun
    row, fields = result.summary, result.fields
    assert row["status"] == "converged", row["message"]
    if motion == "spin":
        return int(row["nodes"]), float(row["velocity_error_inside"]), seconds
    error = relative_error(case, fields[["x", "y"]].to_numpy(), fields[["u", "v"]].to_numpy())
    return int(row["nodes"]), error, seconds


def theirs(motion: str, index: float, s: float, rest: bool) -> Cost:
    """The same by finite elements."""
    case = parts("finite elements", motion, index, s, rest)
    laws = [stage.law for stage in case.start.stages(case.law)]
    begun = time.process_time()
    cloud = case.scene.cloud(case.law)
    flow = TaylorHood(cloud, SADDLE)
    walls = flow.wall_velocity(case.scene, case.law, cloud)
    velocity = flow.solve(laws, walls, TOLERANCE)
    seconds = time.process_time() - begun
    chosen = flow.inside if motion == "spin" else np.arange(len(flow.points))
    return len(flow.points), relative_error(case, flow.points[chosen], velocity[chosen]), seconds


Run = Callable[[str, float, float, bool], Cost]


def run_of(method: str, audited: bool) -> Run:
    """A run of one of our methods, with or without its audits."""
    return lambda motion, index, s, rest: ours(method, motion, index, s, audited, rest)


METHODS: Mapping[str, tuple[str, Run]] = {
    "finite elements": ("finite elements", theirs),
    **{
        method + ", audited" * audited: (method, run_of(method, audited))
        for method in ("triangles", "delaunay", "mls")
        for audited in (False, True)
    },
}


def measured(motion: str, index: float, rounds: int, largest: float, rest: bool) -> dict[str, list[Cost]]:
    """Median costs of each method on its clouds, coarsest first."""
    found: dict[str, list[Cost]] = {name: [] for name in METHODS}
    for level in range(max(map(len, REFINEMENTS.values()))):
        going = {
            name: (REFINEMENTS[grading][level], run)
            for name, (grading, run) in METHODS.items()
            if level < len(REFINEMENTS[grading]) and (not found[name] or GROWTH * found[name][-1][2] < largest)
        }
        costs: dict[str, list[Cost]] = {name: [] for name in going}
        for _ in range(rounds):
            for name, (s, run) in going.items():
                if not costs[name] or costs[name][0][2] < LONG:
                    costs[name].append(run(motion, index, s, rest))
        for name, runs in costs.items():
            count, error, _ = runs[0]
            seconds = statistics.median(run[2] for run in runs)
            found[name].append((count, error, seconds))
            print(
                f"{motion:6s} {index:8g}  {name:22s} {going[name][0]:5g} {count:9d} {100 * error:9.4f} %"
                f" {seconds:9.2f}",
                flush=True,
            )
    return found


def seconds_at(error: float, costs: list[Cost]) -> float:
    """Seconds of the cheapest of the clouds, and of what lies between two of them in the logarithms, with this error;
    NaN outside of what has been run.
    """
    candidates = []
    for (_, e, t), (_, finer, more) in pairwise(costs):
        if min(e, finer) <= error <= max(e, finer) and e != finer:
            part = np.log(error / e) / np.log(finer / e)
            candidates.append(t * (more / t) ** part)
    return float(min(candidates, default=np.nan))


def main(rounds: int, largest: float, rest: bool) -> None:
    """Print both tables."""
    print("scene         n  method                     s  velocities       error   seconds")
    for _, run in METHODS.values():  # imports and memory are no work of a method
        run("spin", 0.3, REFINEMENTS["mls"][0], rest)
    tables = {scene: measured(*scene, rounds, largest, rest) for scene in SCENES}
    for (motion, index), found in tables.items():
        errors = SCENES[motion, index]
        print(f"\n{motion}, n = {index:g}          " + "".join(f"{100 * error:>10g} %    ratio" for error in errors))
        base = [seconds_at(error, found["finite elements"]) for error in errors]
        for name, costs in found.items():
            cells = [(seconds_at(error, costs), other) for error, other in zip(errors, base, strict=True)]
            print(f"  {name:22s}" + "".join(f"{t:10.2f} s {t / other:8.2f}" for t, other in cells))


if __name__ == "__main__":
    given = [float(argument) for argument in sys.argv[1:] if argument != "rest"]
    with threadpool_limits(limits=1):
        main(int(given[0]) if given else 3, given[1] if len(given) > 1 else 60.0, "rest" in sys.argv)
