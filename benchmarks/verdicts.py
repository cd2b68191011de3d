"""How often is a system called solved away from any root, and how often is a state at a root not called solved?

    python benchmarks/verdicts.py [--part FRACTION]

Runs shipped systems × factors of their start × methods, each as published and with every equation and every unknown in
a unit of its own, drawn at random. A root is looked for without the measure that verdicts are made by: among the known
ones, else by Newton's steps in extended precision, in the published units. A run counts as

    false success   called solved, beyond doubt, with no root within `RIGHT` of it, unknown by unknown
    false alarm     at a root to `EXACT`, and not called solved, or in doubt

A state near a root of multiplicity m is as near as F can tell, so that `EXACT` is raised to its power 1/m.
Even and odd numbers of the runs, in an order drawn at random, are counted apart: thresholds of `nlsolve.algebra` are
chosen on the even ones and judged on the odd ones.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, Literal

import numpy as np
from fuzz import REGISTRY, stopped_after
from nlsolve_systems import Bratu, Chandrasekhar, PLaplacian, Published
from nlsolve_systems.catalogue import PROBLEMS

from nlsolve import Status, Study
from nlsolve.algebra.root_search import root_error
from nlsolve.contracts.status import CaseStopped
from nlsolve.plugin import System, as_column
from nlsolve.solving.simulate import run_case

SEED = 11
SECONDS = 20
RIGHT, EXACT = 1e-2, 1e-9
FACTORS = (1.0, 10.0, 100.0)
MULTIPLICITY = 4.0  # of the roots with a singular Jacobian in the published sets, at most
POLISHING = 60
VANISHED = 1e-9  # part of max |F_i| at the published start that a root may have left

SYSTEMS: tuple[System, ...] = (
    *(Published(problem=name) for name in PROBLEMS),
    Bratu(nodes=15),
    Bratu(nodes=15, strength=3.0, amplitude=4.0),
    Bratu(nodes=5, dimension=2),
    Chandrasekhar(size=12),
    PLaplacian(nodes=12),
)
METHODS: dict[str, dict[str, Any]] = {
    "robust": {"kind": "robust"},
    "newton, full": {"kind": "newton", "globalization": {"kind": "none"}},
    "newton": {"kind": "newton"},
    "trust-region": {"kind": "trust-region"},
    "pseudo-transient": {"kind": "pseudo-transient"},
    "broyden": {"kind": "broyden"},
    "homotopy": {"kind": "anm"},
    "scipy": {"kind": "scipy-root", "method": "hybr", "precondition": False, "tolerance": 1e-12},
}


class Rescaled(System):
    """v ↦ r ∘ F(v/c): a system in other units, v = c ∘ u.

    member : number of the system in `SYSTEMS`.
    units : seed of r and c, powers of two; 0: both are 1.
    """

    kind: Literal["rescaled"] = "rescaled"
    member: int
    units: int = 0

    @property
    def system(self) -> System:
        """The system in its own units, from its start times the factor."""
        return SYSTEMS[self.member].model_copy(update={"factor": self.factor})

    def powers(self) -> np.ndarray:
        """r and c, (2, U)."""
        shape = 2, len(SYSTEMS[self.member].start())
        drawn = np.random.default_rng(self.units).integers(-30, 31, shape) if self.units else np.zeros(shape)
        return 2.0**drawn

    def formula(self, u: Any) -> Any:
        rows, columns = self.powers()
        return as_column(rows, u) * SYSTEMS[self.member].formula(as_column(1.0 / columns, u) * u)

    def standard_start(self) -> np.ndarray:
        return self.powers()[1] * SYSTEMS[self.member].start()

    def start(self) -> np.ndarray:
        return self.powers()[1] * self.system.start()

    def pattern(self) -> Any | None:
        return SYSTEMS[self.member].pattern()

    def roots(self) -> np.ndarray | None:
        known = SYSTEMS[self.member].roots()
        return None if known is None else known * self.powers()[1]

    def nearest_root(self, u: np.ndarray) -> np.ndarray | None:
        columns = self.powers()[1]
        root = SYSTEMS[self.member].nearest_root(u / columns)
        return None if root is None else root * columns

    @property
    def singular(self) -> bool:
        return SYSTEMS[self.member].singular


@dataclass(frozen=True)
class Run:
    """One run: what of, by which method, how it ended, and how far from a root, unknown by unknown."""

    name: str
    method: str
    word: str
    doubt: str
    distance: float
    exact: float

    @property
    def verdict(self) -> str:
        """right, honest, false success or false alarm."""
        claimed = self.word in (Status.CONVERGED.word, Status.OTHER_ROOT.word) and not self.doubt
        if claimed:
            return "right" if self.distance <= RIGHT else "false success"
        return "false alarm" if self.distance <= self.exact else "honest"


def distance(scene: Rescaled, v: np.ndarray) -> float:
    """max_j |u_j − root_j| over the size of root_j, for the root nearest to u = v/c (U,); infinite without one, and
    for a case that was stopped before it had a state.
    """
    if not (len(v) and np.isfinite(v).all()):
        return np.inf
    u, system = v / scene.powers()[1], scene.system
    start = np.abs(system.start())
    start[start == 0.0] = start.max(initial=0.0)
    listed = system.nearest_root(u)
    near = np.inf if listed is None else root_error(listed, u, start)
    if near <= RIGHT:
        return near
    found = polished(system, u)
    return near if found is None else min(near, root_error(found, u, start))


@np.errstate(all="ignore")
def polished(system: System, u: np.ndarray) -> np.ndarray | None:
    """The root, (U,), to which Newton's steps lead from u (U,), with F in extended precision; None where to none."""
    problem = system.equations()
    vanished = VANISHED * np.abs(system.formula(system.standard_start())).max()
    state = u.astype(np.longdouble)
    for _ in range(POLISHING):
        residual = np.asarray(system.formula(state), dtype=np.longdouble)
        jacobian = problem.jacobian(state.astype(float)).toarray()
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            return None
        rows = np.abs(jacobian).max(axis=1)
        rows[rows == 0.0] = 1.0
        step = np.linalg.lstsq(jacobian / rows[:, None], -(residual / rows).astype(float), rcond=None)[0]
        state = state + step
        if np.all(np.abs(step) <= 1e-14 * np.abs(state)):
            return state.astype(float) if np.abs(residual).max() <= vanished else None
    return None


