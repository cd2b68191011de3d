"""Is a ratio of seconds from the exclusive lane the same whether the other cores are idle or busy?

    python benchmarks/exclusive_lane.py [seconds]

Times Newton's and Broyden's method on a steady spin with 4854 nodes in the exclusive lane, first as the machine is,
then beside a process for every other core (on one core: beside one) that is always busy; no round begins when both
together have had `seconds` of the processor. Prints medians with their intervals, rounds, load of the core, and both
ratios. Run it on a machine that is calm otherwise: the first half is to be the idle one.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pandas as pd

import nlsolve
from nlsolve.running.timing.cores import cores_here

STRATEGIES = ("newton", "broyden")
BUSY = [sys.executable, "-c", "while True: pass"]


def document(seconds: float) -> dict[str, Any]:
    """The study: each case takes a third of a second and more."""
    return {
        "question": "what is the ratio of two strategies?",
        "scene": {"kind": "stirring-tool", "nodes": {"kind": "rings", "spacing": 0.15}},
        "law": {"kind": "power-law", "index": 0.5},
        "discretizer": {"kind": "delaunay"},
        "start": {"values": [1.0]},
        "timing": {"lane": "exclusive", "seconds": seconds},
        "sweep": [{"each": [{"name": kind, "solver": {"kind": kind}} for kind in STRATEGIES]}],
    }


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """So many processes that never rest."""
    started = [subprocess.Popen(BUSY) for _ in range(processes)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def timed(seconds: float, processes: int) -> pd.DataFrame:
    """The rows of both strategies, by name, timed beside so many busy processes."""
    with busy(processes):
        return nlsolve.run(document(seconds), isolation="process").runs.set_index("variant")


def ratio(runs: pd.DataFrame) -> float:
    """Seconds of Newton's method over those of Broyden's."""
    newton, broyden = (float(runs.loc[kind, "seconds"]) for kind in STRATEGIES)
    return newton / broyden


def main(seconds: float = 60.0) -> None:
    """Print both ratios."""
    others = max(1, len(cores_here()) - 1)
    ratios = []
    for words, processes in (("as the machine is", 0), (f"beside {others} busy", others)):
        runs = timed(seconds, processes)
        ratios.append(ratio(runs))
        print(f"{words}: newton / broyden = {ratios[-1]:.3f}", flush=True)
        for kind, run in runs.iterrows():
            interval = f"{run['seconds_low']:.4f} to {run['seconds_high']:.4f}"
            told = f"{run['rounds']:.0f} rounds, load {run['load']:.2f}"
            print(f"  {kind:<8} {run['seconds']:.4f} s ({interval}), {told}")
    print(f"the ratios differ by {abs(ratios[1] / ratios[0] - 1.0):.1%}")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:2]))
