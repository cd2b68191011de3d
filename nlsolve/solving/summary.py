"""One solve as a row of `runs`: how it ended, what it took, and what its last tangent knows of itself."""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from typing import Any

from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status
from nlsolve.results.columns import REPORTED
from nlsolve.solving.ledger import Ledger
from nlsolve.solving.tangent import Tangent


def row_of(outcome: Outcome, ledger: Ledger, tangent: Tangent) -> dict[str, Any]:
    """The columns of `nlsolve.results.columns.RUNS` that a single solve fills, whatever its ending."""
    return {
        "status": outcome.status.word,
        "message": outcome.message,
        "unknowns": len(outcome.state),
        "iterations": outcome.iterations,
        "branches": tangent.branches,
        "said_converged_but_is_not": int(outcome.claimed_wrongly),
        "said_failed_but_is": int(outcome.denied_wrongly),
        **outcome.blame,
        **ledger.work(),
        **reported(outcome.rows),
        **tangent.facts(),
        "residual_norm": outcome.residual_norm,
    }


def crashed(error: Exception) -> dict[str, Any]:
    """The same of a solve that ended in an error of the program or of a plugin: what it said, and where."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    message = f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})"
    return {"status": Status.CRASHED.word, "message": message}


def reported(rows: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """What the method's library says it did, over all rows of `steps`; None where it says nothing."""
    said = {name: [row[name] for row in rows if name in row] for name in REPORTED}
    return {name: sum(numbers) if numbers else None for name, numbers in said.items()}
