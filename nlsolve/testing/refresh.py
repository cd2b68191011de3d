"""When a new K*? The check of refresh rules."""

from __future__ import annotations

import numpy as np

from nlsolve.solvers import Evidence, RefreshRule
from nlsolve.testing.promises import require


def check_refresh_rule(rule: RefreshRule) -> None:
    """A plain answer to any evidence, the same each time, be it not yet observed (None) or not a number."""
    for seen in (None, 0.0, 0.5, 1.0, 1e9, np.nan):
        for evidence in (Evidence(1, seen), Evidence(1, None, seen), Evidence(99, seen, seen)):
            first, again = rule.due(evidence), rule.due(evidence)
            require(isinstance(first, (bool, np.bool_)), f"due({evidence}) is {first!r}, not True or False")
            require(first == again, f"due({evidence}) changed its mind: a rule may look at the evidence only")
