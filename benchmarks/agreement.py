"""Do the marched homotopy, modified Newton and Newton give one velocity at every increment?

    python benchmarks/agreement.py

Marches the first study's scene (the 2015 paper's 1780 nodes, which move) with each method, records all nodes at every
increment, and prints the largest difference of any velocity component from that of Newton's method stopped at 1e-10.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import nlsolve
from nlsolve import Study

FIRST = Path(__file__).parent.parent / "studies" / "first.toml"
INCREMENTS = 20
STRATEGIES: dict[str, dict[str, Any]] = {
    "newton": {"solver": {"kind": "newton"}, "stop": {"kind": "residual", "tolerance": 1e-10}},
    "anm, p = 20, η = 1e-6": {
        "solver": {"kind": "anm", "order": 20, "tolerance": 1e-6},
        "stop": {"kind": "claim"},
    },
    "modified-newton": {"solver": {"kind": "modified-newton"}, "stop": {"kind": "residual", "tolerance": 1e-8}},
}


def velocities(strategy: dict[str, Any]) -> np.ndarray:
    """Velocities (K, N, 2) [mm/s] at all increments, under one strategy."""
    first = Study.from_toml(FIRST).cases[0].parts
    increment = first.time.increment
    document = {
        "question": "where do the methods differ?",
        **{name: getattr(first, name) for name in ("scene", "law", "physics", "motion", "discretizer")},
        "time": first.time.with_(horizon=INCREMENTS * increment),
        "record": {"times": [k * increment for k in range(1, INCREMENTS + 1)]},
        **strategy,
    }
    results = nlsolve.run(document)
    assert results.runs["status"].item() == "converged", results.runs["message"].item()
    return results.fields[["u", "v"]].to_numpy().reshape(INCREMENTS, -1, 2)


def largest_differences() -> dict[str, np.ndarray]:
    """max |v − v_newton| over nodes and components at each increment, (K,) [mm/s], by strategy."""
    reference, *others = ((name, velocities(strategy)) for name, strategy in STRATEGIES.items())
    return {name: np.abs(velocity - reference[1]).max(axis=(1, 2)) for name, velocity in others}


if __name__ == "__main__":
    for name, differences in largest_differences().items():
        print(f"{name}: at most {differences.max():.1e} mm/s from Newton at any node in {INCREMENTS} increments")
