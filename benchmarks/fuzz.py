"""Does every run end in a status with a sentence, whatever it is given?

    python benchmarks/fuzz.py [systems] [flows] [files] [--part FRACTION] [--seed N] [--seconds N]

systems : every method, in many variants, on every shipped system, from its start times 1e-150, 1e-6, 1e-3, 1, 1e3,
          1e6 and 1e100.
flows   : every shipped scene at spacings from far too coarse to fine, with every discretizer and law.
files   : files of nodes in every format that is read, damaged or odd in many ways (`odd_nodes.py`).

Prints the number of runs, how many ended with which status, how many as `crashed`, and one example of each crash. A run
is stopped after SECONDS. With `--part 0.1` a tenth of the runs, drawn by the seed, is made.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any

from nlsolve_systems.catalogue import PROBLEMS
from odd_nodes import odd_files

from nlsolve import Status, Study, StudyError
from nlsolve.contracts.status import CaseStopped
from nlsolve.registry.registry import load_registry
from nlsolve.running.engines.execution import execute
from nlsolve.study.timing import Timing

Table = dict[str, Any]

SECONDS = 5
ITERATIONS = 12
REFUSED = "refused"
FACTORS = (1e-150, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e100)

SYSTEMS: tuple[Table, ...] = (
    *({"kind": "published", "problem": name} for name in PROBLEMS),
    {"kind": "bratu", "nodes": 12},
    {"kind": "bratu", "nodes": 12, "strength": 4.0, "amplitude": 4.0},
    {"kind": "bratu", "nodes": 5, "dimension": 2},
    {"kind": "chandrasekhar", "size": 12},
    {"kind": "chandrasekhar", "size": 12, "albedo": 1.0},
    {"kind": "p-laplacian", "nodes": 12},
    {"kind": "p-laplacian", "nodes": 12, "power": 1.01, "regularization": 1e-12},
    {"kind": "p-laplacian", "nodes": 5, "dimension": 2, "power": 5.0},
)

GLOBALIZED = ("none", "backtracking", "cubic", "non-monotone", "energy")
RANGES: tuple[Table, ...] = tuple(
    {"kind": kind}
    for kind in ("ratio", "last-term", "residual-coefficient", "true-residual", "pade-pair", "nearest-pole")
)
METHODS: tuple[Table, ...] = (
    *({"kind": "newton", "globalization": {"kind": kind}} for kind in GLOBALIZED),
    *({"kind": "modified-newton", "globalization": {"kind": kind}} for kind in GLOBALIZED),
    *({"kind": "broyden", "globalization": {"kind": kind}} for kind in GLOBALIZED),
    *({"kind": "anderson", "globalization": {"kind": kind}, "depth": 3} for kind in GLOBALIZED),
    *({"kind": "newton-krylov", "globalization": {"kind": kind}} for kind in GLOBALIZED),
    *({"kind": "newton-krylov", "forcing": kind} for kind in ("linear-model", "ratio", "constant")),
    *({"kind": "newton-krylov", "products": kind} for kind in ("jacobian", "series")),
    {"kind": "picard"},
    {"kind": "trust-region"},
    {"kind": "levenberg-marquardt"},
    {"kind": "levenberg-marquardt", "shift": 1e-12},
    {"kind": "pseudo-transient"},
    {"kind": "pseudo-transient", "shift": 1e-9},
    {"kind": "robust"},
    {"kind": "robust", "patience": 1, "leaps": 10},
    *(
        {"kind": "anm", "form": form, "extrapolation": extrapolation, "range": rule}
        for form in ("fixed-point", "newton")
        for extrapolation in ("series", "pade", "gram-schmidt-pade")
        for rule in RANGES
    ),
    *({"kind": "anm", "short_range": kind, "corrections": 2} for kind in ("renew", "advance", "accept")),
    {"kind": "anm", "order": 2},
    {"kind": "anm", "order": 60},
    *(
        {"kind": "anm", "adaptive": True, "residual": 1e-8, "order": 30, "range": rule, "extrapolation": extrapolation}
        for rule in RANGES
        for extrapolation in ("series", "pade")
    ),
    *(
        {"kind": "scipy-root", "method": method, "precondition": precondition, "iterations": 5}
        for method in ("hybr", "krylov", "broyden1", "anderson", "df-sane")
        for precondition in (True, False)
    ),
    {"kind": "scipy-root", "method": "hybr", "jacobian": "products"},
    {"kind": "scipy-root", "method": "hybr", "jacobian": "products", "precondition": False},
    {"kind": "petsc-snes"},
    {"kind": "kinsol"},
)
EXTRAS: tuple[Table, ...] = (
    {},
    {"refresh": {"kind": "never"}},
    {"refresh": {"kind": "cost-optimal"}},
    {"refresh": {"kind": "average-cost"}},
    {"refresh": {"kind": "poor-contraction"}},
    {"operator": {"kind": "diagonal"}},
    {"operator": {"kind": "mass"}},
    {"operator": {"kind": "secant"}},
    {"linear": {"kind": "lapack"}},
    {"linear": {"kind": "ilu-gmres"}},
    {"linear": {"kind": "rslab"}},
    {"stop": {"kind": "difference", "norm": "components"}},
    {"stop": {"kind": "difference", "norm": "maximum", "tolerance": 1e-300}},
)

SPACINGS = (100.0, 5.0, 3.0, 1.7, 1.0, 0.5)
SCENES: tuple[Table, ...] = (
    *(
        {"kind": "stirring-tool", "motion": motion, "nodes": {"kind": kind}}
        for motion in ("spin", "orbit")
        for kind in ("rings", "graded-rings", "scattered", "auto")
    ),
    {"kind": "stirring-tool", "nodes": {"kind": "rings", "jitter": 0.49}},
    {"kind": "stirring-tool", "tool_radius": 5.999, "nodes": {"kind": "rings"}},
    {"kind": "couette", "nodes": {"kind": "rings"}},
    {"kind": "couette", "nodes": {"kind": "scattered"}},
    *({"kind": "channel", "nodes": nodes, "jitter": 0.3} for nodes in ("grid", "scattered")),
    *({"kind": "cavity", "nodes": nodes, "lid": lid} for nodes in ("grid", "scattered") for lid in ("plain", "smooth")),
    {"kind": "cavity", "nodes": "scattered", "grading": 0.01},
    *({"kind": "manufactured", "nodes": nodes} for nodes in ("grid", "scattered")),
    {"kind": "eccentric-cylinders"},
)
LAWS: tuple[Table, ...] = (
    {"law": {"kind": "power-law", "index": 1.0}},
    {"law": {"kind": "power-law", "index": 0.1324}},
    {"law": {"kind": "power-law", "index": 1e-3, "regularization": 0.0}},
    {"law": {"kind": "power-law", "index": 3.0, "consistency": 1e-30}},
    {"law": {"kind": "norton-hoff"}},
    {"law": {"kind": "carreau-yasuda"}},
    {"law": {"kind": "cross"}},
    {"law": {"kind": "herschel-bulkley"}},
    {"law": {"kind": "bingham"}, "start": {"by": "load", "values": [0.1]}},
    {"law": {"kind": "sellars-tegart"}, "start": {"by": "load", "values": [0.1]}},
)
DISCRETIZERS: tuple[Table, ...] = (
    {"kind": "mls"},
    {"kind": "mls", "points": "nodes"},
    {"kind": "mls", "form": "conservative"},
    {"kind": "mls", "degree": 1},
    {"kind": "mls", "degree": 4, "support": 20},
    {"kind": "mls", "support": 6},
    {"kind": "rbf"},
    {"kind": "rbf", "degree": 4, "power": 5},
    {"kind": "rbf", "form": "conservative"},
    {"kind": "delaunay"},
)
PHYSICS: tuple[Table, ...] = (
    {},
    {"physics": {"penalty": 100.0}},
    {"physics": {"penalty": 1e3, "divergence_tolerance": 1e-8, "pressure_iterations": 3}},
    {"physics": {"penalty": 1e9, "penalty_unit": "local", "convection": True}},
    {"time": {"horizon": 3e-4}, "physics": {"inertia": True}},
    {"time": {"horizon": 3e-4}, "motion": {"nodes": "lagrangian", "shifting": 0.5, "markers": True}},
    {"time": {"horizon": 3e-2, "increment": 1e-2}, "motion": {"nodes": "lagrangian"}},
    {"time": {"horizon": 2e-4}, "motion": {"nodes": "lagrangian", "rates": "accumulated", "skin": 0.2}},
    {"time": {"horizon": 2e-4}, "start": {"at": "rest"}, "record": {"probe": [1e6, 0.0], "times": [1e-4]}},
    {"start": {"values": []}, "solver": {"kind": "anm"}},
    {"start": {"perturbation": 1e3}, "solver": {"kind": "broyden"}},
    {"start": {"adaptive": True}, "solver": {"kind": "picard"}},
)


@dataclass(frozen=True)
class Ending:
    """How one run ended: its document, the word of its status or "refused", and the sentence."""

    document: Mapping[str, Any]
    word: str
    sentence: str


def systems() -> list[Table]:
    """Documents of all systems × methods × factors, and of other parts of a case with some of the methods."""
    plain = [
        {"scene": {**scene, "factor": factor}, "solver": method}
        for scene, method, factor in itertools.product(SYSTEMS, METHODS, FACTORS)
    ]
    some = [method for method in METHODS if method["kind"] in ("newton", "broyden", "anm", "newton-krylov")][::4]
    others = [
        {"scene": {**scene, "factor": factor}, "solver": method, **extra}
        for scene, method, factor, extra in itertools.product(SYSTEMS, some, FACTORS, EXTRAS[1:])
    ]
    return plain + others


def flows() -> list[Table]:
    """Documents of all scenes × spacings × discretizers × laws × terms of the balance."""
    return [
        {"scene": spaced(scene, spacing), "discretizer": discretizer, **law, "solver": {"kind": "newton"}, **terms}
        for scene, spacing, discretizer, law, terms in itertools.product(SCENES, SPACINGS, DISCRETIZERS, LAWS, PHYSICS)
    ]


def spaced(scene: Table, spacing: float) -> Table:
    """A scene with nodes at this distance, where its kind of nodes has one."""
    if not isinstance(scene.get("nodes"), dict):
        return {**scene, "spacing": 0.3 * spacing}
    nodes = {**scene["nodes"], "spacing": spacing}
    if nodes["kind"] in ("graded-rings", "scattered"):
        nodes["first"] = spacing
    if nodes["kind"] == "auto":
        nodes["smallest"] = 0.3 * spacing
    return {**scene, "nodes": nodes}


def files(folder: Path) -> list[Table]:
    """Documents of a spin whose nodes are read from each odd file, which is written to the folder."""
    return [
        {
            "scene": {"kind": "stirring-tool", "nodes": {"kind": "file", "path": str(path)}},
            "discretizer": {"kind": "delaunay"},
            "law": {"kind": "power-law", "index": 1.0},
            "solver": {"kind": "newton"},
        }
        for path in odd_files(folder)
    ]


def run(document: Table, seconds: int = SECONDS) -> Ending:
    """Run one case in this process, for at most some seconds."""
    whole = {"question": "?", "budget": {"iterations": ITERATIONS}, **document}
    try:
        (case,) = Study.from_dict(whole, registry=REGISTRY).cases
    except StudyError as refusal:
        return Ending(document, REFUSED, str(refusal))
    try:
        with stopped_after(seconds):
            row = execute(case.id, case.parameters, case.parts, Timing(), lambda progress: None).run
    except CaseStopped as limit:  # before the case has begun, or after its end
        return Ending(document, limit.status.word, limit.detail)
    return Ending(document, row["status"], row["message"])


class stopped_after:
    """What runs longer than some seconds ends as a case does at its limit."""

    def __init__(self, seconds: int) -> None:
        self._seconds = seconds

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGALRM, self._stop)
        signal.alarm(self._seconds)

    def __exit__(self, *error: object) -> None:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, self._before)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        raise CaseStopped(Status.TIMED_OUT, f"{self._seconds} s")


REGISTRY = load_registry()


def drawn(documents: Sequence[Table], part: float, seed: int) -> list[Table]:
    """A random part of the documents, in their order."""
    chosen = Random(seed).sample(range(len(documents)), max(1, round(part * len(documents))))
    return [documents[number] for number in sorted(chosen)]


def endings(documents: Sequence[Table], seconds: int = SECONDS) -> Iterator[Ending]:
    """Run each document; every hundredth is told on standard error."""
    for number, document in enumerate(documents):
        if number and number % 100 == 0:
            print(f"{number} of {len(documents)}", file=sys.stderr, flush=True)
        yield run(document, seconds)


def crashes(found: Sequence[Ending]) -> dict[str, list[Ending]]:
    """Runs that ended as crashed, by the words of the sentence without its numbers."""
    causes = collections.defaultdict(list)
    for ending in found:
        if ending.word == Status.CRASHED.word:
            causes[ending.sentence.rpartition("/")[2] + " | " + ending.sentence[:90]].append(ending)
    return causes


def report(name: str, found: Sequence[Ending]) -> str:
    """Runs, statuses, crashes and their causes, in words."""
    words = collections.Counter(ending.word for ending in found)
    lines = [f"{name}: {len(found)} runs, {words[Status.CRASHED.word]} crashed"]
    lines += [f"    {count:6d} {word}" for word, count in words.most_common()]
    for cause, runs in sorted(crashes(found).items(), key=lambda item: -len(item[1])):
        lines += [f"  {len(runs)} x {cause}", f"      {runs[0].document}", f"      {runs[0].sentence}"]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Print the report of each kind of runs. Returns 1 where one has crashed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=["systems", "flows", "files"])
    parser.add_argument("--part", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=int, default=SECONDS)
    chosen = parser.parse_args(arguments)
    crashed = 0
    with tempfile.TemporaryDirectory() as folder:
        kinds = {"systems": systems, "flows": flows, "files": lambda: files(Path(folder))}
        for what in chosen.what:
            found = list(endings(drawn(kinds[what](), chosen.part, chosen.seed), chosen.seconds))
            print(report(what, found), flush=True)
            crashed += sum(map(len, crashes(found).values()))
    return int(crashed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
