"""How many factorisations and seconds does a way to the first state of a march take, and does it get there?

    python benchmarks/first_states.py [CASES] [WAY …]

Scenes, laws, discretizers and penalties are drawn at random; an eighth of the cases has convection. The way that a
march takes by itself ("left open") was chosen on every second case; the others were looked at afterwards, and are run
here: the first CASES of them (default: all), begun by continuation and by each WAY (default: all). Prints a row for
each way: the cases that it can be asked in; those that it solves; those that it does not solve and the continuation
does; those in which the two end at states that differ by more than `SAME`; and, of the cases that both solve, the
factorisations of both, with those of linear triangles, the seconds of both, with those of the operators, and the median
and the largest quotient of seconds.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from nlsolve import InputError
from nlsolve.series import Array
from nlsolve.solving.way import Walk, Way
from nlsolve.solving.work.ledger import Ledger
from nlsolve.study.study import Study

SEED = 14
DRAWN = 160
SAME = 1e-5
"""Largest ‖V − V′‖/‖V′‖ of two states that count as one."""

CONVECTED = 0.12
"""Share of the cases that have convection."""

Table = dict[str, Any]
"""A table of a study."""

CONTINUATION = "continuation in n"
WAYS: dict[str, Table] = {
    CONTINUATION: {"values": [1.0, 0.5, 0.3, 0.2]},
    "from n = 1 alone": {"values": [1.0]},
    "adaptive in n": {"adaptive": True},
    "from rest": {"values": []},
    "from rest, energy": {"values": [], "solver": {"kind": "newton", "globalization": {"kind": "energy"}}},
    "left open": {},
}

DISCRETIZERS: dict[str, Table] = {
    "mls": {"kind": "mls"},
    "mls, nearest": {
        "kind": "mls",
        "balanced": False,
        "points": "between",
        "volume_points": "nodes",
        "volume_support": 16,
    },
    "mls, conservative": {"kind": "mls", "form": "conservative"},
    "delaunay": {"kind": "delaunay"},
    "rbf": {"kind": "rbf", "form": "strong"},
}


def power_law(index: float, regularization: float) -> Table:
    return {"kind": "power-law", "index": index, "regularization": regularization}


LAWS: list[tuple[str, Table]] = [
    *(
        (f"n = {n:g}, ε₀ = {rate:g}", power_law(n, rate))
        for n in (1.0, 0.5, 0.3, 0.1324, 0.1324, 0.1, 0.05)  # the paper's index twice as often
        for rate in (1e-2, 1e-3)
    ),
    ("norton-hoff", {"kind": "norton-hoff"}),
    ("carreau-yasuda", {"kind": "carreau-yasuda"}),
    ("cross", {"kind": "cross"}),
    ("herschel-bulkley", {"kind": "herschel-bulkley"}),
    ("carreau-yasuda, n = 0.05", {"kind": "carreau-yasuda", "index": 0.05}),
    ("herschel-bulkley, n = 0.1", {"kind": "herschel-bulkley", "index": 0.1, "yield_stress": 40.0}),
    ("n = 1.8", power_law(1.8, 1e-2)),
]


def tool(motion: str, nodes: Table) -> Table:
    return {"kind": "stirring-tool", "motion": motion, "nodes": nodes}


RINGS: Table = {"kind": "rings", "spacing": 0.35}
SCATTERED: Table = {"kind": "scattered", "first": 0.15, "spacing": 0.4}
SCENES: dict[str, Table] = {
    "spin": tool("spin", RINGS),
    "spin, the paper's nodes": tool("spin", {"kind": "rings", "spacing": 0.25}),
    "spin, graded": tool("spin", {"kind": "graded-rings", "first": 0.1, "growth": 0.15, "spacing": 0.4}),
    "spin, scattered": tool("spin", SCATTERED),
    "spin, jitter": tool("spin", {**RINGS, "jitter": 0.2}),
    "orbit": tool("orbit", RINGS),
    "orbit, scattered": tool("orbit", SCATTERED),
    "orbit, graded": tool("orbit", {"kind": "graded-rings", "first": 0.08, "growth": 0.15, "spacing": 0.4}),
    "couette": {"kind": "couette", "nodes": RINGS},
    "channel": {"kind": "channel", "spacing": 0.06},
    "channel, scattered": {"kind": "channel", "nodes": "scattered", "spacing": 0.07},
    "bearing": {"kind": "eccentric-cylinders", "spacing": 0.09},
    "manufactured": {"kind": "manufactured", "nodes": "scattered", "spacing": 0.035},
    "cavity, smooth lid": {"kind": "cavity", "lid": "smooth", "spacing": 0.035},
    "cavity": {"kind": "cavity", "spacing": 0.035},
}
PENALTIES = (None, 1e2, 1e2, 1e4, 1e4, 1e6)
PRESSED = ("bearing", "manufactured")
"""Scenes that have no solution without a penalty."""

HEAVY = ("cavity", "manufactured")
"""Small scenes, in which a material needs a large density for its convection to tell."""


def cases() -> list[tuple[str, Table]]:
    """Name and document, without a way, of every second of the cases drawn; all differ."""
    random, drawn = np.random.default_rng(SEED), dict[str, Table]()
    while len(drawn) < DRAWN:
        scene, nodes = list(SCENES.items())[random.integers(len(SCENES))]
        law, constants = LAWS[random.integers(len(LAWS))]
        discretizer, fields = list(DISCRETIZERS.items())[random.integers(len(DISCRETIZERS))]
        penalty = PENALTIES[random.integers(len(PENALTIES))]
        physics: Table = {"convection": True} if random.random() < CONVECTED else {}
        if penalty is None and scene.startswith(PRESSED):
            penalty = 1e4
        if physics and scene.startswith(HEAVY):
            physics["density"] = 1e-3
        name = f"{scene} | {law} | {discretizer} | penalty {penalty}{' | convection' if physics else ''}"
        physics |= {} if penalty is None else {"penalty": penalty}
        drawn.setdefault(name, {"scene": nodes, "law": constants, "discretizer": fields, "physics": physics})
    return list(drawn.items())[1::2]


@dataclass(frozen=True)
class Reached:
    """How a way has ended: with the velocity (N, 2) of the first state, or None."""

    velocity: Array | None
    factorisations: int
    seconds: float


def begun(document: Table, way: Table) -> Reached:
    """Build the operators of a march and go this way to its first state. May raise InputError."""
    usual = {
        "question": "?",
        "solver": {"kind": "broyden"},
        "time": {"horizon": 1e-4, "increment": 1e-4},
        "budget": {"iterations": 100},
    }
    parts = Study.from_dict({**usual, **document, "start": way}).cases[0].parts
    operators, ledger = Ledger(), Ledger()
    simulation = parts.scene.simulation(parts, operators.entry)
    walk = Walk(parts.linear, ledger, Way(()), lambda shared: None)
    solves, outcome = simulation.solves(), None
    try:
        task = next(solves)
        while task.preparation is not None:
            outcome = walk.outcome(task)
            if outcome.converged:
                simulation.keep(task, outcome.state)
            task = solves.send(outcome)
    except StopIteration:  # the way has failed
        velocity = None
    else:
        velocity = simulation.state.velocity
    seconds = operators.seconds["operators"] + ledger.seconds["stage"]
    return Reached(velocity, ledger.counts["factorization"], seconds)


def measured(name: str, document: Table, ways: Sequence[str]) -> Iterator[dict[str, Any]]:
    """A row for each way that can be asked for in this case, the continuation first."""
    usual: Reached | None = None
    for way, table in WAYS.items():
        if way not in ways and usual is not None:
            continue
        if "solver" in table and not is_conservative(document):
            continue
        here = begun(document, table)
        usual = usual or here
        distance = np.nan
        if here.velocity is not None and usual.velocity is not None:
            distance = np.linalg.norm(here.velocity - usual.velocity) / np.linalg.norm(usual.velocity)
        yield {
            "case": name,
            "way": way,
            "solved": here.velocity is not None,
            "known": usual.velocity is not None,
            "factorisations": here.factorisations,
            "seconds": here.seconds,
            "usual factorisations": usual.factorisations,
            "usual seconds": usual.seconds,
            "distance": distance,
        }


def is_conservative(document: Table) -> bool:
    """Whether R is the gradient of a potential."""
    discretizer = document["discretizer"]
    conservative = discretizer["kind"] == "delaunay" or discretizer.get("form") == "conservative"
    return conservative and "convection" not in document["physics"]


def summed_up(rows: pd.DataFrame) -> pd.Series:
    """One row of the table."""
    both = rows[rows["solved"] & rows["known"]]
    quotient = both["seconds"] / both["usual seconds"]
    return pd.Series(
        {
            "cases": len(rows),
            "solved": int(rows["solved"].sum()),
            "lost": int((rows["known"] & ~rows["solved"]).sum()),
            "elsewhere": int((both["distance"] > SAME).sum()),
            "factorisations": f"{both['factorisations'].sum()} of {both['usual factorisations'].sum()}",
            "seconds": f"{both['seconds'].sum():.1f} of {both['usual seconds'].sum():.1f}",
            "median": f"{quotient.median():.2f}",
            "largest": f"{quotient.max():.2f}",
        }
    )


def main() -> None:
    rows = list[dict[str, Any]]()
    asked = int(sys.argv[1]) if len(sys.argv) > 1 else None
    ways = sys.argv[2:] or list(WAYS)
    begun(cases()[0][1], {})  # loads what is loaded once
    for name, document in cases()[:asked]:
        try:
            with threadpool_limits(limits=1):
                found = list(measured(name, document, ways))
        except InputError as refusal:  # a law that its scene does not take
            print(name, str(refusal).partition(":")[2], sep=" | ", file=sys.stderr)
            continue
        rows += found
        for row in found:
            told = (f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values())
            print(*told, sep=" | ", file=sys.stderr, flush=True)
    frame = pd.DataFrame(rows)
    print(f"{frame['case'].nunique()} cases")
    print(frame.groupby("way", sort=False).apply(summed_up, include_groups=False).to_string())


if __name__ == "__main__":
    main()
