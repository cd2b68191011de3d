"""Do the audits of what laws, scenes and numbers claim doubt a shipped scene?

    python benchmarks/claims.py [--first N] [--seconds N]

Runs shipped scenes with a closed solution × spacings × discretizers × laws × penalties, in an order drawn at random.
Prints how many have converged, the alarms of each claim, and by halves (even and odd numbers in that order) the largest
ratio of the true error to its estimate where nothing is in doubt. The limit of `audit.exact` was chosen with the first
160 of them in sight, both halves, when the estimate was made in another way.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator, Mapping, Sequence
from random import Random
from typing import Any

import numpy as np
from fuzz import REGISTRY, stopped_after

from nlsolve import Status, Study, StudyError
from nlsolve.contracts.status import CaseStopped
from nlsolve.flow.validity import LIMITS
from nlsolve.results.verdicts import ACCEPTED
from nlsolve.running.engines.execution import execute
from nlsolve.study.timing import Timing

Table = dict[str, Any]

SEED = 7
CLAIMS = ("audit.gained_power", "audit.falling_stress", "audit.exact", "audit.units")
DISCRETIZERS: tuple[Table, ...] = (
    {"kind": "mls"},
    {"kind": "mls", "points": "nodes"},
    {"kind": "mls", "form": "conservative"},
    {"kind": "mls", "degree": 1},
    {"kind": "rbf", "form": "strong"},
    {"kind": "rbf", "form": "conservative"},
    {"kind": "delaunay"},
)
PHYSICS: tuple[Table, ...] = (
    {},
    {"physics": {"penalty": 100.0}},
    {"physics": {"penalty": 1e4}},
    {"physics": {"penalty": 100.0, "divergence_tolerance": 1e-6}},
)
POWER_LAWS: tuple[Table, ...] = tuple(
    {"law": {"kind": "power-law", "index": index, "regularization": 1e-2}} for index in (1.0, 0.5, 0.3, 0.1324, 0.05)
)
BY_LOAD = {"start": {"by": "load", "values": [0.1]}}
OTHER_LAWS: tuple[Table, ...] = (
    {"law": {"kind": "carreau-yasuda"}},
    {"law": {"kind": "cross"}},
    {"law": {"kind": "herschel-bulkley"}},
    {"law": {"kind": "norton-hoff"}},
    {"law": {"kind": "bingham"}, **BY_LOAD},
    {"law": {"kind": "sellars-tegart"}, **BY_LOAD},
)
GRADED = {"kind": "graded-rings", "growth": 0.15, "spacing": 0.5}
SPINS: tuple[Table, ...] = (
    {"plate_radius": 3.5, "nodes": {"kind": "rings", "spacing": 0.5}},
    {"plate_radius": 3.5, "nodes": {"kind": "rings", "spacing": 0.25}},
    {"nodes": {**GRADED, "first": 0.2}},
    {"nodes": {**GRADED, "first": 0.1}},
    {"plate_radius": 4.0, "nodes": {"kind": "scattered", "first": 0.15, "growth": 0.15, "spacing": 0.4}},
    {"plate_radius": 4.0, "nodes": {"kind": "auto", "spacing": 0.4}},
    {"plate_radius": 4.0, "nodes": {"kind": "rings", "spacing": 0.3, "jitter": 0.3}},
)
CHANNELS: tuple[Table, ...] = (
    {"spacing": 0.25},
    {"spacing": 0.12},
    {"spacing": 0.15, "nodes": "scattered"},
    {"spacing": 0.15, "jitter": 0.3},
)
MANUFACTURED: tuple[Table, ...] = ({"spacing": 0.15}, {"spacing": 0.08}, {"spacing": 0.1, "nodes": "scattered"})
ECCENTRIC: tuple[Table, ...] = ({"spacing": 0.4}, {"spacing": 0.2})
FAMILIES: tuple[tuple[str, Sequence[Table], Sequence[Table], Sequence[Table]], ...] = (
    ("stirring-tool", SPINS, POWER_LAWS, PHYSICS),
    ("couette", SPINS[1:6], OTHER_LAWS, PHYSICS[:3]),
    ("channel", CHANNELS, POWER_LAWS, PHYSICS),
    ("manufactured", MANUFACTURED, POWER_LAWS[:4] + OTHER_LAWS[:4], PHYSICS[:1] + PHYSICS[2:]),
    ("eccentric-cylinders", ECCENTRIC, POWER_LAWS[:1], PHYSICS),
)


def documents() -> list[Table]:
    """All cases, in a random order that never changes."""
    found = [
        {"scene": {"kind": kind, **scene}, "discretizer": discretizer, "solver": {"kind": "newton"}, **law, **physics}
        for kind, scenes, laws, terms in FAMILIES
        for scene, law, discretizer, physics in itertools.product(scenes, laws, DISCRETIZERS, terms)
    ]
    Random(SEED).shuffle(found)
    return found


def rows(chosen: Sequence[Table], seconds: int) -> Iterator[Mapping[str, Any]]:
    """The row of each case; without a status where it is refused, or is stopped at its limit."""
    for document in chosen:
        try:
            (case,) = Study.from_dict({"question": "?", **document}, registry=REGISTRY).cases
            with stopped_after(seconds):
                yield execute(case.id, case.parameters, case.parts, Timing(), lambda progress: None).run
        except (StudyError, CaseStopped):
            yield {}


def is_solved(row: Mapping[str, Any]) -> bool:
    """Whether the case has converged, and both its error and the estimate of it are known."""
    known = [float(row.get(name, np.nan)) for name in ("velocity_error_inside", "velocity_error_estimate")]
    return row.get("status") == Status.CONVERGED.word and bool(np.isfinite(known).all())


def alarms(row: Mapping[str, Any]) -> list[str]:
    """The claims that the run doubts."""
    return [name for name in CLAIMS if float(row.get(name, np.nan)) > LIMITS[name].largest]


def largest_ratio(found: Sequence[Mapping[str, Any]], above: float = 0.0) -> tuple[int, float]:
    """How many cases without a doubt have an error above that, and the largest error over its estimate among them."""
    ratios = [
        row["velocity_error_inside"] / row["velocity_error_estimate"]
        for row in found
        if row["velocity_error_inside"] > above and row["doubt"] == ""
    ]
    return len(ratios), max(ratios, default=float("nan"))


def main(arguments: Sequence[str]) -> int:
    """Print the figures. Returns 1 where a claim of a shipped scene is doubted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=None)
    parser.add_argument("--seconds", type=int, default=60)
    chosen = parser.parse_args(arguments)
    found = list(rows(documents()[: chosen.first], chosen.seconds))
    solved = [(number, row) for number, row in enumerate(found) if is_solved(row)]
    alarmed = [name for _, row in solved for name in alarms(row)]
    print(f"{len(found)} cases of {len(documents())}, {len(solved)} solved with an error and an estimate")
    print(*(f"  {name}: {alarmed.count(name)} alarms" for name in CLAIMS), sep="\n")
    for name, half in (("even half", 0), ("odd half", 1)):
        part = [row for number, row in solved if number % 2 == half]
        (count, largest), (wrong, worst) = largest_ratio(part), largest_ratio(part, ACCEPTED)
        print(
            f"  {name}: {count} without a doubt, error over estimate at most {largest:.2g}; "
            f"{wrong} of them with an error above {100 * ACCEPTED:g} %, at most {worst:.2g}"
        )
    return int(bool(alarmed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
