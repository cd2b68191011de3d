"""Tables a study declares: one cell a run, rows and columns by parameter, the paper's values beside them.

Or, of many runs: the cheapest within an error (`cheapest`), how many there are (`count`), the share `solved`, who wins
(`crossover`).
"""

from __future__ import annotations

from nlsolve.show.tables.layout import build, check
from nlsolve.show.tables.spec import TableSpec
from nlsolve.show.tables.table import Table

__all__ = ["Table", "TableSpec", "build", "check"]
