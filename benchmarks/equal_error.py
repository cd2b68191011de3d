"""What does a velocity within 1 %, 0.1 % and 0.01 % cost, and what by finite elements? The steady spin of two indices.

    python benchmarks/equal_error.py [rounds] [largest seconds] [rest]

Each method is run on its own clouds, graded to the layer at the tool and refined by a factor s. Ours: `delaunay` by
Newton's method, and `mls` by newton-krylov preconditioned with triangles, without and with the estimate of the error.
Theirs: Taylor-Hood elements (`taylor_hood.py`). All begin at n = 1 and pass the same indices to the one asked for; with
`rest` all begin with that one and V = 0 inside. All end at a relative residual of 1e-8, take full steps that are halved
until the residual falls, and factorise with PARDISO where it is installed.

Seconds are of the processor, from the nodes on to the velocities, operators and assembly included; of each run the
median of the rounds (default: 3), in which all take turns; what takes longer than 2 s is run once. A method's clouds
end before a run that would take longer than `largest seconds` (default: 60). The error is ‖v − v_exact‖₂/‖v_exact‖₂
over the nodes inside. Prints every run, then seconds at the errors asked for, interpolated between clouds in the
logarithms, and their ratios to those of finite elements.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from nlsolve_linear.pardiso import Pardiso
from nlsolve_linear.superlu import SuperLU
from taylor_hood import TaylorHood
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.solving.simulate import run_case

LONG, GROWTH = 2.0, 3.0  # seconds of a run that is not repeated, and of a finer cloud over those of one before
INDICES, ERRORS, TOLERANCE = (0.3, 0.1324), (1e-2, 1e-3, 1e-4), 1e-8
SADDLE = SuperLU() if Pardiso.absent else Pardiso(symmetric="never")
GRADINGS = {
    "finite elements": {"resolution": 1.0, "layers": 1.0, "growth": 0.5},
    "delaunay": {"resolution": 1.0, "layers": 5.0, "growth": 0.4},
    "mls": {"resolution": 1.0, "layers": 5.0, "growth": 0.4},
}
"""At s = 1, the best of those tried at n = 0.1324: 9 for finite elements, 16 for `delaunay`, 4 for `mls`."""
REFINEMENTS = {
    "finite elements": (2.0, 1.0, 0.5, 0.3),
    "delaunay": (2.0, 1.2, 0.6, 0.35, 0.2),
    "mls": (1.4, 0.8, 0.4, 0.25),
}
SOLVERS: dict[str, dict[str, Any]] = {
    "finite elements": {"kind": "newton"},
    "delaunay": {"kind": "newton"},
    "mls": {"kind": "newton-krylov", "preconditioner": "triangles"},
}
Cost = tuple[int, float, float]
"""Velocities, relative error and seconds of one run."""


def parts(method: str, index: float, s: float, estimated: bool, rest: bool = False) -> Any:
    """The components of the steady spin on the method's own grading, refined by s."""
    grading = GRADINGS[method]
    nodes = {"kind": "auto", **grading, "growth": grading["growth"] * s, "resolution": s, "spacing": s, "middle": s}
    study = {
        "question": "what does an error cost?",
        "scene": {"kind": "stirring-tool", "nodes": nodes},
        "law": {"kind": "power-law", "index": index, "regularization": 1e-3},
        "discretizer": {"kind": "delaunay" if method == "finite elements" else method},
        "solver": SOLVERS[method],
        "start": {"solver": SOLVERS[method], "tolerance": TOLERANCE, **({"values": []} if rest else {})},
        "stop": {"tolerance": TOLERANCE},
    }
    case = nlsolve.Study.from_dict(study).cases[0].parts
    return case if estimated else case.model_copy(update={"error_estimator": None})


def ours(method: str, index: float, s: float, estimated: bool, rest: bool) -> Cost:
    """One case of nlsolve."""
    case = parts(method, index, s, estimated, rest)
    begun = time.process_time()
    row = run_case(case).summary
    seconds = time.process_time() - begun
    assert row["status"] == "converged", row["message"]
    return int(row["nodes"]), float(row["velocity_error_inside"]), seconds


def theirs(index: float, s: float, rest: bool) -> Cost:
    """The same by finite elements."""
    case = parts("finite elements", index, s, False, rest)
    laws = [stage.law for stage in case.start.stages(case.law)]
    begun = time.process_time()
    flow = TaylorHood(case.scene.cloud(case.law), SADDLE)
    exact = case.scene.exact(case.law, flow.points, 0.0).velocity
    velocity = flow.solve(laws, exact[flow.wall], TOLERANCE)
    seconds = time.process_time() - begun
    error = np.linalg.norm((velocity - exact)[flow.inside]) / np.linalg.norm(exact[flow.inside])
    return len(flow.points), float(error), seconds


METHODS: Mapping[str, tuple[str, Callable[[float, float, bool], Cost]]] = {
    "finite elements": ("finite elements", theirs),
    "delaunay": ("delaunay", lambda index, s, rest: ours("delaunay", index, s, False, rest)),
    "delaunay, estimated": ("delaunay", lambda index, s, rest: ours("delaunay", index, s, True, rest)),
    "mls": ("mls", lambda index, s, rest: ours("mls", index, s, False, rest)),
    "mls, estimated": ("mls", lambda index, s, rest: ours("mls", index, s, True, rest)),
}


def measured(index: float, rounds: int, largest: float, rest: bool) -> dict[str, list[Cost]]:
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
                    costs[name].append(run(index, s, rest))
        for name, runs in costs.items():
            count, error, _ = runs[0]
            seconds = statistics.median(run[2] for run in runs)
            found[name].append((count, error, seconds))
            print(
                f"{index:8g}  {name:20s} {going[name][0]:5g} {count:9d} {100 * error:9.4f} % {seconds:9.2f}", flush=True
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
    print("       n  method                   s  velocities       error   seconds")
    for _, run in METHODS.values():  # imports and memory are no work of a method
        run(INDICES[0], REFINEMENTS["mls"][0], rest)
    tables = {index: measured(index, rounds, largest, rest) for index in INDICES}
    print("\n       n  method                " + "".join(f"{100 * error:>10g} %    ratio" for error in ERRORS))
    for index, found in tables.items():
        base = [seconds_at(error, found["finite elements"]) for error in ERRORS]
        for name, costs in found.items():
            cells = [(seconds_at(error, costs), other) for error, other in zip(ERRORS, base, strict=True)]
            print(f"{index:8g}  {name:22s}" + "".join(f"{t:10.2f} s {t / other:8.2f}" for t, other in cells))


if __name__ == "__main__":
    given = [float(argument) for argument in sys.argv[1:] if argument != "rest"]
    with threadpool_limits(limits=1):
        main(int(given[0]) if given else 3, given[1] if len(given) > 1 else 60.0, "rest" in sys.argv)
