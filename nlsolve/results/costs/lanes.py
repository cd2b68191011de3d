"""Where the seconds of a row come from, and what is said of a table or figure that shows them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import Annotated, Final, Literal

from pydantic import Field

from nlsolve.registry.problems import StudyError
from nlsolve.results.verdicts import AT_A_SOLUTION, Run, number, status_of

EXCLUSIVE: Final = "exclusive"
"""Lane of a case that ran alone on a core of its own, in a warm process; its seconds are the median of rounds."""

ALONE: Final = "alone"
"""Lane of a case beside which the run had no other."""

SHARED: Final = "shared"
"""Lane of a case that may have run beside others of the run, or beside whatever else a cluster does."""

UNKNOWN = "unknown"
"""Lane of a row that was computed before lanes were kept."""

MUCH = 0.1
"""Share of the core taken by others that is told."""

ONE: Final = "one"
"""What a table or figure says, or leaves unsaid, that shows seconds of one lane only."""

MIXED: Final = "mixed"
"""What a table or figure says that may show seconds of several lanes."""

Lanes = Annotated[
    Literal["one", "mixed"],
    Field(
        description="lanes that seconds shown may come from: one, else there is no table or figure but a sentence; or "
        "mixed, which is told beneath"
    ),
]
"""Type of the field `lanes` of tables and figures."""

WAY_OUT = f'time them in one, by [timing] lane = "{EXCLUSIVE}", or say lanes = "{MIXED}" here'


def on_seconds(runs: Iterable[Run], lanes: str) -> tuple[str, ...]:
    """What is said under a table or figure with seconds of these runs; those that are not at a solution show none.

    lanes : "mixed" where they may come from several lanes. Raises StudyError where they do and may not.
    """
    timed = [run for run in runs if status_of(run) in AT_A_SOLUTION]
    found = Counter(lane_of(run) for run in timed)
    if len(found) > 1:
        words = ", ".join(f"{count} {lane}" for lane, count in found.items())
        if lanes != MIXED:
            raise StudyError(f"its seconds come from several lanes ({words}): {WAY_OUT}")
        return (f"Seconds come from several lanes and compare only within one: {words}.",)
    if SHARED in found:
        return ("Seconds were taken beside other cases (lane shared).",)
    return _on_rounds(timed) if EXCLUSIVE in found else ()


def lane_of(run: Run) -> str:
    """The lane of a row."""
    lane = run.get("lane")
    return lane if isinstance(lane, str) else UNKNOWN


def half_width(run: Run) -> float:
    """Half the width of the interval of the median, over the median; NaN where there is no interval, or it is of 0."""
    low, middle, high = (number(run.get(name)) for name in ("seconds_low", "seconds", "seconds_high"))
    return (high - low) / (2.0 * middle) if middle > 0.0 else math.nan


def _on_rounds(timed: Iterable[Run]) -> tuple[str, ...]:
    """How certain the medians of the exclusive lane are, and how much of the core others took."""
    rows = list(timed)
    rounds = sorted({int(number(run["rounds"])) for run in rows})
    widths = [half_width(run) for run in rows]
    told = f"Seconds are medians of {_span(rounds)} rounds in the exclusive lane; "
    known = [width for width in widths if not math.isnan(width)]
    told += f"95 % intervals are at most ± {100 * max(known):.2g} %" if known else "too few for an interval"
    without = len(rows) - len(known)
    told += f", and {without} of {len(rows)} have none." if known and without else "."
    disturbed = sum(number(run.get("load")) > MUCH for run in rows)
    if not disturbed:
        return (told,)
    cases = f"{disturbed} of {len(rows)} cases"
    return told, f"Others took more than {100 * MUCH:g} % of the core of {cases} (column load)."


def _span(counts: list[int]) -> str:
    return str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
