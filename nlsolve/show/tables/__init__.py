"""Tables a study declares: a cell a run, rows and columns by parameter, the values of a paper beside them.

Or a cell for many runs: the cheapest within an error (`cheapest`), their number (`count`), the share `solved`, or which
strategy is cheapest where (`crossover`).
"""

from __future__ import annotations

from nlsolve.show.tables.latex.floats import PREAMBLE, PREAMBLE_FILE
from nlsolve.show.tables.layout import build, built, check
from nlsolve.show.tables.spec import TableSpec
from nlsolve.show.tables.table import Table

__all__ = [
    "PREAMBLE",
    "PREAMBLE_FILE",
    "Table",
    "TableSpec",
    "build",
    "built",
    "check",
]