def runs(part: float) -> Iterator[Run]:
    """Each system × factor × units × method, in an order drawn at random."""
    cases = list(itertools.product(range(len(SYSTEMS)), FACTORS, (False, True), METHODS.items()))
    Random(SEED).shuffle(cases)
    for number, (member, factor, rescale, (method, solver)) in enumerate(cases[: round(part * len(cases))]):
        scene = Rescaled(member=member, factor=factor, units=number + 1 if rescale else 0)
        document = {
            "question": "?",
            "scene": scene,
            "solver": solver,
            "linear": {"kind": "lapack"},
            "stop": {"kind": "residual", "tolerance": 1e-9},
            "budget": {"iterations": 500},
        }
        (case,) = Study.from_dict(document, registry=REGISTRY).cases
        kind = getattr(SYSTEMS[member], "problem", SYSTEMS[member].kind)
        name = f"{kind} x {factor:g}{', own units' if rescale else ''}"
        with np.errstate(all="ignore"):
            try:
                with stopped_after(SECONDS):
                    record = run_case(case.parts)
            except CaseStopped:
                yield Run(name, method, Status.TIMED_OUT.word, "", np.inf, EXACT)
                continue
            far = distance(scene, record.outcome.state)
        exact = EXACT ** (1.0 / MULTIPLICITY) if scene.singular else EXACT
        summary = record.summary
        yield Run(name, method, summary["status"], str(summary.get("doubt") or ""), far, exact)


def main(arguments: Sequence[str]) -> int:
    """Print the verdicts of both halves, by method, and each false one. Returns 1 where a success was false."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", type=float, default=1.0)
    chosen = parser.parse_args(arguments)
    found = list(runs(chosen.part))
    for half, name in ((found[::2], "even"), (found[1::2], "odd")):
        print(f"{name}: {len(half)} runs")
        for method in METHODS:
            count = collections.Counter(run.verdict for run in half if run.method == method)
            words = ("right", "honest", "false success", "false alarm")
            print(f"    {method:18s}" + "".join(f"{count[word]:6d} {word}" for word in words))
        for run in half:
            if run.verdict.startswith("false"):
                print(
                    f"  {run.verdict}: {run.name}, {run.method}: {run.word}, {run.distance:.1e} from a root {run.doubt}"
                )
    return int(any(run.verdict == "false success" for run in found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
