"""What linear solvers cost on the tangents of flows: factors, solves, their ratio, and how exact they are.

    python benchmarks/linear.py [--large | --orderings] [repeats]

Prints, for every form of the discretisation on the 2015 paper's 1780 nodes (--large: also on 4854 and on 19133), a row
for each linear solver: processor time [ms] of the first factorisation; the median of a later one, to which the first
lends its ordering or analysis, and of one solve; both over SuperLU's in the same run; the pairs of triangular solves in
a solve; entries of the factors; ‖b − A x‖/‖b‖. A linear solver whose library is absent is left out, and named.

With --orderings: on rings 0.5 to 0.05 mm apart, what PARDISO takes when it orders by minimum degree over what it takes
with a dissection by METIS, for a matrix of a new pattern, one of a known pattern, and a solve; and the same of entries.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from nlsolve_linear import pardiso
from operators import setup
from threadpoolctl import threadpool_limits

import nlsolve
from nlsolve.flow.momentum import Flow
from nlsolve.registry.registry import load_registry

FORMS: dict[str, dict[str, Any]] = {
    "mls, stress between nodes": {"kind": "mls"},
    "mls, stress at the nodes": {"kind": "mls", "points": "nodes"},
    "mls, conservative": {"kind": "mls", "form": "conservative"},
    "linear triangles": {"kind": "delaunay"},
}
BASE = "superlu"
LINEARS: dict[str, dict[str, Any]] = {
    BASE: {"kind": "superlu"},
    "superlu, mmd-ata": {"kind": "superlu", "ordering": "mmd-ata"},
    "rslab": {"kind": "rslab"},
    "rslab, never symmetric": {"kind": "rslab", "symmetric": "never"},
    "pardiso": {"kind": "pardiso"},
    "ilu-gmres": {"kind": "ilu-gmres"},
    "lapack": {"kind": "lapack"},
}
SPACINGS = {"small": (0.25,), "large": (0.25, 0.15, 0.075)}  # of the rings [mm]
ORDERED = (0.5, 0.25, 0.15, 0.1, 0.075, 0.05)
DENSE = 4000  # unknowns up to which dense factors are tried
OUT_OF = ["factor", "solve"]
ALL, NONE = 10**12, 0  # entries up to which PARDISO orders by minimum degree


def tangents(form: dict[str, Any], spacing: float) -> tuple[Any, Any]:
    """J at two states a thousandth away from the exact steady spin, as two tangents of one march.

    Not at the exact spin itself: there some entries are zero that are not zero in a march.
    """
    case = setup(nodes={"kind": "rings", "spacing": spacing}, **form)
    cloud = case.scene.cloud(case.law)
    walls = case.scene.boundary_velocity(cloud, case.law, 0.0)
    flow = Flow(cloud, case.discretizer.operators(cloud, False), case.law, walls)
    exact = case.scene.exact(case.law, cloud.nodes, 0.0)
    assert exact is not None
    u = flow.unknowns(exact.velocity)
    waves = 1e-3 * np.abs(u).max() * np.cos(np.outer((1.0, 2.0), np.arange(len(u))))
    return flow.jacobian(u + waves[0]), flow.jacobian(u + waves[1])


def processor_time(work: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """The result of `work`, and its median processor time over `repeats` runs [ms], of all threads."""
    spent = []
    for _ in range(repeats):
        begun = time.process_time()
        result = work()
        spent.append(time.process_time() - begun)
    return result, 1e3 * statistics.median(spent)


def row(linear: nlsolve.LinearSolver, first: Any, following: Any, repeats: int) -> dict[str, Any]:
    """What one linear solver costs on two matrices of one march; where it fails, the sentence that says why."""
    rhs = following @ np.random.default_rng(0).standard_normal(following.shape[0])
    try:
        lent, alone = processor_time(lambda: linear.factorize(first), 1)
        factors, factor = processor_time(lambda: linear.factorize(following, lent), repeats)
        x, solve = processor_time(lambda: factors.solve(rhs), 3 * repeats)
    except nlsolve.SolveError as error:
        return {"failure": str(error)}
    return {
        "first": alone,
        "factor": factor,
        "solve": solve,
        "solves": factors.solves,
        "fill": factors.fill,
        "residual": np.linalg.norm(rhs - following @ x) / np.linalg.norm(rhs),
        "ordering": factors.ordering,
    }


def measure(spacing: float, repeats: int) -> pd.DataFrame:
    """One row for each form and linear solver; times in milliseconds."""
    classes, rows = load_registry().classes("linear"), []
    for form, fields in FORMS.items():
        first, following = tangents(fields, spacing)
        for name, chosen in LINEARS.items():
            unknowns = first.shape[0]
            if chosen["kind"] not in classes or (chosen["kind"] == "lapack" and unknowns > DENSE):
                continue
            linear: Any = classes[chosen["kind"]].model_validate(chosen)
            rows.append({"form": form, "unknowns": unknowns, "linear": name, **row(linear, first, following, repeats)})
    frame = pd.DataFrame(rows)
    frame["factor/solve"] = frame["factor"] / frame["solve"]
    base = frame[frame["linear"] == BASE].set_index("form")
    for name in OUT_OF:
        frame[f"{name}/{BASE}'s"] = frame[name] / frame["form"].map(base[name])
    return frame


def orderings(repeats: int) -> pd.DataFrame:
    """One row for each form and spacing: times and entries by minimum degree over those by dissection."""
    rows: list[dict[str, Any]] = []
    few = pardiso.FEW
    for form, fields in FORMS.items():
        for spacing in ORDERED:
            first, following = tangents(fields, spacing)
            found = []
            for pardiso.FEW in (ALL, NONE):
                costs = row(pardiso.Pardiso(), first, following, repeats)
                new = [processor_time(lambda m=first: pardiso.Pardiso().factorize(m), 1)[1] for _ in range(repeats)]
                found.append({"new": statistics.median(new), **costs})
            ratios = {name: found[0][name] / found[1][name] for name in ("new", "factor", "solve", "fill")}
            rows.append({"form": form, "unknowns": first.shape[0], "entries": first.nnz, **ratios})
    pardiso.FEW = few
    return pd.DataFrame(rows)


def main(arguments: list[str]) -> None:
    """Print one table for each spacing."""
    size = "large" if "--large" in arguments else "small"
    numbers = [int(argument) for argument in arguments if argument.isdigit()]
    if "--orderings" in arguments and pardiso.Pardiso.absent is None:
        print(orderings(numbers[0] if numbers else 5).to_string(index=False, float_format="{:.2f}".format))
        return
    for kind in sorted({chosen["kind"] for chosen in LINEARS.values()}):
        if complaint := load_registry().complaint("linear", kind):
            print(f"left out: {complaint}")
    for spacing in SPACINGS[size]:
        frame = measure(spacing, numbers[0] if numbers else 5)
        print(f"\n{frame['unknowns'].iloc[0]} unknowns, rings {spacing} mm apart; milliseconds")
        print(frame.drop(columns="unknowns").to_string(index=False, float_format="{:.3g}".format), flush=True)


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main(sys.argv[1:])
