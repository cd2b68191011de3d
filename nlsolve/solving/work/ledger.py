"""Counts and seconds of the work a method asks for, by kind of work, kept outside the method.

Work is entered where it is done: residuals, Jacobians and series by `CountedProblem`, products by `CountedMatrix`,
factorisations and triangular solves by `Tangent`. The rest of a method's time is its own (`seconds_own`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

COUNTED = {
    "factorizations": "factorization",
    "triangular_solves": "triangular_solve",
    "jacobians": "jacobian",
    "residuals": "residual",
    "series_orders": "series_order",
}
"""Columns of `nlsolve.results.columns.RUNS`, and the kinds of work that they count."""

COUNTED_BESIDES = {"expansions": "expansion", "series_terms": "series_term", "matrix_products": "matrix_product"}
"""Further columns of `runs`, for a cost model, and the kinds of work that they count."""

KINDS = ("residual", "jacobian", "matrix_product", "factorization", "triangular_solve", "series_order")


@dataclass
class Ledger:
    """Counts and seconds by kind of work; the kind "method" holds all time spent inside a method.

    clock : returns seconds, by default those that the processor has worked for this process, which other programs do
        not lengthen.
    """

    clock: Callable[[], float] = time.process_time
    counts: Counter[str] = field(default_factory=Counter)
    seconds: Counter[str] = field(default_factory=Counter)

    @contextmanager
    def entry(self, kind: str) -> Iterator[None]:
        """Count one piece of work of this kind and the time it takes, even if it fails."""
        begun = self.clock()
        try:
            yield
        finally:
            self.seconds[kind] += self.clock() - begun  # type: ignore[assignment]
            self.counts[kind] += 1

    def work(self) -> dict[str, float]:
        """Counts and seconds of the work, under the names of `nlsolve.results.columns.RUNS`."""
        return {
            **{column: self.counts[kind] for column, kind in COUNTED.items()},
            "seconds": self.seconds["method"],
            "seconds_factorization": self.seconds["factorization"],
            "seconds_triangular_solve": self.seconds["triangular_solve"],
            "seconds_jacobian": self.seconds["jacobian"],
            "seconds_residual": self.seconds["residual"],
            "seconds_series": self.seconds["series_order"],
            **self.details(),
            "factor_solve_ratio": self.each("factorization") / self.each("triangular_solve"),
        }

    def each(self, kind: str) -> float:
        """Mean seconds of one piece of work of this kind; NaN when there was none."""
        return self.seconds[kind] / self.counts[kind] if self.counts[kind] else float("nan")

    def details(self) -> dict[str, float]:
        """Further counts for a cost model, and the seconds of the method's own arithmetic, by columns of `runs`."""
        asked_for = sum(self.seconds[kind] for kind in KINDS)
        return {
            **{column: self.counts[kind] for column, kind in COUNTED_BESIDES.items()},
            "seconds_own": self.seconds["method"] - asked_for,
        }

    def copy(self) -> Ledger:
        """A copy, which later entries do not change."""
        return Ledger(self.clock, self.counts.copy(), self.seconds.copy())

    def since(self, before: Ledger) -> Ledger:
        """A ledger of what has been entered since `before`, a copy of this ledger, was made."""
        counts = {kind: count - before.counts[kind] for kind, count in self.counts.items()}
        seconds = {kind: spent - before.seconds[kind] for kind, spent in self.seconds.items()}
        return Ledger(self.clock, Counter(counts), Counter(seconds))

    def add(self, counts: Mapping[str, int], seconds: Mapping[str, float]) -> None:
        """Enter work that was done elsewhere, by kind."""
        self.counts.update(counts)
        self.seconds.update(seconds)

    def counted(self) -> dict[str, int]:
        """How often each kind of work was done, by columns of `runs`."""
        return {column: self.counts[kind] for column, kind in (COUNTED | COUNTED_BESIDES).items()}

    def timed(self) -> dict[str, float]:
        """Seconds by kind of work, "own" for the method's own arithmetic; their sum is the time spent in the method."""
        return {kind: self.seconds[kind] for kind in KINDS} | {"own": self.details()["seconds_own"]}
