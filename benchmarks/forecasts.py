"""How far from the truth is what `nlsolve plan` says of a study of which some cases have been run?

    python benchmarks/forecasts.py [study …]

Runs the quick form of each study once, one case at a time. Then two thirds of its cases, and four fifths, are hidden,
chosen by chance, twenty times; what is known of the rest forecasts how long the hidden ones take together. A way to a
first state counts where no known case shares it; the start of a process is left out. Prints for each study

    cases, seconds      how many, and how long they took
    forecast / truth    of the sum of those hidden: the median of the twenty, and the least and the most
    within 1.5          in how many of the twenty forecast and truth are within a factor 1.5
    in the interval     in how many the truth is in the interval that the forecast gives
    factor              by which the interval reaches above and below it, the geometric mean

The form of the forecast was chosen with `CHOSEN_ON` in sight, and `JUDGED_BY` were put aside until it was.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

import nlsolve
from nlsolve.running.forecast import forecast
from nlsolve.running.planning.outlook import outlook_of
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import Entry, Parts

CHOSEN_ON = ("algebraic", "first", "strategies", "paper/causes", "paper/winner")
JUDGED_BY = (
    "algebraic-sizes",
    "algebraic-starts",
    "homotopy",
    "operators-of-k",
    "peers",
    "robustness",
    "paper/unsaid",
    "paper/table-1",
)

HIDDEN = (2 / 3, 4 / 5)
SEEDS = 20
FACTOR = 1.5
STUDIES = Path(__file__).parents[1] / "studies"


def entries_of(study: nlsolve.Study, folder: Path) -> dict[str, Entry]:
    """Case -> what is kept of it."""
    parts = Parts(folder)
    found = {case.id: parts.entry(identity_of(case).key) for case in study.cases}
    return {case: entry for case, entry in found.items() if entry is not None}


def judged(
    study: nlsolve.Study, costs: pd.DataFrame, entries: Mapping[str, Entry], known: list[str]
) -> tuple[float, bool, float]:
    """Forecast over truth of the sum of the other cases, whether the truth is in the interval, and its factor."""
    outlook = outlook_of(study, costs, {case: entries[case] for case in known})
    hidden = [case for case in entries if case not in known]
    shared = {case.id: case.way_id for case in study.cases if case.way_id}
    have = {shared.get(case) for case in known}
    truth = expected = 0.0
    for case in hidden:
        if not entries[case].startup:  # else it has loaded what the others found loaded
            truth += entries[case].elapsed - (entries[case].way if shared.get(case) in have else 0.0)
            expected += outlook.seconds(case)
    ratio, factor = expected / truth, outlook.own.factor
    return ratio, 1.0 / factor <= ratio <= factor, factor


def judge(name: str, folder: Path) -> None:
    """Print the lines of one study."""
    study = nlsolve.Study.from_toml(STUDIES / f"{name}.toml", quick=True)
    if not folder.exists():
        nlsolve.run(study, folder, jobs=1)
    entries, costs = entries_of(study, folder), forecast(study)
    whole = sum(entry.elapsed for entry in entries.values())
    for share in HIDDEN:
        number = max(1, round((1.0 - share) * len(entries)))
        trials = [
            judged(study, costs, entries, random.Random(seed).sample(list(entries), number)) for seed in range(SEEDS)
        ]
        ratios = np.array([ratio for ratio, _, _ in trials])
        near = sum(1 / FACTOR <= ratio <= FACTOR for ratio in ratios)
        wide = [most for _, _, most in trials if math.isfinite(most)]
        interval = f"{sum(inside for _, inside, _ in trials):3} of {SEEDS}" if wide else "–"
        factor = f"{math.exp(np.mean(np.log(wide))):.2f}" if wide else "–"
        print(
            f"{name:18} {len(entries):5} {whole:8.2f} s  {number:4} known  {np.median(ratios):5.2f} "
            f"({ratios.min():.2f} to {ratios.max():.2f})  {near:3} of {SEEDS}  {interval:>9}  {factor:>6}",
            flush=True,
        )


def main() -> None:
    """Print a table of the studies, those that the form was chosen on first."""
    asked = sys.argv[1:]
    print("study              cases  seconds    known        forecast / truth  within 1.5  in the interval  factor")
    with tempfile.TemporaryDirectory() as place:
        for heading, names in (("chosen on", CHOSEN_ON), ("judged by", JUDGED_BY)):
            print(heading)
            for name in names:
                if not asked or name in asked:
                    judge(name, Path(place) / name)


if __name__ == "__main__":
    main()
